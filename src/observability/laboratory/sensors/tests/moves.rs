//! States changed by one number per column.

use nalgebra::{DMatrix, DVector};

use super::super::rows::SensorRows;
use super::super::window::{SensorState, SensorWindow};
use crate::estimator::factors::labelled_rows::stack;
use crate::estimator::state::layout::Layout;

impl SensorState {
    /// State changed by one number per column.
    pub(super) fn plus(&self, layout: &Layout, delta: &[f64]) -> Self {
        let frames = self.frames.iter().enumerate();
        Self {
            frames: frames.map(|(slot, frame)| frame.plus(&delta[layout.frame(slot)])).collect(),
            calibration: self.calibration.stepped(&delta[layout.calibration()]),
            landmarks: self.landmarks.clone(),
        }
    }
}

impl SensorRows {
    pub(super) fn residual(&self) -> DVector<f64> {
        self.rows.column(self.rows.ncols() - 1).into_owned()
    }

    pub(super) fn jacobian(&self) -> DMatrix<f64> {
        self.rows.columns(0, self.rows.ncols() - 1).into_owned()
    }
}

impl SensorWindow<'_> {
    /// Jacobian with the residuals in the last column, the landmarks projected out; `None` under the condition of
    /// [`SensorWindow::rows`].
    pub(super) fn reduced(&self, state: &SensorState) -> Option<DMatrix<f64>> {
        let parts: Vec<DMatrix<f64>> = self.rows(state)?.iter().map(SensorRows::without_landmark).collect();
        Some(stack(&parts, 0..=self.layout.total()))
    }
}
