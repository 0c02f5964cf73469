//! Prediction of σ for given motions, alone and after a flight, and the search that starts from one of them.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::super::Situation;
use super::by_hand::choose;
use super::limits::MotionLimits;
use super::objective::{Objective, PlanCriterion};
use super::plan::{MotionPlanError, objective_and_windows};
use super::search::{FINE_WEIGHT, SearchProblem, SearchProgress};
use super::starts;
use super::summary::PlanTable;
use super::windows::{WindowLayout, WindowRows, joined, rows_of_window, trajectory};
use crate::geometry::SplitMix64;
use crate::simulation::MotionSplines;
use crate::text::Named;

/// Ratio of coarse trials to fine ones of a search.
const COARSE_PER_FINE: usize = 3;
/// Seed of the random numbers of starts and searches.
const SEED: u64 = 1;

/// Motion from which a plan is edited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MotionStart {
    /// Motion without any movement.
    AtRest,
    /// Slow waves in every channel.
    #[default]
    Waves,
    /// The moves of `plan_by_hand`, one after the other.
    Moves,
}

impl Named for MotionStart {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::AtRest, "at rest"), (Self::Waves, "waves"), (Self::Moves, "best moves in turn")];
}

/// Criterion and windows of the motions of one duration: the largest ratio of σ to the prior's.
#[derive(Clone, Debug)]
pub struct MotionProblem {
    situation: Arc<Situation>,
    layout: WindowLayout,
    from_prior: Objective,
    /// Criterion from the posterior of a flight on.
    after_flight: Option<Objective>,
}

/// σ of all parameters at the end of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionPrediction {
    /// At the end of the flight; `None` without one.
    pub flight: Option<PlanTable>,
    /// After the motion alone.
    pub motion: PlanTable,
    /// After the flight and the motion.
    pub both: Option<PlanTable>,
}

impl MotionPrediction {
    /// σ after everything that is known: the flight, if there is one, and the motion.
    pub fn result(&self) -> &PlanTable {
        self.both.as_ref().unwrap_or(&self.motion)
    }
}

impl MotionProblem {
    /// Problem of motions of this duration.
    ///
    /// # Errors
    /// If the duration is out of range, or nothing is observable.
    pub fn new(situation: Situation, duration_s: f64) -> Result<Self, MotionPlanError> {
        let (from_prior, layout) = objective_and_windows(&situation, duration_s, PlanCriterion::Worst, &[])?;
        Ok(Self { from_prior, situation: Arc::new(situation), layout, after_flight: None })
    }

    /// The same problem after a flight whose state at its end this is; `None` if the flight estimates other parameters.
    #[must_use]
    pub fn after_flight(&self, flight: &Situation) -> Option<Self> {
        let (own, other) = (&self.situation.chain, &flight.chain);
        let same = own.parameterization() == other.parameterization() && own.parameters() == other.parameters();
        let objective = || self.from_prior.after_flight(&flight.information);
        same.then(|| Self { after_flight: Some(objective()), ..self.clone() })
    }

    pub fn situation(&self) -> &Situation {
        &self.situation
    }

    /// Motion within the limits from which to start.
    pub fn start(&self, start: MotionStart, limits: &MotionLimits, duration_s: f64) -> MotionSplines {
        let situation = &*self.situation;
        let motion = match start {
            MotionStart::AtRest => starts::at_rest(situation, duration_s, starts::PLAN_KNOT_S),
            MotionStart::Waves => starts::random(situation, limits, duration_s, &mut SplitMix64::new(SEED)),
            MotionStart::Moves => {
                let coarse = SearchProblem { layout: WindowLayout::coarse(duration_s), ..self.search(limits) };
                starts::of_moves(&coarse, duration_s, &choose(&coarse, duration_s, &|_| false))
            }
        };
        self.search(limits).within_limits(motion)
    }

