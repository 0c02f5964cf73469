//! Pose of the IMU on the gimbal through the chain, with its derivatives.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::calibration::Calibration;
use super::camera_pose::camera_map;
use super::frame_state::FrameState;
use super::navigation::{Matrix15, NavigationState, Vector15};
use crate::geometry::{RigidTransform, so3};
use crate::sensors::ImuSample;

/// Rig's pose of the IMU in the gimbal camera's frame, with estimated corrections.
#[derive(Clone, Debug)]
pub(crate) struct GimbalImuMount {
    /// `camera_from_imu1` with the estimated corrections.
    pub(crate) camera_from_imu: RigidTransform,
    /// Rotation vector of the correction: `R = R_rig Exp(r)`.
    pub(crate) rotation_vector: Vector3<f64>,
    /// Time of the measurements minus their stamps, relative to the rig, in seconds.
    pub(crate) shift_s: f64,
    /// First of the six columns of rotation and position among the camera's columns, `None` if they are fixed.
    pub(crate) pose_column: Option<usize>,
    /// Column of the time offset, `None` if it is fixed.
    pub(crate) shift_column: Option<usize>,
}

impl GimbalImuMount {
    /// Mount of a camera's calibration, `None` without such an IMU.
    pub(crate) fn new(calibration: &Calibration) -> Option<Self> {
        let given = calibration.given_gimbal_imu()?;
        let [rotation_vector, offset_m] = calibration.gimbal_imu_correction();
        let free = calibration.dof() > 0;
        Some(Self {
            camera_from_imu: RigidTransform::new(
                given.rotation * so3::exp(&rotation_vector),
                given.translation_m + offset_m,
            ),
            rotation_vector,
            shift_s: calibration.gimbal_imu_shift_s(),
            pose_column: calibration.gimbal_imu_pose_column().filter(|_| free),
            shift_column: calibration.gimbal_imu_shift_column().filter(|_| free),
        })
    }

    /// State of the IMU at the stamp of a frame; `None` without such an IMU.
    pub(crate) fn state(&self, frame: &FrameState, calibration: &Calibration) -> Option<NavigationState> {
        let own = frame.gimbal_imu?;
        let imu_from_camera = calibration.imu_from_camera(&frame.joints_rad);
        Some(NavigationState {
            world_from_imu: frame.navigation.world_from_imu * imu_from_camera * self.camera_from_imu,
            velocity_m_per_s: own.velocity_m_per_s,
            bias: own.bias,
        })
    }

    /// Derivatives of [`Self::state`]'s pose `[φ, p]`: by pose and joints of the frame (6 × (6 + N)), and by the
    /// camera's calibration (6 × columns).
    ///
    /// ```text
    /// φ_2 = Rᵀ φ_c + J_r(r) δr    p_2 = p_c − R_wc [t]× φ_c + R_wc δt
    /// ```
    ///
    /// with `[φ_c, p_c]` of the camera and `(R, t) = camera_from_imu1`.
    pub(crate) fn maps(&self, frame: &FrameState, calibration: &Calibration) -> (DMatrix<f64>, DMatrix<f64>) {
        let chain = calibration.linearize(&frame.joints_rad);
        let world_from_imu = frame.navigation.world_from_imu.rotation_matrix();
        let world_from_camera = world_from_imu * chain.imu_from_camera.rotation_matrix();
        let (own, by_calibration) = camera_map(&world_from_imu, frame.joints_rad.len(), &chain);
        let mut carried = DMatrix::<f64>::identity(6, 6);
        let rotation = self.camera_from_imu.rotation_matrix();
        carried.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation.transpose());
        let lever = world_from_camera * so3::hat(&self.camera_from_imu.translation_m);
        carried.fixed_view_mut::<3, 3>(3, 0).copy_from(&-lever);
        let mut by_calibration = &carried * by_calibration;
        if let Some(column) = self.pose_column {
            let by_rotation = so3::right_jacobian(&self.rotation_vector);
            by_calibration.view_mut((0, column), (3, 3)).copy_from(&by_rotation);
            by_calibration.view_mut((3, column + 3), (3, 3)).copy_from(&world_from_camera);
        }
        (carried * own, by_calibration)
    }

    /// State extrapolated from a stamp to the time of the measurement with that stamp, at the rate and specific force
    /// of this sample.
    pub(crate) fn shifted(
        &self,
        state: &NavigationState,
        sample: &ImuSample,
        gravity: &Vector3<f64>,
    ) -> NavigationState {
        if self.shift_s == 0.0 {
            return *state;
        }
        let (rate, acceleration) = motion(state, sample, gravity);
        NavigationState {
            world_from_imu: RigidTransform::new(
                so3::plus(&state.world_from_imu.rotation, &(rate * self.shift_s)),
                state.world_from_imu.translation_m + state.velocity_m_per_s * self.shift_s,
            ),
            velocity_m_per_s: state.velocity_m_per_s + acceleration * self.shift_s,
            bias: state.bias,
        }
    }

    /// Derivatives of [`Self::shifted`] by the state (15 × 15) and by the time offset (15 × 1).
    pub(crate) fn shift_maps(
        &self,
        state: &NavigationState,
        sample: &ImuSample,
        gravity: &Vector3<f64>,
    ) -> (Matrix15, Vector15) {
        let tau = self.shift_s;
        let (rate, acceleration) = motion(state, sample, gravity);
        let force = sample.specific_force_m_per_s2 - state.bias.accelerometer_m_per_s2;
        let rotation = state.world_from_imu.rotation_matrix();
        let angle = rate * tau;
        let mut by_state = Matrix15::identity();
        let back = so3::exp(&-angle).to_rotation_matrix().into_inner();
        by_state.fixed_view_mut::<3, 3>(0, 0).copy_from(&back);
        by_state.fixed_view_mut::<3, 3>(0, 9).copy_from(&(so3::right_jacobian(&angle) * -tau));
        by_state.fixed_view_mut::<3, 3>(3, 6).copy_from(&(Matrix3::identity() * tau));
        by_state.fixed_view_mut::<3, 3>(6, 0).copy_from(&(rotation * so3::hat(&force) * -tau));
        by_state.fixed_view_mut::<3, 3>(6, 12).copy_from(&(rotation * -tau));
        let mut by_shift = Vector15::zeros();
        by_shift.fixed_rows_mut::<3>(0).copy_from(&rate);
        by_shift.fixed_rows_mut::<3>(3).copy_from(&state.velocity_m_per_s);
        by_shift.fixed_rows_mut::<3>(6).copy_from(&acceleration);
        (by_state, by_shift)
    }
}

/// Angular velocity in the IMU frame in rad/s, and acceleration in the world in m/s², measured by a sample.
fn motion(state: &NavigationState, sample: &ImuSample, gravity: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let rate = sample.angular_velocity_rad_per_s - state.bias.gyroscope_rad_per_s;
    let force = sample.specific_force_m_per_s2 - state.bias.accelerometer_m_per_s2;
    (rate, state.world_from_imu.rotation * force + gravity)
}
