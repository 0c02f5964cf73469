//! Static calibration in the report: parameters, values and standard deviations of its columns.

use super::setup::Setup;
use crate::estimator::report::CalibrationEstimate;
use crate::estimator::state::calibrations::{Calibrations, MAIN};

/// Static calibration with the standard deviations of its columns: NaN before a solve, zero if it is fixed.
pub(crate) fn calibration_estimate(setup: &Setup, calibration: &Calibrations, sigmas: &[f64]) -> CalibrationEstimate {
    let cameras = || (0..calibration.cameras()).map(|camera| calibration.of(camera));
    let parameters = calibration.parameters();
    let chain = calibration.of(MAIN).chain();
    let sigmas = if calibration.dof() == 0 {
        vec![0.0; parameters.len()]
    } else if sigmas.len() == parameters.len() {
        sigmas.to_vec()
    } else {
        vec![f64::NAN; parameters.len()]
    };
    let rigid_cameras = setup.config.rigid_cameras.iter().zip(cameras().skip(1));
    CalibrationEstimate {
        parameterization: chain.parameterization(),
        parameters,
        values: calibration.values(),
        sigmas,
        prior_sigmas: calibration.prior_sigmas(),
        classical: chain.to_classical(),
        margins: chain.margins(),
        rigid_cameras: rigid_cameras
            .map(|(camera, calibration)| (camera.key.clone(), calibration.imu_from_camera(&[])))
            .collect(),
    }
}
