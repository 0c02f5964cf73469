//! Linearization of a solved window, for marginalization, the observability analysis and display.

use nalgebra::{DMatrix, DVector};

use super::information_gain::CameraInformation;
use super::problem::{CameraFactors, Problem};
use crate::estimator::factors::kind::{FactorKind, FactorLabel};
use crate::estimator::factors::labelled_rows::{LabelledPart, LabelledRows, stack};
use crate::estimator::factors::measurements::measurements;
use crate::estimator::factors::projected_rows::{NewestRows, ProjectedRows};
use crate::estimator::factors::reprojection::VisualFactors;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::state::columns::{ColumnBlock, FrameId};
use crate::estimator::state::estimate::Estimate;
use crate::gimbal::{Chain, ParameterId};

/// Whitened linearization of the step at its final estimate, without the priors on the calibration.
///
/// The rows are `J` of `½‖r + J (x ⊟ x₀)‖²`, Eq. 8 at x₀. The inverse depths are already eliminated by orthogonal
/// projection (each feature's rows are rotated and their first row is dropped), so that the rows stay whitened residuals
/// and no normal equations are formed.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearization {
    /// Column blocks in order: calibration, joints, poses, velocities and biases, the IMU on the gimbal.
    pub columns: Vec<ColumnBlock>,
    /// Calibration parameters fixed at their values; they have no columns.
    pub fixed_parameters: Vec<ParameterId>,
    /// Jacobian of the measurements, rows whitened.
    pub jacobian: DMatrix<f64>,
    /// Jacobian of the priors (rig prior on the calibration, marginalization prior), same columns, whitened.
    pub prior_jacobian: DMatrix<f64>,
    /// Number of leading rows of `prior_jacobian` that belong to the rig's prior.
    pub rig_prior_rows: usize,
    /// Norm of each calibration column before elimination of the depths, as reference of the rank rule.
    pub calibration_column_norms: DVector<f64>,
    /// Chain at which the calibration columns were evaluated (the first estimate, not the current one, where there is
    /// one).
    pub chain: Chain,
}

impl Problem<'_> {
    /// Linearizes the complete window at an estimate; `parameters` are the parameters of the calibration columns, free
    /// or fixed. The information of each camera's observations is appended to `seen`, if requested.
    pub(crate) fn linearization(
        &self,
        estimate: &Estimate,
        parameters: &[ParameterId],
        numbers: &[FrameId],
        mut seen: Option<&mut Vec<CameraInformation>>,
    ) -> Linearization {
        let layout = self.layout;
        let linearized = self.linearization_point(estimate);
        let mut measured = Vec::new();
        // Of the calibration columns of all cameras.
        let mut squared = vec![0.0; estimate.calibration.imu_columns().start];
        for camera in 0..self.cameras.len() {
            let maps = CameraMaps::new(&linearized.frames, &linearized.calibration, camera);
            let apart = if seen.is_some() { NewestRows::Apart } else { NewestRows::Among };
            let projected = self.projected_rows(camera, estimate, &linearized, apart);
            measured.push(self.carried_rows(camera, &projected, &maps));
            let of_camera = projected.squared_column_norms(&maps.calibration);
            for (column, added) in estimate.calibration.pose_columns(camera).zip(of_camera.iter()) {
                squared[column] += added.max(0.0);
            }
            if let Some(seen) = &mut seen {
                seen.push(CameraInformation::new(&projected, maps));
            }
        }
        let mut norms: Vec<f64> = squared.into_iter().map(f64::sqrt).collect();
        let point = self.point(estimate, &linearized);
        let mut measured_rows = LabelledRows::new(layout.total());
        measurements(&point, layout.frames, &mut measured_rows);
        let own = || measured_rows.parts.iter().filter(|part| part.label.kind() == FactorKind::GimbalImu);
        if own().next().is_some() {
            for (column, norm) in norms.iter_mut().enumerate().take(estimate.calibration.columns(MAIN).end) {
                let of_part =
                    |part: &LabelledPart| part.rows.column(layout.calibration().start + column).norm_squared();
                *norm = own().map(of_part).sum::<f64>().sqrt().hypot(*norm);
            }
        }
        let imu = || measured_rows.parts.iter().filter(|part| part.label.kind() == FactorKind::Imu);
        let squared = |column: usize| imu().map(|part| part.rows.column(column).norm_squared()).sum::<f64>();
        let imu_columns = estimate.calibration.imu_columns();
        norms.extend(imu_columns.map(|column| squared(layout.calibration().start + column).sqrt()));
        let mut priors = LabelledRows::new(layout.total());
        self.priors(&point, &mut priors);
        let of_rig = |part: &&LabelledPart| part.label == FactorLabel::CalibrationPrior;
        let rig_prior_rows = priors.parts.iter().filter(of_rig).map(|part| part.rows.nrows()).sum();
        let frozen = estimate.calibration.frozen_columns();
        let is_fixed = |column: usize| frozen.contains(&column);
        let first = layout.calibration().start;
        let order: Vec<usize> =
            layout.report_order().into_iter().filter(|column| *column < first || !is_fixed(column - first)).collect();
        let of = |fixed_parameters: bool| {
            let parameters =
                parameters.iter().enumerate().filter(move |(column, _)| is_fixed(*column) == fixed_parameters);
            parameters.map(|(_, parameter)| *parameter).collect::<Vec<_>>()
        };
        let free = |column: &usize| !is_fixed(*column);
        let norms: Vec<f64> = (0..norms.len()).filter(free).map(|column| norms[column]).collect();
        Linearization {
            columns: layout.blocks(&of(false), numbers),
            fixed_parameters: of(true),
            jacobian: stack(measured.iter().chain(measured_rows.matrices()), order.iter().copied()),
            prior_jacobian: stack(priors.matrices(), order.iter().copied()),
            rig_prior_rows,
            calibration_column_norms: DVector::from_vec(norms),
            chain: linearized.calibration.of(MAIN).chain().clone(),
        }
    }

    /// Rows of the reprojection factors after elimination of the landmarks; at most `6·frames` rows per camera.
    pub(crate) fn visual_rows(&self, estimate: &Estimate, linearized: &Estimate) -> DMatrix<f64> {
        let seeing = (0..self.cameras.len()).filter(|camera| !self.cameras[*camera].tracks.is_empty());
        let rows: Vec<DMatrix<f64>> = seeing
            .map(|camera| {
                let maps = CameraMaps::new(&linearized.frames, &linearized.calibration, camera);
                let projected = self.projected_rows(camera, estimate, linearized, NewestRows::Among);
                self.carried_rows(camera, &projected, &maps)
            })
            .collect();
        stack(&rows, 0..=self.layout.total())
    }

    /// Rows of the reprojection factors of one camera by its blocks, landmarks eliminated; derivatives at `linearized`.
    pub(crate) fn projected_rows(
        &self,
        camera: usize,
        estimate: &Estimate,
        linearized: &Estimate,
        apart: NewestRows,
    ) -> ProjectedRows {
        let CameraFactors { visual: model, tracks, .. } = &self.cameras[camera];
        let (current, linearized) = (&self.view(camera, estimate), &self.view(camera, linearized));
        let landmarks = &estimate.landmarks[camera];
        ProjectedRows::new(&VisualFactors { model, current, linearized, tracks, landmarks }, apart)
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
}
