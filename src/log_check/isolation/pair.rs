//! Two sources with their comparison.

use nalgebra::UnitQuaternion;

use super::comparison::Fit;
use super::culprits::Verdict;
use super::source::Source;
use crate::log_check::report::agreement::{PairAgreement, Quantity};

/// Two sources with their comparison.
#[derive(Clone)]
pub(super) struct Pair {
    pub(super) quantity: Quantity,
    pub(super) sources: [Source; 2],
    pub(super) first_from_second: UnitQuaternion<f64>,
    pub(super) fit: Fit,
}

impl Pair {
    pub(super) fn verdict(&self) -> Verdict {
        (self.sources.clone(), self.fit.disagrees.is_some())
    }

    pub(super) fn agreement(&self) -> PairAgreement {
        let fit = &self.fit;
        PairAgreement {
            quantity: self.quantity,
            sources: self.sources.each_ref().map(Source::name),
            agrees: fit.disagrees.is_none(),
            misfit: fit.misfit,
            by_axis: fit.by_axis.clone(),
            noise: fit.noise,
            bins: fit.bins.clone(),
            interval: fit.disagrees.unwrap_or_default(),
        }
    }
}
