//! The solver's states in one step.

use std::sync::Arc;

use super::step::StepRecord;

/// The solver's iteration at which a step is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolverPosition {
    /// After so many iterations; 0 is before the first.
    AfterFirst(usize),
    /// So many iterations before the last; 0 is the step itself.
    BeforeLast(usize),
}

impl SolverPosition {
    /// The number of iterations done, in a step of so many.
    pub fn of(self, iterations: usize) -> usize {
        match self {
            Self::AfterFirst(count) => count.min(iterations),
            Self::BeforeLast(count) => iterations.saturating_sub(count),
        }
    }

    /// One iteration further (or back) in a step of so many, `None` beyond its ends.
    pub fn moved(self, forward: bool, iterations: usize) -> Option<Self> {
        let at = self.of(iterations);
        let next = if forward { at.checked_add(1) } else { at.checked_sub(1) };
        next.filter(|next| *next <= iterations).map(Self::AfterFirst)
    }
}

/// The solver's states in one step of a run, as records.
#[derive(Clone, Debug)]
pub struct SolverTrace {
    /// Number of the step.
    pub step: usize,
    /// Before the first iteration, after the first, and so on to the last.
    pub records: Vec<Arc<StepRecord>>,
    /// Which of them is shown.
    pub at: usize,
}

impl SolverTrace {
    /// The state that is shown.
    pub fn shown(&self) -> Option<&Arc<StepRecord>> {
        self.records.get(self.at)
    }

    /// Number of iterations of the step.
    pub fn iterations(&self) -> usize {
        self.records.len().saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_go_through_a_step_and_end_at_its_ends() {
        let last = SolverPosition::BeforeLast(0);
        assert_eq!(last.of(5), 5);
        assert_eq!(last.moved(true, 5), None);
        let mut positions = vec![];
        let mut at = Some(last);
        while let Some(position) = at {
            positions.push(position.of(5));
            at = position.moved(false, 5);
        }
        assert_eq!(positions, [5, 4, 3, 2, 1, 0]);
        assert_eq!(SolverPosition::AfterFirst(0).moved(true, 5), Some(SolverPosition::AfterFirst(1)));
        // Of two runs over one step the one with fewer iterations stays at its end.
        assert_eq!(SolverPosition::AfterFirst(5).of(3), 3);
    }
}
