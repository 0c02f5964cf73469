//! Planned motions: search from several starts, and the predicted σ over time.

use std::fmt;
use std::ops::ControlFlow;

use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use super::super::Situation;
use super::admitted::RepeatedMove;
use super::by_hand::{HandPlan, choose};
use super::limits::{MotionLimits, ReachedLimit};
use super::objective::{Objective, PlanCriterion};
use super::search::{FINE_WEIGHT, SearchProblem, SearchProgress, SearchedMotion};
use super::starts;
use super::summary::{PlanTable, SigmaRow};
use super::windows::{WindowLayout, joined, rows_of_interval, trajectory};
use crate::geometry::SplitMix64;
use crate::gimbal::ParameterId;
use crate::simulation::MotionSplines;
use crate::table::text::{TextTable, left, right};

/// Options of a plan beside the situation.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanOptions {
    pub duration_s: f64,
    pub criterion: PlanCriterion,
    /// Parameters of the criterion; all if none is given.
    pub parameters: Vec<ParameterId>,
    pub limits: MotionLimits,
    /// Number of starts of the search: the best moves in turn, the best listed motion repeated, then random motions.
    pub starts: usize,
    /// Trials from each start with coarse windows, and again with fine ones from the best two.
    pub trials: usize,
    pub seed: u64,
}

/// Shortest and longest plan, in seconds.
pub const PLAN_DURATION_S: [f64; 2] = [8.0, 120.0];
/// Duration of a planned motion if none is given, in seconds.
pub const PLAN_SECONDS: f64 = 20.0;
/// Starts that are searched further with fine windows.
const FINALISTS: usize = 2;
/// Time between the rows of the predicted σ, in seconds.
const ROW_S: f64 = 1.0;

/// Reason why there is no plan.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MotionPlanError {
    #[error("a plan of {given} s: expected {} to {} s", PLAN_DURATION_S[0], PLAN_DURATION_S[1])]
    Duration { given: f64 },
    #[error("no motion makes any of these parameters observable; name others, or use encoders")]
    NothingObservable,
    #[error("the Jacobian of the mechanism is not finite: its lengths or angles are too large")]
    NotFinite,
    /// The motion of the search exceeds a limit.
    #[error("no motion keeps the limit of {quantity}; allow a larger one or a longer flight")]
    LimitTooTight { quantity: String },
    #[error("interrupted; nothing is written")]
    Interrupted,
}

/// Result of the search from one start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanStart {
    pub origin: String,
    /// Criterion of the start and after the search, with fine windows.
    pub before: f64,
    pub after: f64,
}

/// Best of the listed motions, repeated over the same time.
#[derive(Clone, Debug, Serialize)]
pub struct ListedComparison {
    pub words: String,
    pub value: f64,
    pub worst: String,
    pub worst_ratio: f64,
    pub mean_ratio: f64,
    #[serde(skip)]
    pub motion: MotionSplines,
}

/// A planned motion with its predicted σ.
#[derive(Clone, Debug, Serialize)]
pub struct MotionPlan {
    pub duration_s: f64,
    /// Criterion at the end; 1 before the motion.
    pub value: f64,
    #[serde(flatten)]
    pub table: PlanTable,
    pub listed: Option<ListedComparison>,
    pub starts: Vec<PlanStart>,
    pub limits: Vec<ReachedLimit>,
    #[serde(skip)]
    pub motion: MotionSplines,
    /// σ at each second.
    #[serde(skip)]
    pub sigmas: Vec<SigmaRow>,
}

/// Plans moves with words, chosen one after the other.
///
/// # Errors
/// If the duration is out of range, or nothing is observable.
pub fn plan_by_hand(situation: &Situation, options: &PlanOptions) -> Result<HandPlan, MotionPlanError> {
    let (objective, layout) = problem(situation, options)?;
    let problem = SearchProblem { situation, objective: &objective, limits: &options.limits, layout };
    let moves = choose(&problem, options.duration_s, &|_| false);
    HandPlan::of_moves(&problem, options.duration_s, &moves).ok_or(MotionPlanError::NotFinite)
}

