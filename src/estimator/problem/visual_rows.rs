//! Reprojection factors as whitened rows `[columns of the layout | residual]`, for marginalization and reports.

use nalgebra::DMatrix;

use super::problem::{CameraFactors, Problem};
use crate::estimator::factors::labelled_rows::stack;
use crate::estimator::factors::projected_rows::{NewestRows, ProjectedRows};
use crate::estimator::factors::reprojection::VisualFactors;
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::state::estimate::Estimate;

impl Problem<'_> {
    /// Rows of the reprojection factors after elimination of the landmarks; at most `6·frames` rows per camera.
    pub(crate) fn visual_rows(&self, estimate: &Estimate, linearized: &Estimate) -> DMatrix<f64> {
        let seeing = (0..self.cameras.len()).filter(|camera| !self.cameras[*camera].tracks.is_empty());
        let rows: Vec<DMatrix<f64>> = seeing
            .map(|camera| {
                let maps = CameraMaps::new(&linearized.frames, linearized.calibration.of(camera));
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
