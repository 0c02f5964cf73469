//! Bound on the cost of a trial part of the way: a correction that explains less than another by then is not computed on.

use crate::session::misfit::{Misfit, Scale, StepMisfit};
use crate::session::plan::ForkChanges;

/// Ratio of the steps of a span after which trials are compared with the run itself.
const COMPARED_AT: f64 = 0.6;
/// Largest ratio of a trial's cost to the cost of the run itself.
const WORSE_RATIO: f64 = 1.1;
/// Smallest ratio of the gain of the best trial that another one must reach.
pub(super) const LEAST_GAIN: f64 = 0.2;

/// Largest cost of the steps up to one of them.
#[derive(Clone, Debug)]
pub(super) struct CostBound {
    /// Number of steps after which the costs are compared.
    steps: usize,
    /// Stamp in nanoseconds from which on steps are scored.
    from_ns: i64,
    scale: Scale,
    largest: f64,
}

impl CostBound {
    /// Bound by the run itself over a span: a correction makes it worse. `None` for a run without a window until then.
    pub(super) fn of_run(given: &[StepMisfit]) -> Option<Self> {
        let bound = Self::at(given, (COMPARED_AT * given.len() as f64) as usize)?;
        let largest = WORSE_RATIO * bound.cost(given)?;
        Some(Self { largest, ..bound })
    }

    /// Bound by the best trial of the first part of a span: a correction reaches little of its gain. `None` if the best trial
    /// gains nothing.
    pub(super) fn of_best(given: &[StepMisfit], best: &[StepMisfit]) -> Option<Self> {
        let bound = Self::at(given, best.len())?;
        let largest = least_gain(bound.cost(given)?, bound.cost(best)?)?;
        Some(Self { largest, ..bound })
    }

    /// Lowers the bound by the best of some trials that have a window for as long as the run itself.
    pub(super) fn tighten<'a>(
        &mut self,
        given: &[StepMisfit],
        trials: impl Iterator<Item = (&'a ForkChanges, &'a [StepMisfit])>,
    ) {
        let tracked = |steps: &[StepMisfit]| steps[..self.steps].iter().filter(|step| step.tracking).count();
        let is_whole = |steps: &[StepMisfit]| steps.len() >= self.steps && tracked(steps) >= tracked(given);
        let compared = trials.filter(|(changes, steps)| acts_at_once(changes) && is_whole(steps));
        let best = compared.filter_map(|(_, steps)| self.cost(steps)).min_by(f64::total_cmp);
        if let (Some(before), Some(after)) = (self.cost(given), best) {
            self.largest = self.largest.min(least_gain(before, after).unwrap_or(f64::INFINITY));
        }
    }

    fn at(given: &[StepMisfit], steps: usize) -> Option<Self> {
        let part = given.get(..steps)?;
        let from_ns = part.iter().find(|step| step.tracking)?.stamp_ns;
        let misfit = Misfit::of(part, from_ns);
        let scale = Scale::of(&misfit, misfit.sigma_px()?, part.last()?.stamp_ns - from_ns);
        Some(Self { steps, from_ns, scale, largest: f64::INFINITY })
    }

    /// Cost of the first steps of a trial over those with a window: a later first window is no worse explanation. `None`
    /// without one.
    fn cost(&self, steps: &[StepMisfit]) -> Option<f64> {
        let misfit = Misfit::of(steps.get(..self.steps)?, self.from_ns);
        (misfit.tracked > 0).then(|| Misfit { steps: misfit.tracked, ..misfit }.cost(&self.scale))
    }

    /// True if a trial that has just computed the compared steps exceeds the bound. Only changes that act at once are compared.
    pub(super) fn is_exceeded(&self, changes: &ForkChanges, steps: &[StepMisfit]) -> bool {
        steps.len() == self.steps && self.is_above(changes, steps)
    }

    /// The same for a trial that begins with steps of the run itself beyond those that are compared.
    pub(super) fn was_exceeded(&self, changes: &ForkChanges, steps: &[StepMisfit]) -> bool {
        steps.len() >= self.steps && self.is_above(changes, steps)
    }

    fn is_above(&self, changes: &ForkChanges, steps: &[StepMisfit]) -> bool {
        acts_at_once(changes) && self.cost(steps).is_some_and(|cost| cost > self.largest)
    }
}

/// Largest cost with an appreciable part of the gain of the best trial; `None` if that gains nothing.
fn least_gain(before: f64, after: f64) -> Option<f64> {
    (after < before).then_some(before - LEAST_GAIN * (before - after))
}

/// True for corrections of the measurements; estimated parameters and wider priors take time to converge.
pub(super) fn acts_at_once(changes: &ForkChanges) -> bool {
    !changes.corrections.is_empty() && changes.estimated.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::{Fault, FaultKind};

    /// Steps of a trial with residuals of one length from its first window on.
    fn steps(length_px: f64, first_window: i64) -> Vec<StepMisfit> {
        let step = |number: i64| {
            let mut step = StepMisfit { stamp_ns: number * 50_000_000, window_s: 1.0, ..StepMisfit::default() };
            if number >= first_window {
                (step.tracking, step.frames) = (true, 11);
                (0..800).for_each(|_| step.pixels.add(length_px));
            }
            step
        };
        (0..100).map(step).collect()
    }

    fn exceeded(bound: &CostBound, steps: &[StepMisfit], changes: &ForkChanges) -> bool {
        (1..=steps.len()).any(|count| bound.is_exceeded(changes, &steps[..count]))
    }

    fn focal() -> ForkChanges {
        ForkChanges { corrections: vec![Fault::new(FaultKind::Focal, &[1.3])], ..ForkChanges::default() }
    }

    #[test]
    fn corrections_that_make_residuals_longer_are_not_computed_on() {
        let bound = CostBound::of_run(&steps(1.0, 20)).unwrap();
        let found = [0.3, 1.0, 4.0].map(|length_px| exceeded(&bound, &steps(length_px, 20), &focal()));
        assert_eq!(found, [false, false, true]);
        // A later first window with shorter residuals is no reason, and what is estimated has time to converge.
        assert!(!exceeded(&bound, &steps(0.3, 35), &focal()));
        assert!(!exceeded(&bound, &steps(4.0, 20), &ForkChanges { chain_prior: 5.0, ..ForkChanges::default() }));
        // A trial without any window is not compared.
        assert!(!exceeded(&bound, &steps(4.0, 100), &focal()));
    }

    #[test]
    fn corrections_with_little_of_the_best_gain_are_not_computed_on() {
        let (given, changes) = (steps(4.0, 20), [focal(), ForkChanges { chain_prior: 5.0, ..ForkChanges::default() }]);
        let mut bound = CostBound::of_run(&given).unwrap();
        let mut exceeded_by = |trial: &[StepMisfit], changes: &ForkChanges| {
            bound.tighten(&given, [(changes, trial)].into_iter());
            exceeded(&bound, &steps(3.8, 20), &focal())
        };
        // A trial that lost its window, and one that takes time to converge, are no bound.
        let found =
            [(25, 0), (20, 1), (20, 0)].map(|(window, change)| exceeded_by(&steps(0.1, window), &changes[change]));
        assert_eq!(found, [false, false, true]);
        let (given, best) = (steps(4.0, 20), steps(0.1, 20));
        let bound = CostBound::of_best(&given, &best[..60]).unwrap();
        let found = [0.1, 1.0, 3.8].map(|length_px| exceeded(&bound, &steps(length_px, 20), &focal()));
        assert_eq!(found, [false, false, true]);
        assert!(CostBound::of_best(&best, &given).is_none());
    }
}
