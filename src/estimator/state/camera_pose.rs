//! Camera poses and their derivatives with respect to the unknowns of the window.

use std::borrow::Cow;

use nalgebra::{DMatrix, Matrix3, Matrix6xX};

use super::calibration::Calibration;
use super::layout::POSE;
use crate::estimator::state::frame_state::FrameState;
use crate::geometry::so3;
use crate::gimbal::{Chain, ChainLinearization};
use crate::optimization::CameraPose;

/// Extrinsics and time offset of a camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraExtrinsics<'a> {
    pub(crate) chain: &'a Chain,
    /// Number of calibration columns, time offsets after the chain; zero when fixed.
    pub(crate) columns: usize,
    /// Time offset in seconds: exposure time minus stamp.
    pub(crate) shift_s: f64,
    /// Column of the time offset.
    pub(crate) shift_column: Option<usize>,
}

impl CameraExtrinsics<'_> {
    /// A rigid camera ignores the joints.
    fn own<'j>(&self, joints_rad: &'j [f64]) -> &'j [f64] {
        &joints_rad[..self.chain.joint_count().min(joints_rad.len())]
    }

    fn linearize(&self, joints_rad: &[f64]) -> ChainLinearization {
        let mut linearization = self.chain.linearize(self.own(joints_rad));
        if linearization.by_parameters.ncols() != self.columns {
            linearization.by_parameters = linearization.by_parameters.resize_horizontally(self.columns, 0.0);
        }
        linearization
    }
}

impl Calibration {
    /// Extrinsics and time offset of the camera.
    pub(crate) fn extrinsics(&self) -> CameraExtrinsics<'_> {
        CameraExtrinsics {
            chain: self.chain(),
            columns: self.dof(),
            shift_s: self.camera_shift_s(),
            shift_column: self.camera_shift_column(),
        }
    }
}

/// Returns `world_from_camera` at a state: the IMU pose and the extrinsics at the state's joint angles, both
/// shifted by the time offset.
pub(crate) fn at(state: &FrameState, calibration: &Calibration) -> CameraPose {
    at_extrinsics(state, &calibration.extrinsics())
}

/// [`at`] for given extrinsics.
pub(crate) fn at_extrinsics(state: &FrameState, extrinsics: &CameraExtrinsics<'_>) -> CameraPose {
    let state = &*when_seen(state, extrinsics.shift_s);
    let pose = state.navigation.world_from_imu * extrinsics.chain.imu_from_camera(extrinsics.own(&state.joints_rad));
    CameraPose { rotation: pose.rotation_matrix(), position_m: pose.translation_m }
}

/// State at the exposure, `shift_s` after the stamp.
pub(crate) fn when_seen(state: &FrameState, shift_s: f64) -> Cow<'_, FrameState> {
    if shift_s == 0.0 { Cow::Borrowed(state) } else { Cow::Owned(state.later(shift_s)) }
}

/// Poses of the camera by slot.
pub(crate) fn by_slot(frames: &[FrameState], calibration: &Calibration) -> Vec<CameraPose> {
    frames.iter().map(|state| at(state, calibration)).collect()
}

/// Derivatives of `[φ; δt]` of `world_from_camera` with respect to the unknowns, by slot.
#[derive(Clone, Debug)]
pub(crate) struct CameraMaps {
    /// 6 × (6 + N), with respect to pose and joints of the frame.
    pub(crate) own: Vec<DMatrix<f64>>,
    /// 6 × columns, with respect to the camera's calibration.
    pub(crate) calibration: Vec<DMatrix<f64>>,
}

impl CameraMaps {
    /// Derivatives at these states and this calibration.
    pub(crate) fn new(frames: &[FrameState], calibration: &Calibration) -> Self {
        Self::of_extrinsics(frames, &calibration.extrinsics())
    }

    /// [`Self::new`] for given extrinsics.
    ///
    /// The derivative of a time offset with respect to velocity and gyroscope bias is neglected: a bias change over
    /// a centisecond has no effect.
    pub(crate) fn of_extrinsics(frames: &[FrameState], extrinsics: &CameraExtrinsics<'_>) -> Self {
        let mut maps = Self { own: Vec::new(), calibration: Vec::new() };
        for stamped in frames {
            let state = &*when_seen(stamped, extrinsics.shift_s);
            let chain = extrinsics.linearize(&state.joints_rad);
            let world_from_imu = state.navigation.world_from_imu.rotation_matrix();
            let (mut own, mut by_calibration) = camera_map(&world_from_imu, state.joints_rad.len(), &chain);
            if let Some(column) = extrinsics.shift_column {
                by_calibration.set_column(column, &(&own * state.motion()));
            }
            if extrinsics.shift_s != 0.0 {
                // The unknown attitude is the one at the stamp.
                let at_stamp = stamped.navigation.world_from_imu.rotation_matrix();
                let by_rotation = own.fixed_columns::<3>(0) * world_from_imu.tr_mul(&at_stamp);
                own.fixed_columns_mut::<3>(0).copy_from(&by_rotation);
            }
            maps.own.push(own);
            maps.calibration.push(by_calibration);
        }
        maps
    }
}

/// Derivatives of the camera pose with respect to pose and joints of its frame (6 × (6 + N)) and to its
/// calibration (6 × columns), at this rotation of the vehicle.
pub(crate) fn camera_map(
    world_from_imu: &Matrix3<f64>,
    joints: usize,
    chain: &ChainLinearization,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let camera_from_imu = chain.imu_from_camera.rotation_matrix().transpose();
    let lever = chain.imu_from_camera.translation_m;
    let mut own = DMatrix::zeros(6, POSE + joints);
    own.fixed_view_mut::<3, 3>(0, 0).copy_from(&camera_from_imu);
    own.fixed_view_mut::<3, 3>(3, 0).copy_from(&(world_from_imu * so3::hat(&lever) * -1.0));
    own.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
    let carried = |part: &Matrix6xX<f64>| {
        let mut carried = DMatrix::from_column_slice(6, part.ncols(), part.as_slice());
        let shift = world_from_imu * part.fixed_rows::<3>(3);
        carried.fixed_rows_mut::<3>(3).copy_from(&shift);
        carried
    };
    // A rigid camera ignores the joints.
    own.columns_mut(POSE, chain.by_joints.ncols()).copy_from(&carried(&chain.by_joints));
    (own, carried(&chain.by_parameters))
}
