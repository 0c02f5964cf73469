//! Posterior of earlier flights as prior of an offline calibration, and back.

use crate::calibration::EarlierFlights;
use crate::estimator::CalibrationPosterior;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, ParameterId, Parameterization};
use crate::sensors::{CameraRig, GimbalRig};
use crate::session::plan::{FlightPrior, SessionError};

/// Prior of an offline calibration of the static camera and the gimbal camera; `mounts` are the `imu_from_camera` of the
/// first and the gimbal of the second.
///
/// # Errors
/// If the posterior belongs to another mechanism, or to a parameterization that the offline calibration does not have.
pub(super) fn earlier_flights(
    prior: &FlightPrior,
    cameras: [&CameraRig; 2],
    (imu_from_camera, gimbal): (RigidTransform, &GimbalRig),
) -> Result<EarlierFlights, SessionError> {
    let user = "the offline calibration".to_owned();
    let refused = |problem: String| SessionError::Prior { user, problem, folder: prior.folder.clone() };
    let places = cameras.map(|camera| prior.place(&camera.key));
    let check = || {
        prior.check_cameras(&cameras.map(|camera| camera.key.as_str()), &places)?;
        let joints: Vec<String> = gimbal.joints.iter().map(|joint| joint.name.clone()).collect();
        let mount = ClassicalChain { imu_from_base: imu_from_camera, ..ClassicalChain::default() };
        for (place, chain) in places.into_iter().zip([&mount, &gimbal.chain]) {
            let Some(place) = place else { continue };
            prior.check_chain(place, chain, &joints, true)?;
            let parameterization = prior.posterior.cameras[place].parameterization;
            if matches!(parameterization, Parameterization::Classical | Parameterization::Poe) {
                return Err(format!(
                    "its parameterization is {parameterization}, the offline calibration needs a minimal one"
                ));
            }
        }
        Ok(())
    };
    check().map_err(refused)?;
    let given_shifts_s = cameras.map(|camera| camera.timeshift_cam_imu_s);
    Ok(EarlierFlights { posterior: prior.posterior.grown(prior.growth), places, given_shifts_s })
}

/// Posterior with the time offsets of its cameras instead of their changes against the rig; `cameras` are in its order.
pub(super) fn with_absolute_shifts(posterior: &CalibrationPosterior, cameras: [&CameraRig; 2]) -> CalibrationPosterior {
    let mut absolute = posterior.clone();
    for (found, camera) in absolute.cameras.iter_mut().zip(cameras) {
        let columns = found.parameters.iter().zip(&mut found.values);
        for (_, shift_s) in columns.filter(|(parameter, _)| **parameter == ParameterId::timeshift(0)) {
            *shift_s += camera.timeshift_cam_imu_s;
        }
    }
    absolute
}
