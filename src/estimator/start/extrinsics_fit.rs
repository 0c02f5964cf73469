//! Fit of joint angles and chain parameters to the camera rotations of a solution.

use nalgebra::{DMatrix, Dyn};

use crate::estimator::factors::joint_motion::UNKNOWN_JOINT_SIGMA_RAD;
use crate::estimator::state::calibration::Calibration;
use crate::estimator::window::frames::Frames;
use crate::geometry::{RigidTransform, so3};
use crate::optimization::{NormalEquations, gauss_newton};

/// Standard deviation of the initialization's rotations `imu_from_camera`.
const EXTRINSICS_SIGMA_RAD: f64 = 0.01;
const ROUNDS: usize = 10;

/// Fits chain parameters and joint angles to the rotations `imu_from_camera` of the frames by Gauss–Newton, with the
/// encoder angles and the rig's chain prior as priors. Changes nothing when the equations are singular or there are no
/// joints.
pub(super) fn fit_extrinsics(calibration: &mut Calibration, frames: &mut Frames, imu_from_camera: &[RigidTransform]) {
    let joints = calibration.joint_count();
    if joints == 0 || imu_from_camera.len() != frames.len() {
        return;
    }
    let dof = calibration.dof();
    let total = dof + joints * imu_from_camera.len();
    let sigma = |slot: usize, joint: usize| -> f64 {
        frames[slot].encoder.as_ref().map_or(UNKNOWN_JOINT_SIGMA_RAD, |encoder| encoder.sigmas_rad[joint])
    };
    let starts: Vec<Vec<f64>> = frames.iter().map(|frame| frame.state.joints_rad.clone()).collect();
    let linearize = |(fitted, angles): &(Calibration, Vec<Vec<f64>>)| {
        let mut equations = NormalEquations::zeros(Dyn(total));
        if dof > 0 {
            let rows = fitted.prior_jacobian();
            equations.hessian.view_mut((0, 0), (dof, dof)).copy_from(&rows.tr_mul(&rows));
            equations.gradient.rows_mut(0, dof).copy_from(&rows.tr_mul(&fitted.prior_residual()));
        }
        for (slot, extrinsics) in imu_from_camera.iter().enumerate() {
            let chain = fitted.linearize(&angles[slot]);
            let error = so3::log(&(extrinsics.rotation.inverse() * chain.imu_from_camera.rotation));
            let mut rows = DMatrix::zeros(3, total);
            let place = dof + joints * slot;
            rows.columns_mut(0, dof).copy_from(&chain.by_parameters.fixed_rows::<3>(0));
            rows.columns_mut(place, joints).copy_from(&chain.by_joints.fixed_rows::<3>(0));
            let rows = so3::right_jacobian_inverse(&error) * rows / EXTRINSICS_SIGMA_RAD;
            equations.add(&(error / EXTRINSICS_SIGMA_RAD), &rows, 1.0);
            for joint in 0..joints {
                let error_rad = angles[slot][joint] - starts[slot][joint];
                equations.add_diagonal(place + joint, error_rad, sigma(slot, joint).powi(-2));
            }
        }
        Some(equations)
    };
    let mut fit = (calibration.clone(), starts.clone());
    let solved = gauss_newton(&mut fit, ROUNDS, linearize, |(fitted, angles), step| {
        *fitted = fitted.stepped(&step.as_slice()[..dof]);
        angles.iter_mut().flatten().zip(step.iter().skip(dof)).for_each(|(angle, change)| *angle += change);
        step.amax() < 1e-6
    });
    if solved.is_some() {
        let angles;
        (*calibration, angles) = fit;
        for (frame, angles) in frames.iter_mut().zip(angles) {
            frame.state.joints_rad = angles;
        }
    }
}
