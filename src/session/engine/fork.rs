//! Application of a fork's changes to its parent's engine.

use std::collections::BTreeSet;

use super::altered_measurements::AlteredMeasurements;
use super::corrections::MeasurementCorrections;
use super::run_engine::RunEngine;
use crate::gimbal::{Parameterization, auto_parameterization};
use crate::sensors::Rig;
use crate::session::plan::{ForkChanges, ForkError, ParameterizationChoice};

/// Applies `changes` to the parent's engine, in its state before the fork's first step. `camera_key` is the key of the
/// main camera.
pub(in crate::session) fn apply_fork(
    changes: &ForkChanges,
    engine: &mut RunEngine,
    rig: &Rig,
    camera_key: &str,
) -> Result<(), ForkError> {
    let disabled_cameras = disabled_cameras(changes, &engine.camera_keys(camera_key))?;
    let corrections = MeasurementCorrections::of(&changes.corrections, rig, camera_key)?;
    let estimator = engine.estimator_mut();
    if let Some(choice) = changes.parameterization {
        let (parameterization, auto_parameterize) = match choice {
            ParameterizationChoice::Minimal => (Parameterization::Minimal, false),
            ParameterizationChoice::MinimalSwapped => (Parameterization::MinimalSwapped, false),
            ParameterizationChoice::Classical => (Parameterization::Classical, false),
            ParameterizationChoice::Poe => (Parameterization::Poe, false),
            _ => (auto_parameterization(&estimator.classical_chain()), true),
        };
        estimator.use_parameterization(parameterization, auto_parameterize);
    }
    for columns in &changes.estimated {
        estimator.estimate_sensors(*columns)?;
    }
    let names = rig.parameter_names();
    let known = estimator.parameters();
    let parameter = |name: &String| {
        let parameter = names.parse(name).filter(|parameter| known.contains(parameter));
        parameter.ok_or_else(|| ForkError::UnknownParameter {
            name: name.clone(),
            known: known.iter().map(|parameter| names.name(*parameter)).collect(),
        })
    };
    for (name, value) in &changes.values {
        estimator.set_value(parameter(name)?, *value)?;
    }
    for name in &changes.frozen {
        estimator.freeze(parameter(name)?)?;
    }
    estimator.scale_imu_noise(changes.imu_noise);
    estimator.scale_pixel_noise(changes.pixel_noise);
    estimator.scale_chain_prior(changes.chain_prior);
    let dropped = changes.dropped.clone();
    for camera in 0..engine.cameras() {
        let all = disabled_cameras.contains(&camera);
        engine.estimator_mut().drop_features(camera, |id| all || dropped.contains(&id.of_camera(camera).0));
    }
    engine.alter(AlteredMeasurements {
        dropped: changes.dropped.clone(),
        disabled_cameras,
        encoder_off: !changes.encoder,
        joint_noise_rad: changes.joint_noise_rad,
        encoder_noise: changes.encoder_noise,
        corrections,
    });
    Ok(())
}

/// Indices of the disabled cameras in `keys`.
fn disabled_cameras(changes: &ForkChanges, keys: &[String]) -> Result<BTreeSet<usize>, ForkError> {
    let number = |key: &String| keys.iter().position(|known| known == key);
    let missing = |key: &String| ForkError::NoCamera { camera: key.clone(), present: keys.join(", ") };
    let disabled_cameras: BTreeSet<usize> =
        changes.without.iter().map(|key| number(key).ok_or_else(|| missing(key))).collect::<Result<_, _>>()?;
    if disabled_cameras.len() == keys.len() {
        return Err(ForkError::Blind { without: keys.join(", ") });
    }
    Ok(disabled_cameras)
}