    /// Searches a motion with a smaller criterion from a given one, which is first made smaller until it is within the
    /// limits: `trials` changes with coarse windows, then a third as many with fine ones.
    ///
    /// `watch` receives the progress from 0 to 1 and the best motion so far; if it stops the search, the result is that
    /// motion. `None` when a number is not finite.
    pub fn improve(
        &self,
        motion: &MotionSplines,
        limits: &MotionLimits,
        trials: usize,
        watch: &(dyn Fn(f64, &MotionSplines) -> ControlFlow<()> + Sync),
    ) -> Option<MotionSplines> {
        let fine = self.search(limits);
        let coarse = SearchProblem { layout: WindowLayout::coarse(motion.duration_s()), ..fine };
        let fine_trials = trials.div_ceil(COARSE_PER_FINE);
        let progress = SearchProgress::new(trials + FINE_WEIGHT * fine_trials);
        let step = |weight: usize, best: &MotionSplines| progress.step(weight, |ratio| watch(ratio, best));
        let mut random = SplitMix64::new(SEED);
        let begin = fine.evaluate(fine.within_limits(motion.clone()))?;
        let start = coarse.evaluate(begin.motion.clone())?;
        let found = coarse.improve(start, trials, &mut random, &|best| step(1, best));
        let found = fine.evaluate(found.motion)?;
        // Coarse windows may prefer another motion than fine ones.
        let found = if found.value < begin.value { found } else { begin };
        if progress.is_stopped() {
            return Some(found.motion);
        }
        Some(fine.improve(found, fine_trials, &mut random, &|best| step(FINE_WEIGHT, best)).motion)
    }

    fn objective(&self) -> &Objective {
        self.after_flight.as_ref().unwrap_or(&self.from_prior)
    }

    fn search<'a>(&'a self, limits: &'a MotionLimits) -> SearchProblem<'a> {
        SearchProblem { situation: &self.situation, objective: self.objective(), limits, layout: self.layout }
    }

    /// σ with the rows of the windows of a motion.
    fn prediction(&self, windows: &[WindowRows]) -> Option<MotionPrediction> {
        let columns = self.situation.information.ncols();
        let (gained, nothing) = (joined(windows, columns), DMatrix::zeros(columns, columns));
        let table = |objective: &Objective, gained: &DMatrix<f64>| PlanTable::new(&self.situation, objective, gained);
        let after = |gained: &DMatrix<f64>| self.after_flight.as_ref().map(|objective| table(objective, gained));
        Some(MotionPrediction {
            flight: after(&nothing).map_or(Some(None), |table| table.map(Some))?,
            motion: table(&self.from_prior, &gained)?,
            both: after(&gained).map_or(Some(None), |table| table.map(Some))?,
        })
    }
}

/// Predicts motions one after the other; windows in which a motion equals the last one are not linearized again.
#[derive(Clone, Debug, Default)]
pub struct MotionPredictor {
    last: Option<PredictedWindows>,
}

/// Windows of the last motion, and what they depend on.
#[derive(Clone, Debug)]
struct PredictedWindows {
    situation: Arc<Situation>,
    motion: MotionSplines,
    windows: Vec<WindowRows>,
}

impl MotionPredictor {
    /// Predicts σ after a motion; `None` when a number is not finite.
    pub fn predict(&mut self, problem: &MotionProblem, motion: &MotionSplines) -> Option<MotionPrediction> {
        let known = self.last.take().filter(|last| Arc::ptr_eq(&last.situation, &problem.situation));
        let (situation, layout) = (&*problem.situation, &problem.layout);
        let changed = known.as_ref().map_or_else(|| vec![true; layout.count], |known| known.changed(motion, layout));
        let flight = trajectory(situation, motion);
        let of = |window: usize| match &known {
            Some(known) if !changed[window] => Some(known.windows[window].clone()),
            _ => rows_of_window(situation, motion, &flight, layout, window),
        };
        let windows: Vec<WindowRows> = (0..layout.count).into_par_iter().map(of).collect::<Option<_>>()?;
        let prediction = problem.prediction(&windows);
        self.last =
            Some(PredictedWindows { situation: Arc::clone(&problem.situation), motion: motion.clone(), windows });
        prediction
    }
}

impl PredictedWindows {
    /// True for each window in which another motion differs from this one.
    fn changed(&self, motion: &MotionSplines, layout: &WindowLayout) -> Vec<bool> {
        let same_knots = self.motion.point_count() == motion.point_count()
            && self.motion.channel_count() == motion.channel_count()
            && self.motion.duration_s() == motion.duration_s();
        if !same_knots || self.windows.len() != layout.count {
            return vec![true; layout.count];
        }
        let mut changed = vec![false; layout.count];
        let differs = |index: usize| {
            (0..motion.channel_count()).any(|it| self.motion.point(it, index) != motion.point(it, index))
        };
        for index in (0..motion.point_count()).filter(|index| differs(*index)) {
            changed[layout.within(motion.reach_of_point_s(index))].fill(true);
        }
        changed
    }
}