/// Searches the motion with the smallest criterion within the limits.
///
/// The result depends on the options only, not on the number of threads. `watch` receives the progress from 0 to 1, on any
/// thread, and may stop the search.
///
/// # Errors
/// As [`plan_by_hand`], if a limit cannot be kept, or if `watch` stopped it.
pub fn plan_motion(
    situation: &Situation,
    options: &PlanOptions,
    watch: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
) -> Result<MotionPlan, MotionPlanError> {
    let (objective, layout) = problem(situation, options)?;
    let coarse = SearchProblem {
        situation,
        objective: &objective,
        limits: &options.limits,
        layout: WindowLayout::coarse(options.duration_s),
    };
    let fine = SearchProblem { layout, ..coarse };
    let repeated = RepeatedMove::all(&fine, options.duration_s);
    let begun = begin(&coarse, options, &repeated);
    let finalists = FINALISTS.min(begun.len());
    let progress = SearchProgress::new(options.trials * (begun.len() + FINE_WEIGHT * finalists));
    let step = |weight: usize| progress.step(weight, watch);
    let random = |part: u64, index: usize| random_of(options.seed, 100 * part + index as u64);
    let search = |(index, (origin, start)): (usize, (String, MotionSplines))| {
        let before = fine.evaluate(start.clone())?;
        let found = coarse.improve(coarse.evaluate(start)?, options.trials, &mut random(1, index), &|_| step(1));
        let found = fine.evaluate(found.motion)?;
        let value = |searched: &SearchedMotion| objective.value(&fine.total(&searched.windows));
        let start = PlanStart { origin, before: value(&before)?, after: value(&found)? };
        Some((start, found))
    };
    let mut searched: Vec<(PlanStart, SearchedMotion)> = begun.into_par_iter().enumerate().filter_map(search).collect();
    // A stable sort: equal results keep the order of their starts.
    searched.sort_by(|a, b| a.0.after.total_cmp(&b.0.after));
    let refine = |(index, (start, found)): (usize, (PlanStart, SearchedMotion))| {
        if index >= finalists {
            return Some((start, found));
        }
        let found = fine.improve(found, options.trials, &mut random(2, index), &|_| step(FINE_WEIGHT));
        let after = objective.value(&fine.total(&found.windows))?;
        Some((PlanStart { after, ..start }, found))
    };
    let mut refined: Vec<(PlanStart, SearchedMotion)> =
        searched.into_par_iter().enumerate().filter_map(refine).collect();
    refined.sort_by(|a, b| a.0.after.total_cmp(&b.0.after));
    if progress.is_stopped() {
        return Err(MotionPlanError::Interrupted);
    }
    let starts = refined.iter().map(|(start, _)| start.clone()).collect();
    let best = refined.into_iter().next().ok_or(MotionPlanError::NotFinite)?.1;
    finished(&fine, best, starts, &repeated).ok_or(MotionPlanError::NotFinite)?
}

/// Random numbers of one part of a search.
fn random_of(seed: u64, part: u64) -> SplitMix64 {
    SplitMix64::new(seed.wrapping_mul(1000).wrapping_add(part))
}

/// Criterion over these parameters, or over all if none is given, and windows of motions of this duration.
pub(super) fn objective_and_windows(
    situation: &Situation,
    duration_s: f64,
    criterion: PlanCriterion,
    parameters: &[ParameterId],
) -> Result<(Objective, WindowLayout), MotionPlanError> {
    let [shortest_s, longest_s] = PLAN_DURATION_S;
    if !(shortest_s..=longest_s).contains(&duration_s) {
        return Err(MotionPlanError::Duration { given: duration_s });
    }
    let objective = Objective::new(situation, criterion, parameters).ok_or(MotionPlanError::NothingObservable)?;
    Ok((objective, WindowLayout::fine(duration_s)))
}

/// Criterion and windows of a plan.
fn problem(situation: &Situation, options: &PlanOptions) -> Result<(Objective, WindowLayout), MotionPlanError> {
    objective_and_windows(situation, options.duration_s, options.criterion, &options.parameters)
}

/// Motions from which the search starts, each with its origin.
fn begin(coarse: &SearchProblem<'_>, options: &PlanOptions, repeated: &[RepeatedMove]) -> Vec<(String, MotionSplines)> {
    let situation = coarse.situation;
    let best = best_of(coarse.objective, repeated);
    let motion = |index: usize| match (index, best) {
        (0, _) => {
            let moves = choose(coarse, options.duration_s, &|_| false);
            let motion = starts::of_moves(coarse, options.duration_s, &moves);
            ("best moves in turn".to_owned(), motion)
        }
        (1, Some(best)) => {
            let motion = starts::of_moves(coarse, options.duration_s, &[best.choice]);
            ("best listed motion, repeated".to_owned(), motion)
        }
        _ => {
            let mut random = random_of(options.seed, index as u64);
            let motion = starts::random(situation, &options.limits, options.duration_s, &mut random);
            (format!("random motion {}", index - 1), motion)
        }
    };
    (0..options.starts.max(1)).map(motion).map(|(origin, motion)| (origin, coarse.within_limits(motion))).collect()
}

