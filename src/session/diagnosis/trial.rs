//! One trial: a run computed again with one change, on the inputs of its steps.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::budget::TrialBudget;
use super::cost_bound::CostBound;
use super::thinning::Thinning;
use crate::estimator::StepReport;
use crate::faults::FaultKind;
use crate::geometry::ns_from_seconds;
use crate::gimbal::{ClassicalChain, ParameterId};
use crate::sensors::Rig;
use crate::session::engine::{OwnedStepInput, RunEngine, apply_fork, guarded};
use crate::session::misfit::StepMisfit;
use crate::session::plan::{ForkChanges, RunSpec};
use crate::session::record::RunRecord;

/// Delay in seconds after the run's own first window, by which a trial must have one, and time without one after which a trial
/// is not computed any more.
pub(super) const LATER_S: f64 = 1.5;

/// The run to be diagnosed.
pub(super) struct DiagnosedRun<'a> {
    pub(super) rig: &'a Rig,
    pub(super) spec: &'a RunSpec,
    /// Key of the main camera.
    pub(super) camera_key: &'a str,
    /// Inputs of all steps.
    pub(super) inputs: Vec<Arc<OwnedStepInput>>,
    /// Features that trials use.
    pub(super) thinning: Thinning,
    pub(super) budget: TrialBudget,
    /// Ends all trials once it is set.
    pub(super) interrupted: &'a AtomicBool,
}

/// Part of a run that trials compute again.
#[derive(Clone, Debug)]
pub(super) struct TrialSpan {
    /// Engine in its state before the first step.
    pub(super) engine: RunEngine,
    pub(super) steps: Range<usize>,
    /// Step by which a trial must have a window, `None` if none must.
    pub(super) window_by: Option<usize>,
    /// True if the engine starts with the run, without a window.
    pub(super) is_start: bool,
}

/// Result of a trial.
#[derive(Clone, Debug, Default)]
pub(super) struct TrialResult {
    pub(super) steps: Vec<StepMisfit>,
    /// Last values of the calibration with their standard deviations.
    pub(super) calibration: BTreeMap<ParameterId, (f64, f64)>,
    pub(super) chain: Option<ClassicalChain>,
    /// Estimated joint angles by step.
    pub(super) joints_rad: Vec<(usize, Vec<f64>)>,
}

/// A trial that has computed the steps of its span before `next`.
#[derive(Clone, Debug)]
struct TrialState {
    engine: RunEngine,
    next: usize,
    /// Stamp in nanoseconds of the last step with a window.
    tracked_ns: Option<i64>,
    result: TrialResult,
}

/// The run itself in a span: its states before the steps at which changes begin, which the trials of these changes share.
pub(super) struct SpanStates<'a> {
    run: &'a DiagnosedRun<'a>,
    span: &'a TrialSpan,
    states: BTreeMap<usize, TrialState>,
}

impl<'a> DiagnosedRun<'a> {
    /// A run whose trials may use an amount of processor time in seconds.
    pub(super) fn new(
        rig: &'a Rig,
        (spec, camera_key): (&'a RunSpec, &'a str),
        inputs: Vec<Arc<OwnedStepInput>>,
        trials_s: f64,
        interrupted: &'a AtomicBool,
    ) -> Self {
        let (thinning, budget) = (Thinning::of(&inputs), TrialBudget::new(trials_s));
        Self { rig, spec, camera_key, inputs, thinning, budget, interrupted }
    }

    /// First step at or after a stamp.
    pub(super) fn step_at(&self, stamp_ns: i64) -> usize {
        self.inputs.partition_point(|input| input.stamp_ns < stamp_ns)
    }

    /// Records the steps of a span with all their features and with changes from step `change_at` on. `None` if the changes do
    /// not fit the run, a step fails, or after an interrupt.
    pub(super) fn recorded(
        &self,
        span: &TrialSpan,
        change_at: usize,
        changes: &ForkChanges,
        mut record: RunRecord,
    ) -> Option<RunRecord> {
        let mut engine = span.engine.clone();
        let change_at = change_at.max(span.steps.start);
        for number in span.steps.clone() {
            if self.interrupted.load(Ordering::Relaxed) {
                return None;
            }
            if number == change_at {
                apply_fork(changes, &mut engine, self.rig, self.camera_key).ok()?;
            }
            let input = self.inputs.get(number)?;
            let report = guarded(input.stamp_ns, || engine.report_without_rank(input)).ok()?;
            record.push(input.record(report, None));
        }
        Some(record)
    }

