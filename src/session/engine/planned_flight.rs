//! Situation before a flight that is to be planned: a rig, and the run that will estimate its calibration.

use super::configuration::estimator_config;
use crate::flight_log::nominal_joint_sigma_rad;
use crate::observability::laboratory::{LaboratoryJoint, Situation};
use crate::sensors::{CameraMount, Rig};
use crate::session::plan::{RunSpec, SessionError, cameras_of_run};

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
    let encoder_rate_hz = gimbal.map_or(0.0, |gimbal| gimbal.rate_hz);
    let at_image = |sigma_rad| nominal_joint_sigma_rad(sigma_rad, encoder_rate_hz, camera.rate_hz);
    let encoder_sigma_rad = config.encoder_in_use().map(at_image);
    let (names, period_s) = (rig.parameter_names(), camera.rate_hz.recip());
    let situation =
        Situation::before_flight(&config, joints.collect(), names, encoder_sigma_rad, distances_m, period_s)
            .ok_or_else(|| unplannable("the mechanism or its prior is not finite"))?;
    Ok(Situation { required: rig.required_accuracy.clone(), ..situation })
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
        // Ten readings per image interval of 50 ms: the noise lies between the noise of a line and of a parabola.
        let JointKnowledge::Encoder(sigma_rad) = minimal.encoders else { panic!("the rig has encoders") };
        let ratio = sigma_rad / 0.5_f64.to_radians();
        assert!(ratio > 0.1_f64.sqrt() && ratio < 0.5 * (0.1_f64.sqrt() + 0.225_f64.sqrt()), "{ratio}");
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
