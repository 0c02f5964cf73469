//! Whitened residuals of a window with sensor columns, and their Jacobian.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};

use super::propagation::{Change, IMU_COLUMNS, ReadoutChanges};
use super::state::SensorState;
use super::values::{ACCELEROMETER, GYROSCOPE, INTRINSICS};
use super::window::{Prediction, SensorObservation, SensorWindow};
use crate::estimator::imu_factor::{self, MotionJacobians};
use crate::estimator::{ColumnBlock, ColumnId, FrameId, JointKnowledge, Linearization, MotionIncrement, PoseKnowledge};
use crate::geometry::dense;
use crate::gimbal::ParameterId;
use crate::observability::laboratory::PIXEL_SIGMA_PX;
use crate::sensors::ImuNoise;

/// A pivot below this ratio of a landmark's columns marks an unobservable coordinate of the landmark.
const DEPENDENT: f64 = 1e-11;

/// Rows of one landmark or of one other factor.
#[derive(Debug)]
pub(super) struct SensorRows {
    pub(super) residual: DVector<f64>,
    /// By the columns of the window.
    pub(super) jacobian: DMatrix<f64>,
    /// By the landmark's position (3 columns), or none.
    pub(super) by_landmark: DMatrix<f64>,
}

impl SensorRows {
    fn zeros(rows: usize, columns: usize, landmark: usize) -> Self {
        Self {
            residual: DVector::zeros(rows),
            jacobian: DMatrix::zeros(rows, columns),
            by_landmark: DMatrix::zeros(rows, landmark),
        }
    }

    /// Projects the landmark out by an orthogonal transformation: residuals (first column) and Jacobian.
    fn without_landmark(&self) -> DMatrix<f64> {
        let (rows, columns) = self.jacobian.shape();
        let mut both = DMatrix::zeros(rows, columns + 1);
        both.column_mut(0).copy_from(&self.residual);
        both.columns_mut(1, columns).copy_from(&self.jacobian);
        if self.by_landmark.ncols() == 0 {
            return both;
        }
        let norm = self.by_landmark.norm();
        let spanning = dense::to_faer(&(&self.by_landmark / norm));
        let mut rest = dense::to_faer(&both);
        let rank = dense::split_by_column_space(spanning.as_ref(), rest.as_mut(), DEPENDENT);
        let rest = dense::from_faer(rest.as_ref());
        rest.rows(rank, rows - rank).into_owned()
    }
}

