//! Prediction of the newest frame by the IMU on the gimbal.

use nalgebra::{Dyn, UnitQuaternion};

use super::setup::Setup;
use super::window_state::WindowState;
use crate::estimator::state::calibration::Calibration;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::gimbal_imu::GimbalImuMount;
use crate::estimator::state::navigation::GimbalImuState;
use crate::estimator::state::navigation::NavigationState;
use crate::estimator::state::preintegration::Preintegration;
use crate::estimator::step_input::StepInput;
use crate::geometry::so3;
use crate::optimization::{NormalEquations, gauss_newton};

/// Damping of the fit of joint angles: near parallel axes the angles keep their values.
const DAMPING: f64 = 1e-4;
const ROUNDS: usize = 5;

/// Prediction of the newest frame.
#[derive(Clone, Debug, Default)]
pub(super) struct GimbalImuPrediction {
    /// Velocity and biases, `None` without such an IMU.
    pub(super) state: Option<GimbalImuState>,
    /// Joint angles by the difference of both gyroscopes since the last frame, in radians; `None` without samples.
    pub(super) joints_rad: Option<Vec<f64>>,
    /// Samples since the last frame, `None` where some are missing.
    pub(super) motion: Option<Preintegration>,
}

impl WindowState {
    /// Predicts velocity, biases and joint angles at the image of `input`, where the vehicle is predicted to be at
    /// `navigation`.
    pub(super) fn predict_gimbal_imu(
        &self,
        setup: &Setup,
        input: &StepInput<'_>,
        navigation: &NavigationState,
    ) -> GimbalImuPrediction {
        let last = self.frames.newest();
        let calibration = self.calibration.of(MAIN);
        let Some((own, mount)) = last.state.gimbal_imu.zip(GimbalImuMount::new(calibration)) else {
            return GimbalImuPrediction::default();
        };
        let motion = setup.gimbal_motion(input.gimbal_imu, own.bias, input.stamp_ns - last.stamp_ns);
        let predicted = motion.as_ref().zip(mount.state(&last.state, calibration));
        let Some(predicted) = predicted.map(|(motion, state)| motion.predict(&state, &setup.gravity_in_world)) else {
            let change = navigation.velocity_m_per_s - last.state.navigation.velocity_m_per_s;
            let state = GimbalImuState { velocity_m_per_s: own.velocity_m_per_s + change, ..own };
            return GimbalImuPrediction { state: Some(state), joints_rad: None, motion: None };
        };
        let imu_from_camera = navigation.world_from_imu.rotation.inverse()
            * predicted.world_from_imu.rotation
            * mount.camera_from_imu.rotation.inverse();
        GimbalImuPrediction {
            state: Some(GimbalImuState { velocity_m_per_s: predicted.velocity_m_per_s, ..own }),
            joints_rad: joints_at(calibration, &last.state.joints_rad, &imu_from_camera),
            motion,
        }
    }
}

/// Joint angles at which the chain has an orientation `imu_from_camera`, or comes nearest to it, from `start_rad` by
/// Gauss–Newton; `None` if they are not finite.
fn joints_at(calibration: &Calibration, start_rad: &[f64], imu_from_camera: &UnitQuaternion<f64>) -> Option<Vec<f64>> {
    let mut angles_rad = start_rad.to_vec();
    let linearize = |angles_rad: &Vec<f64>| {
        let chain = calibration.linearize(angles_rad);
        let error = so3::log(&(chain.imu_from_camera.rotation.inverse() * imu_from_camera));
        let mut equations = NormalEquations::zeros(Dyn(angles_rad.len()));
        equations.add(&-error, &chain.by_joints.fixed_rows::<3>(0), 1.0);
        for joint in 0..angles_rad.len() {
            equations.add_diagonal(joint, 0.0, DAMPING);
        }
        Some(equations)
    };
    gauss_newton(&mut angles_rad, ROUNDS, linearize, |angles_rad, step| {
        angles_rad.iter_mut().zip(step.iter()).for_each(|(angle, change)| *angle += change);
        step.amax() < 1e-6
    })?;
    Some(angles_rad)
}
