//! Prior on the calibration Φ of Eq. 7: `r = W (Φ ⊟ Φ₀)` with `WᵀW` the inverse of its covariance.

use super::factor::{Factor, JacobianBlock, Point, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::estimator::state::calibrations::Calibrations;

/// Prior of the rig, or of an earlier pass, on the static calibrations: one row per column.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CalibrationPriorFactor<'a> {
    calibration: &'a Calibrations,
    /// First column of the calibration.
    start: usize,
}

impl<'a> CalibrationPriorFactor<'a> {
    /// Factor of the window, `None` if the calibration is fixed.
    pub(crate) fn of(point: &Point<'a>) -> Option<Self> {
        let start = point.layout.calibration().start;
        (point.layout.calibration > 0).then_some(Self { calibration: &point.at.calibration, start })
    }
}

impl Factor for CalibrationPriorFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::CalibrationPrior
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let residual = self.calibration.prior_residual();
        let mut rows = WhitenedRows { residual: residual.as_slice(), blocks: &[], products: None };
        if !S::DERIVATIVES {
            return sink.add(self.label(), &rows);
        }
        let jacobian = self.calibration.prior_jacobian();
        let blocks = [JacobianBlock { start: self.start, entries: jacobian.as_slice() }];
        rows.blocks = &blocks;
        sink.add(self.label(), &rows);
    }
}