/// Listed motion with the smallest criterion.
fn best_of<'a>(objective: &Objective, repeated: &'a [RepeatedMove]) -> Option<&'a RepeatedMove> {
    let value = |repeated: &RepeatedMove| objective.value(&repeated.information).unwrap_or(f64::INFINITY);
    repeated.iter().min_by(|a, b| value(a).total_cmp(&value(b)))
}

/// The plan of the best motion; `None` when a number is not finite.
fn finished(
    fine: &SearchProblem<'_>,
    best: SearchedMotion,
    starts: Vec<PlanStart>,
    repeated: &[RepeatedMove],
) -> Option<Result<MotionPlan, MotionPlanError>> {
    let (situation, objective) = (fine.situation, fine.objective);
    let names = situation.joint_names();
    let limits = fine.limits.compare(&best.motion, &names);
    if let Some(exceeded) = limits.iter().find(|limit| !limit.is_kept()) {
        return Some(Err(MotionPlanError::LimitTooTight { quantity: exceeded.quantity.clone() }));
    }
    let total = fine.total(&best.windows);
    let listed = best_of(objective, repeated).and_then(|best| {
        let table = PlanTable::new(situation, objective, &best.information)?;
        Some(ListedComparison {
            words: best.choice.words(situation),
            value: objective.value(&best.information)?,
            worst: table.worst,
            worst_ratio: table.worst_ratio,
            mean_ratio: table.mean_ratio,
            motion: best.motion.clone(),
        })
    });
    Some(Ok(MotionPlan {
        duration_s: best.motion.duration_s(),
        value: objective.value(&total)?,
        table: PlanTable::new(situation, objective, &total)?,
        listed,
        starts,
        limits,
        sigmas: sigmas_over_time(fine, &best)?,
        motion: best.motion,
    }))
}

/// Predicted σ at the start, at each second and at the end.
fn sigmas_over_time(fine: &SearchProblem<'_>, best: &SearchedMotion) -> Option<Vec<SigmaRow>> {
    let (situation, layout) = (fine.situation, fine.layout);
    let flight = trajectory(situation, &best.motion);
    let rows = (best.motion.duration_s() / ROW_S).floor() as usize;
    let mut times_s: Vec<f64> = (0..=rows).map(|row| row as f64 * ROW_S).collect();
    if best.motion.duration_s() - rows as f64 * ROW_S > 1e-9 {
        times_s.push(best.motion.duration_s());
    }
    let row = |time_s: &f64| {
        let window = ((time_s / layout.length_s + 1e-9) as usize).min(layout.count);
        let mut begun = None;
        if window < layout.count {
            let [from_s, _] = layout.interval_s(window);
            if *time_s > from_s + 1e-9 {
                begun = Some(rows_of_interval(situation, &best.motion, &flight, &layout, [from_s, *time_s])?);
            }
        }
        let gained = joined(best.windows[..window].iter().chain(&begun), situation.information.ncols());
        Some(SigmaRow::new(*time_s, &PlanTable::new(situation, fine.objective, &gained)?))
    };
    times_s.par_iter().map(row).collect()
}

impl fmt::Display for MotionPlan {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.table)?;
        if let Some(listed) = &self.listed {
            writeln!(
                out,
                "best listed motion for the same {:.0} s: {}\n  largest σ/prior {:.3} ({}), mean {:.3}",
                self.duration_s, listed.words, listed.worst_ratio, listed.worst, listed.mean_ratio
            )?;
        }
        let starts = self.starts.iter().map(|start| {
            [format!("  {}", start.origin), format!("{:.3}", start.before), format!("{:.3}", start.after)]
        });
        let columns = [left("criterion by start", 34), right("before", 6), right("after", 8)];
        write!(out, "{}", TextTable::new(columns, starts).not_indented())?;
        let limits = self.limits.iter().map(|limit| {
            let [reached, allowed] = [limit.reached, limit.limit].map(|value| format!("{value:.3}"));
            [format!("  {}", limit.quantity), reached, allowed, format!(" {}", limit.unit)]
        });
        let columns = [left("limits", 30), right("reached", 12), right("limit", 10), left("", 0)];
        write!(out, "{}", TextTable::new(columns, limits).not_indented())
    }
}
