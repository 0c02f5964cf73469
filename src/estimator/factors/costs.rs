//! Costs by kind of factor.

use nalgebra::DVectorView;

use super::factor::{Sink, WhitenedRows};
use super::kind::{FactorKind, FactorLabel};
use crate::text::Named as _;

/// Twice the cost and number of scalar residuals by kind of factor: the cost is robust for reprojections, χ² for the
/// other factors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Costs {
    squared: [f64; FactorKind::NAMES.len()],
    counts: [usize; FactorKind::NAMES.len()],
}

impl Costs {
    /// Adds twice the cost and the number of scalar residuals of some factors.
    pub(crate) fn add_to(&mut self, kind: FactorKind, squared: f64, count: usize) {
        self.squared[kind as usize] += squared;
        self.counts[kind as usize] += count;
    }

    /// Twice the cost of a kind of factor.
    pub(crate) fn of(&self, kind: FactorKind) -> f64 {
        self.squared[kind as usize]
    }

    /// Number of scalar residuals of a kind of factor.
    pub(crate) fn count(&self, kind: FactorKind) -> usize {
        self.counts[kind as usize]
    }

    /// Objective of the solver: half the sum.
    pub(crate) fn total(&self) -> f64 {
        0.5 * self.squared.iter().sum::<f64>()
    }
}

impl Sink for Costs {
    const DERIVATIVES: bool = false;

    fn add(&mut self, label: FactorLabel, rows: &WhitenedRows<'_>) {
        let residual = DVectorView::from_slice(rows.residual, rows.residual.len());
        self.add_to(label.kind(), residual.norm_squared(), rows.residual.len());
    }
}
