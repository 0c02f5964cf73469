//! The states of the solver in one step.

use std::sync::Arc;

use super::step::StepRecord;

/// The solver iteration at which a step is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolverPosition {
    /// After this number of iterations; 0 is before the first.
    AfterFirst(usize),
    /// This number of iterations before the last; 0 is the converged step.
    BeforeLast(usize),
}

impl SolverPosition {
    /// Number of completed iterations, in a step with `iterations` iterations.
    pub fn of(self, iterations: usize) -> usize {
        match self {
            Self::AfterFirst(count) => count.min(iterations),
            Self::BeforeLast(count) => iterations.saturating_sub(count),
        }
    }

    /// One iteration forward or back, `None` beyond the first or last of `iterations`.
    pub fn moved(self, forward: bool, iterations: usize) -> Option<Self> {
        let at = self.of(iterations);
        let next = if forward { at.checked_add(1) } else { at.checked_sub(1) };
        next.filter(|next| *next <= iterations).map(Self::AfterFirst)
    }
}

#[derive(Clone, Debug)]
pub struct SolverTrace {
    pub step: usize,
    /// States before the first iteration and after each iteration.
    pub records: Vec<Arc<StepRecord>>,
    /// Index of the shown state.
    pub at: usize,
}

impl SolverTrace {
    pub fn shown(&self) -> Option<&Arc<StepRecord>> {
        self.records.get(self.at)
    }

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
        // For a run with fewer iterations in the step, the position stays at its last one.
        assert_eq!(SolverPosition::AfterFirst(5).of(3), 3);
    }
}