    /// Computes the steps before `end` with changes that the engine already has. `None` if a step fails, the cost exceeds a
    /// bound, or after an interrupt.
    fn advance(
        &self,
        state: &mut TrialState,
        span: &TrialSpan,
        end: usize,
        changes: &ForkChanges,
        bound: Option<&CostBound>,
    ) -> Option<()> {
        for number in state.next..end {
            if self.interrupted.load(Ordering::Relaxed) {
                return None;
            }
            let input = self.inputs.get(number)?;
            state.next = number + 1;
            let is_late = state.tracked_ns.is_none() && span.window_by.is_some_and(|limit| number > limit);
            if is_late || state.has_lost_window(input.stamp_ns, changes) {
                state.result.steps.push(StepMisfit { stamp_ns: input.stamp_ns, ..StepMisfit::default() });
                continue;
            }
            let input = self.thinning.input(input);
            let report = guarded(input.stamp_ns, || state.engine.report_without_rank(&input)).ok()?;
            let is_early = state.tracked_ns.is_none() && span.window_by.is_some();
            self.budget.count(&report, input.main_tracks().features.len(), is_early);
            if !report.window.is_empty() {
                state.tracked_ns = Some(input.stamp_ns);
            }
            let tracked = input.main_tracks().statistics.tracked;
            let misfit = StepMisfit::of(&report, tracked, pixel_scale(changes), Some(self.resolution_px()));
            state.result.take(number, misfit, &report);
            if bound.is_some_and(|bound| bound.is_exceeded(changes, &state.result.steps)) {
                return None;
            }
        }
        Some(())
    }

    fn resolution_px(&self) -> [usize; 2] {
        self.rig.camera(self.camera_key).map_or([0; 2], |camera| camera.model.resolution_px)
    }
}

impl<'a> SpanStates<'a> {
    pub(super) fn new(run: &'a DiagnosedRun<'a>, span: &'a TrialSpan) -> Self {
        let mut engine = span.engine.clone();
        run.thinning.apply(&mut engine);
        let (next, tracked_ns, result) = (span.steps.start, None, TrialResult::default());
        Self { run, span, states: [(next, TrialState { engine, next, tracked_ns, result })].into() }
    }

    /// Computes the run itself up to the steps at which changes begin, which [`Self::trial`] needs.
    pub(super) fn prepare(&mut self, steps: impl Iterator<Item = usize>) {
        for step in steps {
            let step = step.min(self.span.steps.end);
            let Some((from, state)) = self.states.range(..=step).next_back() else { continue };
            if *from < step {
                let mut state = state.clone();
                let no_change = ForkChanges::default();
                if self.run.advance(&mut state, self.span, step, &no_change, None).is_some() {
                    self.states.insert(step, state);
                }
            }
        }
    }

    /// Computes the steps of the span with changes from a prepared step on. `None` if the changes do not fit the run, a step
    /// fails, the cost exceeds a bound, or after an interrupt.
    pub(super) fn trial(
        &self,
        change_at: usize,
        changes: &ForkChanges,
        bound: Option<&CostBound>,
    ) -> Option<TrialResult> {
        let mut state = self.states.get(&change_at.clamp(self.span.steps.start, self.span.steps.end))?.clone();
        if bound.is_some_and(|bound| bound.was_exceeded(changes, &state.result.steps)) {
            return None;
        }
        apply_fork(changes, &mut state.engine, self.run.rig, self.run.camera_key).ok()?;
        self.run.advance(&mut state, self.span, self.span.steps.end, changes, bound)?;
        Some(state.result)
    }
}

impl TrialState {
    /// True if a trial with changes has been without a window for so long that it explains nothing. The run itself, with which
    /// trials are compared, is computed on.
    fn has_lost_window(&self, stamp_ns: i64, changes: &ForkChanges) -> bool {
        let limit_ns = ns_from_seconds(LATER_S);
        *changes != ForkChanges::default() && self.tracked_ns.is_some_and(|tracked_ns| stamp_ns - tracked_ns > limit_ns)
    }
}

/// Ratio of the pixels that the estimator uses to the pixels of the image.
fn pixel_scale(changes: &ForkChanges) -> f64 {
    let focal = changes.corrections.iter().filter(|it| matches!(it.kind, FaultKind::Focal | FaultKind::Zoom));
    focal.map(|fault| fault.value(0).recip()).product()
}

impl TrialResult {
    fn take(&mut self, number: usize, misfit: StepMisfit, report: &StepReport) {
        self.steps.push(misfit);
        let calibration = &report.calibration;
        if let Some(newest) = report.window.last() {
            let values = calibration.values.iter().copied().zip(calibration.sigmas.iter().copied());
            self.calibration = calibration.parameters.iter().copied().zip(values).collect();
            self.chain = Some(calibration.classical.clone());
            self.joints_rad.push((number, newest.joint_angles_rad.clone()));
        }
    }

    /// Stamp of the first step with a window.
    pub(super) fn initialized_ns(&self) -> Option<i64> {
        initialized_ns(&self.steps)
    }
}

/// Stamp of the first step with a window.
pub(super) fn initialized_ns(steps: &[StepMisfit]) -> Option<i64> {
    steps.iter().find(|step| step.tracking).map(|step| step.stamp_ns)
}