impl SensorWindow<'_> {
    /// Rows of every factor at a state; `None` when a landmark is behind a camera that observed it.
    pub(super) fn rows(&self, state: &SensorState) -> Option<Vec<SensorRows>> {
        let mut rows = Vec::new();
        let changes = self.readout_changes(state);
        for (position, observations) in state.landmarks.iter().zip(&self.observations) {
            rows.push(self.landmark_rows(state, &changes, position, observations)?);
        }
        if let JointKnowledge::Encoder(sigma_rad) = self.setup.joints {
            rows.extend((0..state.frames.len()).map(|frame| self.encoder_rows(state, frame, sigma_rad)));
        }
        if let PoseKnowledge::Imu { noise, biases_known } = self.setup.poses {
            for frame in 1..state.frames.len() {
                rows.push(self.imu_rows(state, frame));
                if !biases_known {
                    rows.push(self.bias_rows(state, frame, &noise));
                }
            }
        }
        Some(rows)
    }

    fn landmark_rows(
        &self,
        state: &SensorState,
        changes: &[ReadoutChanges],
        position: &Vector3<f64>,
        observations: &[SensorObservation],
    ) -> Option<SensorRows> {
        let mut rows = SensorRows::zeros(2 * observations.len(), self.columns.count(), 3);
        for (index, observation) in observations.iter().enumerate() {
            let prediction = self.predict(state, changes, position, observation.frame, observation.row_ratio)?;
            let residual = (prediction.uv_px - observation.uv_px) / PIXEL_SIGMA_PX;
            rows.residual.rows_mut(2 * index, 2).copy_from(&residual);
            rows.by_landmark.rows_mut(2 * index, 2).copy_from(&(prediction.by_landmark / PIXEL_SIGMA_PX));
            let mut jacobian = rows.jacobian.rows_mut(2 * index, 2);
            self.write_prediction(&prediction, observation, &mut jacobian);
            jacobian /= PIXEL_SIGMA_PX;
        }
        Some(rows)
    }

    fn write_prediction(
        &self,
        prediction: &Prediction,
        observation: &SensorObservation,
        jacobian: &mut nalgebra::DMatrixViewMut<'_, f64>,
    ) {
        let columns = &self.columns;
        let frame = observation.frame;
        jacobian.columns_mut(0, columns.chain).copy_from(&prediction.by_chain);
        for (column, (place, _)) in columns.sensors.iter().enumerate() {
            let derivative = match *place {
                0 => prediction.by_time,
                1 => prediction.by_time * observation.row_ratio,
                2 => prediction.by_encoder_time,
                place if place < GYROSCOPE => prediction.by_intrinsics.column(place - INTRINSICS).into_owned(),
                place => prediction.by_imu.column(imu_column(place)).into_owned(),
            };
            jacobian.column_mut(columns.chain + column).copy_from(&derivative);
        }
        let joints = self.truth.chain.joint_count();
        if columns.joints > 0 {
            jacobian.columns_mut(columns.joints_at(frame), joints).copy_from(&prediction.by_joints);
        }
        if columns.joints > joints {
            jacobian.columns_mut(columns.joints_at(frame) + joints, joints).copy_from(&prediction.by_joint_rates);
        }
        if columns.pose > 0 {
            jacobian.columns_mut(columns.pose_at(frame), 6).copy_from(&prediction.by_pose);
            let at = columns.velocity_bias_at(frame);
            jacobian.columns_mut(at, 3).copy_from(&prediction.by_velocity);
            for bias in 3..columns.velocity_bias {
                jacobian.column_mut(at + bias).copy_from(&prediction.by_imu.column(bias_column(bias)));
            }
        }
    }

    /// Rows of one encoder reading per joint at the time of the frame.
    fn encoder_rows(&self, state: &SensorState, frame: usize, sigma_rad: f64) -> SensorRows {
        let columns = &self.columns;
        let joints = self.truth.chain.joint_count();
        let mut rows = SensorRows::zeros(joints, columns.count(), 0);
        let (angles, rates) = self.flight.joint_motion(self.times_s[frame] - state.sensors.encoder_timeshift_s);
        let shift = columns.sensors.iter().position(|(_, parameter)| *parameter == ParameterId::ENCODER_TIMESHIFT);
        for joint in 0..joints {
            rows.residual[joint] = (state.frames[frame].joints_rad[joint] - angles[joint]) / sigma_rad;
            rows.jacobian[(joint, columns.joints_at(frame) + joint)] = sigma_rad.recip();
            if let Some(shift) = shift {
                rows.jacobian[(joint, columns.chain + shift)] = rates[joint] / sigma_rad;
            }
        }
        rows
    }

    /// Weights of the preintegrated motion to each frame but the first, at the true state.
    pub(super) fn imu_weights(&self) -> Vec<SMatrix<f64, 9, 9>> {
        let PoseKnowledge::Imu { noise, .. } = self.setup.poses else { return Vec::new() };
        let measured = |time_s: f64| self.measured(time_s);
        let biases = crate::estimator::ImuBias::default();
        let interval = |times: &[f64]| (times[0], times[1] - times[0]);
        self.times_s
            .windows(2)
            .map(|times| Change::integrate(&measured, interval(times), &self.truth.sensors, &biases, Some(&noise)))
            .map(|change| whitening(&change.covariance.unwrap_or_default()))
            .collect()
    }

    /// Rows of the preintegrated motion from the previous frame.
    fn imu_rows(&self, state: &SensorState, frame: usize) -> SensorRows {
        let columns = &self.columns;
        let (start_s, end_s) = (self.times_s[frame - 1], self.times_s[frame]);
        let duration_s = end_s - start_s;
        let [before, after] = [frame - 1, frame].map(|frame| &state.frames[frame].navigation);
        let measured = |time_s: f64| self.measured(time_s);
        let change = Change::integrate(&measured, (start_s, duration_s), &state.sensors, &before.bias, None);
        let gravity = self.flight.gravity_in_world;
        let motion = change.increment();
        let residual = imu_factor::motion_residual(&motion, duration_s, before, after, &gravity);
        let jacobians = MotionJacobians::new(&motion, duration_s, before, after, &gravity);
        let by_imu = jacobians.by_parameters(&change.by_imu());

        let whitening = self.weights[frame - 1];
        let mut rows = SensorRows::zeros(9, columns.count(), 0);
        rows.residual.copy_from(&(whitening * residual));
        let by_imu = whitening * by_imu;
        let (by_before, by_after) = (whitening * jacobians.by_from, whitening * jacobians.by_to);
        for (frame, derivative) in [(frame - 1, by_before), (frame, by_after)] {
            rows.jacobian.columns_mut(columns.pose_at(frame), 6).copy_from(&derivative.fixed_columns::<6>(0));
            let at = columns.velocity_bias_at(frame);
            rows.jacobian.columns_mut(at, 3).copy_from(&derivative.fixed_columns::<3>(6));
        }
        for bias in 3..columns.velocity_bias {
            let at = columns.velocity_bias_at(frame - 1) + bias;
            rows.jacobian.column_mut(at).copy_from(&by_imu.column(bias_column(bias)));
        }
        for (column, (place, _)) in columns.sensors.iter().enumerate().filter(|(_, (place, _))| *place >= GYROSCOPE) {
            rows.jacobian.column_mut(columns.chain + column).copy_from(&by_imu.column(imu_column(*place)));
        }
        rows
    }

    /// Rows of the random walk of the biases.
    fn bias_rows(&self, state: &SensorState, frame: usize, noise: &ImuNoise) -> SensorRows {
        let columns = &self.columns;
        let root_s = (self.times_s[frame] - self.times_s[frame - 1]).sqrt();
        let [before, after] = [frame - 1, frame].map(|frame| state.frames[frame].navigation.bias);
        let mut rows = SensorRows::zeros(6, columns.count(), 0);
        let gyroscope = after.gyroscope_rad_per_s - before.gyroscope_rad_per_s;
        let accelerometer = after.accelerometer_m_per_s2 - before.accelerometer_m_per_s2;
        let walks = [(gyroscope, noise.gyroscope_random_walk), (accelerometer, noise.accelerometer_random_walk)];
        for (part, (change, density)) in walks.into_iter().enumerate() {
            let weight = (density * root_s).recip();
            for axis in 0..3 {
                let row = 3 * part + axis;
                rows.residual[row] = change[axis] * weight;
                rows.jacobian[(row, columns.velocity_bias_at(frame - 1) + 3 + row)] = -weight;
                rows.jacobian[(row, columns.velocity_bias_at(frame) + 3 + row)] = weight;
            }
        }
        rows
    }

    /// Linearization at a state with all its columns, as input of [`crate::observability::analyse`].
    pub(super) fn linearization(&self, state: &SensorState) -> Option<Linearization> {
        let rows = self.rows(state)?;
        let count = self.columns.calibration();
        let norms = DVector::from_fn(count, |column, _| {
            rows.iter().map(|rows| rows.jacobian.column(column).norm_squared()).sum::<f64>().sqrt()
        });
        let parameters: Vec<ParameterId> =
            state.chain.parameters().into_iter().chain(self.columns.sensors.iter().map(|it| it.1)).collect();
        let both = stacked(&rows);
        let mut prior_jacobian = DMatrix::zeros(count, self.columns.count());
        for (column, parameter) in parameters.iter().enumerate() {
            prior_jacobian[(column, column)] = parameter.scale().recip();
        }
        Some(Linearization {
            columns: self.blocks(&parameters),
            fixed_parameters: Vec::new(),
            jacobian: both.columns_range(1..).into_owned(),
            prior_jacobian,
            rig_prior_rows: count,
            calibration_column_norms: norms,
            chain: state.chain.clone(),
        })
    }

    fn blocks(&self, parameters: &[ParameterId]) -> Vec<ColumnBlock> {
        let columns = &self.columns;
        let mut blocks: Vec<ColumnBlock> = parameters
            .iter()
            .enumerate()
            .map(|(start, parameter)| ColumnBlock { id: ColumnId::Calibration(*parameter), start, len: 1 })
            .collect();
        let frames = || (0..columns.frames).map(FrameId);
        blocks.extend(frames().map(|frame| ColumnBlock {
            id: ColumnId::Joints(frame),
            start: columns.joints_at(frame.0),
            len: columns.joints,
        }));
        blocks.extend(frames().map(|frame| ColumnBlock {
            id: ColumnId::Pose(frame),
            start: columns.pose_at(frame.0),
            len: columns.pose,
        }));
        blocks.extend(frames().map(|frame| ColumnBlock {
            id: ColumnId::VelocityBias(frame),
            start: columns.velocity_bias_at(frame.0),
            len: columns.velocity_bias,
        }));
        blocks.retain(|block| block.len > 0);
        blocks
    }
}

