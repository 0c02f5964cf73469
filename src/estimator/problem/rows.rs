//! Factors as whitened rows `[columns of the layout | residual]`, for marginalization and reports.

use nalgebra::DMatrix;

use super::problem::Problem;
use crate::estimator::factors::projected_rows::{NewestRows, ProjectedRows};
use crate::estimator::factors::zero_velocity::ZeroVelocityTerm;
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::state::camera_view::CameraView;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::{POSE, VELOCITY_BIAS};

impl Problem<'_> {
    /// Rows of the reprojection factors after elimination of the landmarks; at most `6·frames` rows per camera.
    pub(crate) fn visual_rows(&self, estimate: &Estimate) -> DMatrix<f64> {
        let frames = self.linearization_frames(estimate);
        let calibration = self.linearization_calibration(&estimate.calibration);
        let seeing = (0..self.cameras.len()).filter(|camera| !self.cameras[*camera].tracks.is_empty());
        let rows: Vec<DMatrix<f64>> = seeing
            .map(|camera| {
                let maps = CameraMaps::new(&frames, calibration.of(camera));
                let linearized = self.view(camera, &frames, &calibration);
                let projected = self.projected_rows(camera, estimate, &linearized, NewestRows::Among);
                self.carried_rows(camera, &projected, &maps)
            })
            .collect();
        stack(&rows, self.layout.total() + 1)
    }

    /// Rows of the reprojection factors of one camera by its blocks, landmarks eliminated; derivatives at `linearized`.
    pub(crate) fn projected_rows(
        &self,
        camera: usize,
        estimate: &Estimate,
        linearized: &CameraView<'_>,
        apart: NewestRows,
    ) -> ProjectedRows {
        let factors = &self.cameras[camera];
        let current = self.view(camera, &estimate.frames, &estimate.calibration);
        let landmarks = &estimate.landmarks[camera];
        ProjectedRows::new(&factors.visual, &current, linearized, factors.tracks, landmarks, apart)
    }

    /// Converts rows by the blocks of a camera to rows by the unknowns.
    pub(crate) fn carried_rows(&self, camera: usize, projected: &ProjectedRows, maps: &CameraMaps) -> DMatrix<f64> {
        let by_camera = &projected.rows;
        let total = self.layout.total();
        let height = by_camera.nrows();
        let calibration = &self.cameras[camera].columns;
        let mut rows = DMatrix::zeros(height, total + 1);
        for block in 0..maps.blocks() {
            let columns = by_camera.view((0, 6 * block), (height, 6));
            rows.columns_range_mut(maps.columns(&self.layout, block)).gemm(1.0, &columns, &maps.own[block], 1.0);
            rows.columns_range_mut(calibration.clone()).gemm(1.0, &columns, &maps.calibration[block], 1.0);
        }
        rows.set_column(total, &by_camera.view((0, 6 * maps.blocks()), (height, 1)).column(0));
        rows
    }

    /// Rows of the IMU factor that ends at `slot`: 15 rows, or none without IMU samples.
    pub(crate) fn imu_rows(&self, slot: usize, estimate: &Estimate) -> DMatrix<f64> {
        self.imu_rows_at(slot, estimate, &self.linearization_frames(estimate))
    }

    /// [`Self::imu_rows`] with derivatives at `linearized`.
    pub(crate) fn imu_rows_at(&self, slot: usize, estimate: &Estimate, linearized: &[FrameState]) -> DMatrix<f64> {
        let total = self.layout.total();
        let Some(blocks) = self.imu_blocks(slot, estimate, linearized) else {
            return DMatrix::zeros(0, total + 1);
        };
        let mut rows = DMatrix::zeros(15, total + 1);
        for (slot, part) in [(slot - 1, &blocks.by_from), (slot, &blocks.by_to)] {
            rows.columns_range_mut(self.layout.pose(slot)).copy_from(&part.fixed_columns::<POSE>(0));
            rows.columns_range_mut(self.layout.velocity_bias(slot))
                .copy_from(&part.fixed_columns::<VELOCITY_BIAS>(POSE));
        }
        if let Some(by_intrinsics) = &blocks.by_intrinsics {
            rows.columns_range_mut(self.imu_columns(&estimate.calibration)).copy_from(by_intrinsics);
        }
        rows.set_column(total, &blocks.residual);
        rows
    }

    /// One row per encoder reading of a frame, and one per joint rate and joint acceleration if these are unknowns.
    pub(crate) fn encoder_rows(&self, slot: usize, estimate: &Estimate) -> DMatrix<f64> {
        let readings: Vec<_> = self.encoder_residuals(slot, estimate).collect();
        let clock = self.encoder_clock_column(estimate);
        let motion: Vec<_> = self.joint_motion_residuals(slot, estimate).collect();
        let angles = readings.len();
        let mut rows = DMatrix::zeros(angles + motion.len(), self.layout.total() + 1);
        for (row, (joint, residual, slope)) in readings.into_iter().enumerate() {
            rows[(row, self.layout.joints(slot).start + joint)] = slope;
            if let Some(clock) = clock {
                rows[(row, clock)] = slope * estimate.frames[slot].joint_rate_rad_per_s(joint);
            }
            rows[(row, self.layout.total())] = residual;
        }
        for (row, (place, residual, slope)) in (angles..).zip(motion) {
            rows[(row, self.layout.joint_motion(slot).start + place)] = slope;
            rows[(row, self.layout.total())] = residual;
        }
        rows
    }

    /// One row per term of the zero-velocity updates.
    pub(crate) fn zero_velocity_rows(&self, terms: &[ZeroVelocityTerm]) -> DMatrix<f64> {
        let mut rows = DMatrix::zeros(terms.len(), self.layout.total() + 1);
        for (row, term) in terms.iter().enumerate() {
            rows[(row, term.column)] = term.slope;
            if let Some(against) = term.against {
                rows[(row, against)] = -term.slope;
            }
            rows[(row, self.layout.total())] = term.residual;
        }
        rows
    }

    /// Rows of the marginalization prior and of the start prior on the first frame.
    pub(crate) fn prior_rows(&self, estimate: &Estimate) -> DMatrix<f64> {
        let total = self.layout.total();
        let window_prior = self.prior.map_or_else(
            || DMatrix::zeros(0, total + 1),
            |prior| prior.rows(&self.layout, &self.first_estimate_offset(estimate)),
        );
        let (Some(start), Some(first)) = (self.start, estimate.frames.first()) else { return window_prior };
        let (jacobian, residual) = start.rows(first);
        let mut rows = DMatrix::zeros(jacobian.nrows(), total + 1);
        rows.columns_range_mut(self.layout.frame(0)).copy_from(&jacobian);
        rows.set_column(total, &residual);
        stack(&[window_prior, rows], total + 1)
    }

    /// Rows of the rig's prior on the calibration.
    pub(crate) fn calibration_prior_rows(&self, estimate: &Estimate) -> DMatrix<f64> {
        let total = self.layout.total();
        if self.layout.calibration == 0 {
            return DMatrix::zeros(0, total + 1);
        }
        let jacobian = estimate.calibration.prior_jacobian();
        let mut rows = DMatrix::zeros(jacobian.nrows(), total + 1);
        rows.columns_range_mut(self.layout.calibration()).copy_from(&jacobian);
        rows.set_column(total, &estimate.calibration.prior_residual());
        rows
    }
}

/// Stacks matrices with the same number of columns.
pub(crate) fn stack(parts: &[DMatrix<f64>], columns: usize) -> DMatrix<f64> {
    stack_columns(parts, 0..columns)
}

/// Stacks the given columns of matrices.
pub(crate) fn stack_columns(parts: &[DMatrix<f64>], columns: impl ExactSizeIterator<Item = usize>) -> DMatrix<f64> {
    let height = parts.iter().map(DMatrix::nrows).sum();
    let mut stacked = DMatrix::zeros(height, columns.len());
    for (target, source) in columns.enumerate() {
        let mut start = 0;
        for part in parts {
            stacked.view_mut((start, target), (part.nrows(), 1)).copy_from(&part.column(source));
            start += part.nrows();
        }
    }
    stacked
}
