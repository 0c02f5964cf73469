//! The estimation of `run`, `view`, `screenshot` and `report`, with a progress bar.

use std::fmt::{self, Display, Formatter};

use anyhow::{Result, bail};
use dcvins::geometry::seconds_from_ns;
use dcvins::session::breakpoints::Condition;
use dcvins::session::{self, BreakpointHit, Computation, Recording, RunRecord, SessionPlan};

use crate::cli::terminal::Progress;

/// Runs the estimators of a plan to the end of the log, or to a stamp.
pub(crate) fn compute(plan: &SessionPlan) -> Result<Computation> {
    let begin_s = plan.start_s;
    let log_end_s = seconds_from_ns(plan.log.duration_ns());
    let end_s = plan.duration_s.map_or(log_end_s, |duration_s| log_end_s.min(begin_s + duration_s));
    let progress = Progress::new();
    let computation = session::compute(plan, &mut |recording| {
        let (pass, now_s) = progress_of(recording);
        progress.show((now_s - begin_s) / (end_s - begin_s).max(1e-3), || format!("{pass}{now_s:.1} of {end_s:.1} s"));
    })?;
    plan.log.require_unshortened()?;
    Ok(computation)
}

/// Log time by which a run is behind the log that it follows, at its steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Delay {
    steps: usize,
    sum_s: f64,
    largest_s: f64,
}

impl Delay {
    fn add(&mut self, delay_s: f64) {
        self.steps += 1;
        self.sum_s += delay_s;
        self.largest_s = self.largest_s.max(delay_s);
    }
}

impl Display for Delay {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mean_s = self.sum_s / self.steps.max(1) as f64;
        write!(f, "{mean_s:.2} s behind it on average, {:.2} s at most", self.largest_s)
    }
}

/// Runs the estimators of a plan on a log that is being written, to its end.
pub(crate) fn compute_following(plan: &SessionPlan, delay: &mut Delay) -> Result<Computation> {
    let progress = Progress::spinner("following the log");
    let mut reached_s = 0.0;
    let computation = session::compute(plan, &mut |recording| {
        let (_, now_s) = progress_of(recording);
        plan.log.look_for_growth();
        let log_s = seconds_from_ns(plan.log.duration_ns());
        if now_s > reached_s {
            reached_s = now_s;
            delay.add((log_s - now_s).max(0.0));
        }
        progress.show(0.0, || format!("{now_s:.1} of {log_s:.1} s so far"));
    })?;
    plan.log.require_unshortened()?;
    Ok(computation)
}

/// Runs the estimators of a plan until a condition becomes true; returns the hit, `None` if there is none.
pub(crate) fn compute_until(plan: &SessionPlan, condition: &Condition) -> Result<(Recording, Option<BreakpointHit>)> {
    let (names, parameters) = (plan.rig.parameter_names(), plan.parameters());
    let unknown = condition.unknown_names(&names, &parameters);
    if !unknown.is_empty() {
        let known: Vec<String> = parameters.iter().map(|parameter| names.name(*parameter)).collect();
        bail!("no run has '{}' of '{condition}'; there are {}", unknown.join("', '"), known.join(", "));
    }
    let end_s = seconds_from_ns(plan.log.duration_ns());
    let progress = Progress::new();
    let (computation, hit) = session::compute_until(plan, condition, &mut |recording| {
        let (pass, now_s) = progress_of(recording);
        progress.show(now_s / end_s.max(1e-3), || format!("{pass}{now_s:.1} s, looking for {condition}"));
    })?;
    plan.log.require_unshortened()?;
    Ok((computation.into_recording(), hit))
}

/// The pass and log time of the run that is furthest behind, the pass only for runs with several.
fn progress_of(recording: &Recording) -> (String, f64) {
    let open = recording.runs.iter().filter(|run| !run.finished);
    let behind = open.min_by(|one, other| {
        let fraction = |run: &RunRecord| run.computed_fraction(recording.duration_ns);
        fraction(one).total_cmp(&fraction(other))
    });
    let reached_ns = behind.map_or_else(|| recording.last_stamp_ns(), RunRecord::reached_ns);
    (behind.map_or_else(String::new, RunRecord::pass_text), seconds_from_ns(reached_ns))
}
