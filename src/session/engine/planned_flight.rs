//! Situation before a flight that is to be planned: a rig, and the run that will estimate its calibration.

use super::configuration::estimator_config;
use crate::observability::laboratory::{LaboratoryJoint, PLAN_FRAME_PERIOD_S, Situation};
use crate::sensors::{CameraMount, Rig};
use crate::session::plan::{RunSpec, SessionError, cameras_of_run};

/// Largest time around an image from which encoder readings are averaged, in seconds.
const MAX_BATCH_S: f64 = 0.05;
/// Smallest number of readings that are averaged.
const MIN_BATCH: f64 = 3.0;
/// Variance of the middle of a parabola fitted to evenly spaced readings, times their number.
const PARABOLA_VARIANCE: f64 = 2.25;

/// Situation before a flight, with the noise, the prior and the parameterization of a run and a scene at these
/// distances.
///
/// # Errors
/// If the rig has no camera for the run, or the run does not estimate the chain alone.
pub fn situation_before_flight(rig: &Rig, spec: &RunSpec, distances_m: Vec<f64>) -> Result<Situation, SessionError> {
    let unplannable =
        |problem: &str| SessionError::Unplannable { run: spec.label.clone(), problem: problem.to_owned() };
    if !spec.calibrate {
        return Err(unplannable("it does not estimate the calibration (calibrate=off)"));
    }
    if spec.timeshift || spec.readout || spec.intrinsics || spec.imu_intrinsics {
        return Err(unplannable("a plan covers the parameters of the chain only, not those of the sensors"));
    }
    let config = estimator_config(rig, spec)?;
    let camera = cameras_of_run(rig, spec)?.main;
    let gimbal = rig.gimbal.as_ref().filter(|_| camera.mount == CameraMount::Gimbal);
    let joints = gimbal.map_or(&[][..], |gimbal| gimbal.joints.as_slice()).iter();
    let joints = joints.map(|joint| LaboratoryJoint { name: joint.name.clone(), limits_rad: joint.limits_rad });
    let encoder_sigma_rad = config.encoder_in_use().map(|sigma_rad| {
        let at_image = averaged_sigma_rad(sigma_rad, gimbal.map_or(0.0, |gimbal| gimbal.rate_hz), camera.rate_hz);
        // The readings at images that do not become keyframes are carried to the next one.
        at_image / (PLAN_FRAME_PERIOD_S * camera.rate_hz).max(1.0).sqrt()
    });
    Situation::before_flight(&config, joints.collect(), rig.parameter_names(), encoder_sigma_rad, distances_m)
        .ok_or_else(|| unplannable("the mechanism or its prior is not finite"))
}

/// Standard deviation of a joint angle at an image, from the readings around it as the reader of logs averages them if
/// their noise is white.
fn averaged_sigma_rad(sigma_rad: f64, encoder_rate_hz: f64, camera_rate_hz: f64) -> f64 {
    let batch_s = camera_rate_hz.recip().min(MAX_BATCH_S);
    let readings = (encoder_rate_hz * batch_s).floor();
    if readings >= MIN_BATCH { sigma_rad * (PARABOLA_VARIANCE / readings).sqrt().min(1.0) } else { sigma_rad }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::JointKnowledge;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    #[test]
    fn a_situation_has_the_noise_and_prior_of_its_run() {
        let rig = synthetic_tracks(&SyntheticOptions { duration_s: 0.5, ..SyntheticOptions::default() }).given_rig;
        let of = |spec: &str| situation_before_flight(&rig, &spec.parse().unwrap(), vec![5.0]);
        let minimal = of("minimal:pixel-noise=2").unwrap();
        assert_eq!(minimal.chain.parameters().len(), 18);
        assert!((minimal.pixel_sigma_px - 0.5).abs() < 1e-12);
        // Ten readings per image interval of 50 ms, five images per predicted frame.
        let JointKnowledge::Encoder(sigma_rad) = minimal.encoders else { panic!("the rig has encoders") };
        assert!((sigma_rad / 0.5_f64.to_radians() - 0.045_f64.sqrt()).abs() < 1e-9, "{sigma_rad}");
        let (translation_m, rotation_rad) = rig.gimbal.as_ref().unwrap().prior.sigmas();
        let covariance = minimal.information.clone().cholesky().unwrap().inverse();
        for (column, parameter) in minimal.chain.parameters().into_iter().enumerate() {
            let sigma = covariance[(column, column)].sqrt() * parameter.scale();
            let least = if parameter.scale() == 0.03 { translation_m } else { rotation_rad };
            assert!(sigma > 0.9 * least && sigma < 4.0 * least, "{parameter:?}: {sigma}");
        }
        let without = of("minimal:encoder=off").unwrap();
        assert_eq!((without.encoders, without.chain.parameters().len()), (JointKnowledge::Unknown, 15));
        for (spec, words) in [("auto:calibrate=off", "does not estimate"), ("auto:timeshift=on", "of the chain only")] {
            let problem = of(spec).unwrap_err().to_string();
            assert!(problem.contains(words), "{problem}");
        }
    }
}