/// Residuals and Jacobians of all factors stacked, the landmarks projected out.
pub(super) fn stacked(rows: &[SensorRows]) -> DMatrix<f64> {
    let parts: Vec<DMatrix<f64>> = rows.iter().map(SensorRows::without_landmark).collect();
    let count = parts.iter().map(DMatrix::nrows).sum();
    let mut whole = DMatrix::zeros(count, parts.first().map_or(1, DMatrix::ncols));
    let mut start = 0;
    for part in parts {
        whole.rows_mut(start, part.nrows()).copy_from(&part);
        start += part.nrows();
    }
    whole
}

/// Column of the preintegration for a bias column of a frame; the first three columns of the frame are the velocity.
fn bias_column(column: usize) -> usize {
    if column < 6 { column - 3 } else { column - 6 + 3 + super::values::GYROSCOPE_COLUMNS }
}

/// Column of the preintegration for a sensor column of the IMU.
fn imu_column(place: usize) -> usize {
    if place < ACCELEROMETER { place - GYROSCOPE + 3 } else { place - GYROSCOPE + 6 }
}

/// The inverse of the lower Cholesky factor of a covariance.
fn whitening(covariance: &SMatrix<f64, 9, 9>) -> SMatrix<f64, 9, 9> {
    let factor = covariance.cholesky().map(|factor| factor.l());
    factor.and_then(|factor| factor.try_inverse()).unwrap_or_else(SMatrix::identity)
}

impl Change {
    pub(super) fn rotation(&self) -> nalgebra::UnitQuaternion<f64> {
        let matrix: Matrix3<f64> = self.rotation;
        nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(matrix))
    }

    fn increment(&self) -> MotionIncrement {
        MotionIncrement { rotation: self.rotation(), position_m: self.position, velocity_m_per_s: self.velocity }
    }

    /// Derivative of [`Self::increment`] `[φ, p, v]` by biases and intrinsics of the IMU.
    fn by_imu(&self) -> SMatrix<f64, 9, IMU_COLUMNS> {
        let mut by_imu = SMatrix::<f64, 9, IMU_COLUMNS>::zeros();
        by_imu.fixed_rows_mut::<3>(0).copy_from(&self.rotation_by);
        by_imu.fixed_rows_mut::<3>(3).copy_from(&self.position_by);
        by_imu.fixed_rows_mut::<3>(6).copy_from(&self.velocity_by);
        by_imu
    }
}
