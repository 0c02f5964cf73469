//! Problem of a planned motion for the selected run: its parameters, and what its flight has measured so far.

use std::sync::Arc;

use super::settings::PlanSettings;
use crate::geometry::seconds_from_ns;
use crate::gui::PanelContext;
use crate::gui::units::fixed;
use crate::observability::laboratory::{MotionProblem, Situation};
use crate::session::{RunRecord, RunSpec, situation_before_flight};

/// Inputs of the problem without the flight.
#[derive(Clone, Debug, PartialEq)]
struct ProblemKey {
    run: Option<u64>,
    duration_s: f64,
    distances_m: Vec<f64>,
}

/// The problem of a run, computed again when its inputs change.
#[derive(Clone, Debug, Default)]
pub(super) struct PlannedRun {
    key: Option<ProblemKey>,
    /// Problem from the prior alone, or the reason why there is none.
    alone: Option<Result<MotionProblem, String>>,
    problem: Option<Arc<MotionProblem>>,
    /// Run and number of steps that the flight had when it was read.
    flown: Option<(u64, usize)>,
    flight: FlightSoFar,
}

/// State of a run at its end, or so far.
#[derive(Clone, Debug, Default)]
pub(super) struct FlightSoFar {
    state: Option<Arc<Situation>>,
    /// Time of that state in seconds since the log began.
    at_s: f64,
    is_whole: bool,
    /// True if it has the parameters of the plan.
    pub(super) is_used: bool,
}

impl PlannedRun {
    /// Computes what has changed, and returns the problem or the reason why there is none.
    pub(super) fn update(
        &mut self,
        ctx: &PanelContext<'_>,
        settings: &PlanSettings,
    ) -> Result<Arc<MotionProblem>, String> {
        let run = ctx.selected_run();
        let flown = run.map(|run| (run.id, run.steps.len()));
        let is_flown_further = self.flown != flown;
        if is_flown_further {
            self.flown = flown;
            self.flight = run.and_then(|run| FlightSoFar::of_run(ctx, run)).unwrap_or_default();
        }
        if let Some(run) = run {
            self.flight.is_whole = run.finished;
        }
        let landmarks = self.flight.state.as_ref().map(|state| &state.distances_m).filter(|_| settings.scene_of_log);
        let landmarks = landmarks.filter(|distances_m| !distances_m.is_empty()).cloned();
        let distances_m = landmarks.unwrap_or_else(|| settings.distances_m());
        let key = ProblemKey { run: run.map(|run| run.id), duration_s: settings.duration_s, distances_m };
        let is_other = self.key.as_ref() != Some(&key);
        if is_other {
            let spec = run.map_or_else(RunSpec::default, |run| chain_alone(&run.spec));
            let situation = situation_before_flight(&ctx.recording.rig, &spec, key.distances_m.clone());
            let problem = situation.map_err(|error| error.to_string()).and_then(|situation| {
                MotionProblem::new(situation, settings.duration_s).map_err(|error| error.to_string())
            });
            (self.key, self.alone) = (Some(key), Some(problem));
        }
        if is_other || is_flown_further {
            let alone = self.alone.as_ref().and_then(|alone| alone.as_ref().ok());
            let after = alone.and_then(|alone| alone.after_flight(self.flight.state.as_deref()?));
            self.flight.is_used = after.is_some();
            self.problem = after.or_else(|| alone.cloned()).map(Arc::new);
        }
        match &self.alone {
            Some(Err(problem)) => Err(problem.clone()),
            _ => self.problem.clone().ok_or_else(|| "no run".to_owned()),
        }
    }

    /// The flight of the run, if there is a state with the parameters of the plan.
    pub(super) fn flight(&self) -> Option<&FlightSoFar> {
        Some(&self.flight).filter(|flight| flight.is_used)
    }
}

impl FlightSoFar {
    /// Meaning of its σ.
    pub(super) fn meaning(&self) -> String {
        let so_far = if self.is_whole { "its end" } else { "its last computed image" };
        format!("Posterior σ of the selected run at {so_far}, {} s", fixed(self.at_s, 2))
    }

    /// Last state of a run with a posterior.
    fn of_run(ctx: &PanelContext<'_>, run: &RunRecord) -> Option<Self> {
        let rig = &ctx.recording.rig;
        let last = run.steps.iter().rev().find_map(|step| {
            let situation = Situation::of_step(&step.report, step.rank.as_ref()?, rig, &run.camera_key)?;
            Some((situation, step.report.stamp_ns))
        });
        let (state, stamp_ns) = last?;
        Some(Self { state: Some(Arc::new(state)), at_s: seconds_from_ns(stamp_ns), is_whole: false, is_used: false })
    }
}

/// The run without sensor columns, which a plan does not cover.
fn chain_alone(spec: &RunSpec) -> RunSpec {
    RunSpec { timeshift: false, readout: false, intrinsics: false, imu_intrinsics: false, ..spec.clone() }
}
