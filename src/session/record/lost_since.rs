//! Time since which a direction of the calibration has been unobservable.

use std::fmt;
use std::sync::Arc;

use super::StepRecord;
use crate::geometry::seconds_from_ns;
use crate::observability::steps_lost;

/// Time since which the least observable direction of a step has been null or uninformed without interruption.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LostSince {
    /// Stamp of the first such step, in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// True for a structural null direction, false for an uninformed direction.
    pub structural: bool,
}

impl LostSince {
    /// Time since which the least observable direction of `step` has been lost; `earlier` are the run's steps before
    /// it.
    ///
    /// Returns `None` for a step without a rank, and for a full informed rank.
    pub fn of(earlier: &[Arc<StepRecord>], step: &StepRecord) -> Option<Self> {
        let rank = step.rank.as_ref()?;
        let direction = rank.least_observable_direction()?;
        let ranks = earlier.iter().rev().map(|step| step.rank.as_ref());
        let lost = steps_lost(&rank.parameters, &direction.weights, ranks);
        let first = earlier.get(earlier.len() - lost).map_or(step, |first| first);
        Some(Self { stamp_ns: first.report.stamp_ns, structural: direction.structural })
    }
}

impl LostSince {
    /// Kind for texts: `unobservable` or `uninformed`.
    pub fn kind(self) -> &'static str {
        if self.structural { "unobservable" } else { "uninformed" }
    }
}

impl fmt::Display for LostSince {
    /// For example `uninformed since 5.55 s`.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} since {:.2} s", self.kind(), seconds_from_ns(self.stamp_ns))
    }
}
