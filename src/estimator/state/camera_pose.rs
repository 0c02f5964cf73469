//! Camera poses and their derivatives with respect to the unknowns of the window.

use std::borrow::Cow;
use std::ops::Range;

use nalgebra::{DMatrix, Matrix3, Matrix6, Matrix6x3, Matrix6xX, Vector3};

use super::calibration::Calibration;
use super::calibrations::Calibrations;
use super::frame_state::{Exposure, FrameState};
use super::layout::{Layout, POSE, ROW_MOTION};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{Chain, ChainLinearization};
use crate::optimization::CameraPose;

/// Rows of a rolling shutter with a separate block of derivatives: first, middle and last, as fractions of the image.
pub(crate) const ROLLING_ROWS: [f64; 3] = [0.0, 0.5, 1.0];

/// Extrinsics, time offset and shutter of a camera.
#[derive(Clone, Debug)]
pub(crate) struct CameraCalibration<'a> {
    pub(crate) chain: Cow<'a, Chain>,
    /// Pose relative to the camera at the end of `chain`, without joints, and its first column; `None` if the camera is that
    /// one.
    pub(crate) mounted: Option<(Cow<'a, Chain>, usize)>,
    /// Index among the cameras of the run.
    pub(crate) camera: usize,
    /// Number of calibration columns: chain, then time offset, shutter and intrinsics; zero when fixed. Of a camera that is
    /// mounted on another one, those from the first column of the other one to its own last one.
    pub(crate) columns: usize,
    /// Time offset in seconds: exposure time of the first row minus stamp.
    pub(crate) shift_s: f64,
    /// Column of the time offset, `None` if it is fixed.
    pub(crate) shift_column: Option<usize>,
    /// True if the rows are exposed at different times.
    pub(crate) rolling: bool,
    /// Time from the exposure of the first row to the end of the last one, in seconds.
    pub(crate) readout_s: f64,
    /// Column of the readout time, `None` if it is fixed.
    pub(crate) readout_column: Option<usize>,
    /// Columns of the intrinsics; empty if they are fixed.
    pub(crate) intrinsics: Range<usize>,
}

impl CameraCalibration<'_> {
    /// The first joint angles, as many as the chain has joints; none for a rigid camera.
    fn own<'j>(&self, joints_rad: &'j [f64]) -> &'j [f64] {
        &joints_rad[..self.chain.joint_count().min(joints_rad.len())]
    }

    pub(crate) fn joint_count(&self) -> usize {
        self.chain.joint_count()
    }

    pub(crate) fn imu_from_camera(&self, joints_rad: &[f64]) -> RigidTransform {
        let imu_from_base = self.chain.imu_from_camera(self.own(joints_rad));
        match &self.mounted {
            Some((mounted, _)) => imu_from_base * mounted.imu_from_camera(&[]),
            None => imu_from_base,
        }
    }

    /// `imu_from_camera` with its derivatives by the columns and the joint angles.
    pub(crate) fn linearize(&self, joints_rad: &[f64]) -> ChainLinearization {
        let mut linearization = self.chain.linearize(self.own(joints_rad));
        if let Some((mounted, column)) = &self.mounted {
            return linearization.followed_by(&mounted.linearize(&[]), *column, self.columns);
        }
        if linearization.by_parameters.ncols() != self.columns {
            linearization.by_parameters = linearization.by_parameters.resize_horizontally(self.columns, 0.0);
        }
        linearization
    }

    /// Exposure of a row in a frame; `row` is 0 for the first one and 1 for the end of the last one.
    pub(crate) fn exposure(&self, state: &FrameState, row: f64) -> Exposure {
        let after_image_s = if self.rolling { self.shift_s + row * self.readout_s } else { self.shift_s };
        state.rates.exposure(self.camera, after_image_s)
    }

    /// Rows with a separate block of derivatives.
    pub(crate) fn block_rows(&self) -> &'static [f64] {
        if self.rolling { &ROLLING_ROWS } else { &[0.0] }
    }
}

impl Calibrations {
    /// Extrinsics, time offset and shutter of the cameras that observe the features of a camera, over its
    /// [`Self::pose_columns`]: its own, and the other one of its pair.
    pub(crate) fn sensor_models(&self, camera: usize) -> Vec<CameraCalibration<'_>> {
        self.observers(camera).map(|observer| self.sensor_model(observer)).collect()
    }

    /// Extrinsics, time offset and shutter of a camera, over its [`Self::pose_columns`].
    pub(crate) fn sensor_model(&self, camera: usize) -> CameraCalibration<'_> {
        let own = self.of(camera).sensor_model();
        let Some(base) = self.of(camera).base() else {
            // A pair begins at the columns of its first camera.
            return CameraCalibration { columns: self.pose_columns(camera).len(), ..own };
        };
        let (first, columns) = (self.columns(camera).start, self.pose_columns(camera));
        let own_column = first - columns.start;
        let placed = |column: usize| own_column + column;
        CameraCalibration {
            chain: Cow::Borrowed(self.of(base).chain()),
            mounted: Some((own.chain, own_column)),
            columns: columns.len(),
            shift_column: own.shift_column.map(placed),
            readout_column: own.readout_column.map(placed),
            intrinsics: placed(own.intrinsics.start)..placed(own.intrinsics.end),
            ..own
        }
    }
}

impl Calibration {
    /// Extrinsics, time offset and shutter of a camera that is not mounted on another one.
    pub(crate) fn sensor_model(&self) -> CameraCalibration<'_> {
        let free = self.dof() > 0;
        CameraCalibration {
            chain: Cow::Borrowed(self.chain()),
            mounted: None,
            camera: self.camera(),
            columns: self.dof(),
            shift_s: self.camera_shift_s(),
            shift_column: self.camera_shift_column(),
            rolling: self.has_rolling_shutter(),
            readout_s: self.readout_s(),
            readout_column: self.readout_column().filter(|_| free),
            intrinsics: if free { self.intrinsics_columns() } else { 0..0 },
        }
    }
}

/// `world_from_camera` at a state and the camera's time offset, for the first row: IMU pose and extrinsics at the
/// extrapolated joint angles.
pub(crate) fn at(state: &FrameState, calibration: &Calibration) -> CameraPose {
    at_row(state, &calibration.sensor_model(), 0.0)
}

/// `world_from_camera` at a state and the exposure of a row: 0 for the first row, 1 for the end of the last one.
pub(crate) fn at_row(state: &FrameState, sensor: &CameraCalibration<'_>, row: f64) -> CameraPose {
    let state = &*state_at(state, &sensor.exposure(state, row));
    let pose = state.navigation.world_from_imu * sensor.imu_from_camera(&state.joints_rad);
    CameraPose { rotation: pose.rotation_matrix(), position_m: pose.translation_m }
}

/// State at an exposure.
pub(crate) fn state_at<'a>(state: &'a FrameState, exposure: &Exposure) -> Cow<'a, FrameState> {
    if *exposure == Exposure::NONE { Cow::Borrowed(state) } else { Cow::Owned(state.at(exposure)) }
}

/// Derivatives of the blocks of a camera with respect to the unknowns: `[φ; δt]` of `world_from_camera` by frame (with
/// a rolling shutter, of the first, the middle and the last row), then the intrinsics if they are estimated.
#[derive(Clone, Debug)]
pub(crate) struct CameraMaps {
    /// 6 × columns of [`Layout::camera`], with respect to the unknowns of the block's frame; 6 × 0 for the intrinsics.
    pub(crate) own: Vec<DMatrix<f64>>,
    /// 6 × columns, with respect to the camera's calibration.
    pub(crate) calibration: Vec<DMatrix<f64>>,
    blocks_per_frame: usize,
    frames: usize,
}

impl CameraMaps {
    /// Derivatives at these states and the calibration of a camera.
    pub(crate) fn new(frames: &[FrameState], calibrations: &Calibrations, camera: usize) -> Self {
        Self::of_sensors(frames, &calibrations.sensor_models(camera))
    }

    /// [`Self::new`] for given sensors over the same columns, with as many rows each.
    ///
    /// With constant rates, the derivatives of the shifted pose by velocity and gyroscope bias are neglected: a bias
    /// change has no effect over a centisecond. Along a measured motion they are included.
    pub(crate) fn of_sensors(frames: &[FrameState], sensors: &[CameraCalibration<'_>]) -> Self {
        let blocks = || sensors.iter().flat_map(|sensor| sensor.block_rows().iter().map(move |row| (sensor, *row)));
        let mut maps =
            Self { own: Vec::new(), calibration: Vec::new(), blocks_per_frame: blocks().count(), frames: frames.len() };
        for stamped in frames {
            for (sensor, row) in blocks() {
                let (own, calibration) = block_map(stamped, sensor, row);
                maps.own.push(own);
                maps.calibration.push(calibration);
            }
        }
        // Features of a pair are not matched while intrinsics are estimated.
        if let Some(sensor) = sensors.first().filter(|sensor| !sensor.intrinsics.is_empty()) {
            let mut selection = DMatrix::zeros(6, sensor.columns);
            for (row, column) in sensor.intrinsics.clone().enumerate() {
                selection[(row, column)] = 1.0;
            }
            maps.own.push(DMatrix::zeros(6, 0));
            maps.calibration.push(selection);
        }
        maps
    }

    /// Adds the information of the blocks to the information of the unknowns (lower triangle).
    ///
    /// `calibration` is the column range of the camera's calibration; `information` returns the 6 × 6 block at a row
    /// and a column.
    pub(crate) fn add_information(
        &self,
        layout: &Layout,
        calibration: &Range<usize>,
        information: impl Fn(usize, usize) -> Matrix6<f64>,
        hessian: &mut DMatrix<f64>,
    ) {
        let mut by_calibration = vec![0.0; 6 * calibration.len()];
        let mut by_own = Vec::new();
        for row in 0..self.blocks() {
            let of_row = self.columns(layout, row);
            by_calibration.fill(0.0);
            for column in 0..self.blocks() {
                let block = information(row, column);
                add_product(&mut by_calibration, &block, self.calibration[column].as_slice());
                if column > row {
                    continue;
                }
                // Lower triangle: the frame of `row` is not before the frame of `column`. Two blocks of one frame
                // contribute to the block on the diagonal, with their transpose.
                let of_column = self.columns(layout, column);
                by_own.clear();
                by_own.resize(6 * of_column.len(), 0.0);
                add_product(&mut by_own, &block, self.own[column].as_slice());
                let own = self.own[row].as_slice();
                add_transposed_product(hessian, &of_row, &of_column, own, &by_own);
                if column < row && of_column == of_row {
                    add_transposed_product(hessian, &of_column, &of_row, &by_own, own);
                }
            }
            add_transposed_product(hessian, calibration, &of_row, &by_calibration, self.own[row].as_slice());
            let own = self.calibration[row].as_slice();
            add_transposed_product(hessian, calibration, calibration, own, &by_calibration);
        }
    }

    pub(crate) fn blocks(&self) -> usize {
        self.own.len()
    }

    /// Columns of the frame of a block (calibration excluded); empty for the intrinsics.
    pub(crate) fn columns(&self, layout: &Layout, block: usize) -> Range<usize> {
        let slot = block / self.blocks_per_frame;
        if slot < self.frames { layout.camera(slot) } else { 0..0 }
    }
}

/// Adds `block · right` (6 × n, column-major).
fn add_product(target: &mut [f64], block: &Matrix6<f64>, right: &[f64]) {
    for (target, right) in target.chunks_exact_mut(6).zip(right.chunks_exact(6)) {
        for (factor, column) in right.iter().zip(&block.data.0) {
            if *factor != 0.0 {
                for (entry, of_block) in target.iter_mut().zip(column) {
                    *entry += of_block * factor;
                }
            }
        }
    }
}

/// Adds `leftᵀ · right` (6 rows each, column-major) to a part of a matrix.
fn add_transposed_product(
    matrix: &mut DMatrix<f64>,
    rows: &Range<usize>,
    columns: &Range<usize>,
    left: &[f64],
    right: &[f64],
) {
    for (column, right) in columns.clone().zip(right.chunks_exact(6)) {
        for (row, left) in rows.clone().zip(left.chunks_exact(6)) {
            matrix[(row, column)] += left.iter().zip(right).map(|(a, b)| a * b).sum::<f64>();
        }
    }
}

/// Derivatives of the camera pose at a row with respect to the unknowns of its frame and to the calibration.
fn block_map(stamped: &FrameState, sensor: &CameraCalibration<'_>, row: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let exposure = sensor.exposure(stamped, row);
    let state = &*state_at(stamped, &exposure);
    let chain = sensor.linearize(&state.joints_rad);
    let world_from_imu = state.navigation.world_from_imu.rotation_matrix();
    let (mut own, mut by_calibration) = camera_map(&world_from_imu, state.joints_rad.len(), &chain);
    for (column, factor) in [(sensor.shift_column, 1.0), (sensor.readout_column, row)] {
        if let Some(column) = column.filter(|_| factor != 0.0) {
            by_calibration.set_column(column, &(&own * stamped.motion_at(&exposure) * factor));
        }
    }
    if exposure != Exposure::NONE {
        // The unknown is the attitude at the stamp.
        let at_stamp = stamped.navigation.world_from_imu.rotation_matrix();
        let by_attitude: Matrix6x3<f64> = own.fixed_view::<6, 3>(0, 0) * world_from_imu.tr_mul(&at_stamp);
        if stamped.has_moving_rows() {
            own = moving_map(stamped, &own, &by_attitude, &exposure);
        } else {
            own.fixed_columns_mut::<3>(0).copy_from(&by_attitude);
        }
    } else if stamped.has_moving_rows() {
        let width = own.ncols() + stamped.joint_motion.len() + ROW_MOTION;
        own = own.resize_horizontally(width, 0.0);
    }
    (own, by_calibration)
}

/// Converts derivatives by pose and joints at an exposure to derivatives by the unknowns of the frame (6 × columns):
/// `[φ, p, joints, joint rates and accelerations, v, b_g]`.
/// `by_rotation` has the derivatives by the attitude at the stamp at fixed position.
fn moving_map(
    stamped: &FrameState,
    own: &DMatrix<f64>,
    by_rotation: &Matrix6x3<f64>,
    exposure: &Exposure,
) -> DMatrix<f64> {
    let Exposure { after_stamp_s: time_s, after_joints_s } = *exposure;
    let (joints, motion) = (stamped.joints_rad.len(), stamped.joint_motion.len());
    let mut map = DMatrix::zeros(6, POSE + joints + motion + ROW_MOTION);
    map.columns_mut(0, POSE + joints).copy_from(own);
    let by_position: Matrix6x3<f64> = own.fixed_view::<6, 3>(0, 3).into_owned();
    let moved = stamped.row_motion(time_s).map_or_else(Vector3::zeros, |(motion, _)| motion.position_m);
    let at_stamp = stamped.navigation.world_from_imu.rotation_matrix();
    let by_attitude = by_rotation - by_position * at_stamp * so3::hat(&moved);
    map.fixed_columns_mut::<3>(0).copy_from(&by_attitude);
    // Joint rates, then joint accelerations.
    for (part, factor) in
        [after_joints_s, 0.5 * after_joints_s * after_joints_s].into_iter().enumerate().take(motion / joints.max(1))
    {
        let by_part = own.columns(POSE, joints) * factor;
        map.columns_mut(POSE + joints * (1 + part), joints).copy_from(&by_part);
    }
    let by_velocity = POSE + joints + motion;
    map.fixed_columns_mut::<3>(by_velocity).copy_from(&(by_position * time_s));
    map.fixed_columns_mut::<3>(by_velocity + 3).copy_from(&(own.fixed_columns::<3>(0) * -time_s));
    map
}

/// Derivatives of the camera pose with respect to pose and joints of its frame (6 × (6 + N)) and to its
/// calibration (6 × columns), at this attitude of the IMU (Eqs. 13, 14 in the right convention):
///
/// ```text
/// φ_C = R_ICᵀ φ + J_φ q    p_C = p − R_WI [t_IC]× φ + R_WI J_t q
/// ```
///
/// with `[J_φ; J_t]` of `T_IC` by joint angles and parameters q.
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
    // The columns of a rigid camera stay zero.
    own.columns_mut(POSE, chain.by_joints.ncols()).copy_from(&carried(&chain.by_joints));
    (own, carried(&chain.by_parameters))
}
