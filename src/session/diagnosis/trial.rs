//! One trial: a run computed again with one change, on the inputs of its steps.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::cost_bound::CostBound;
use crate::estimator::StepReport;
use crate::faults::FaultKind;
use crate::gimbal::{ClassicalChain, ParameterId};
use crate::sensors::Rig;
use crate::session::engine::{OwnedStepInput, RunEngine, apply_fork, guarded};
use crate::session::misfit::StepMisfit;
use crate::session::plan::{ForkChanges, RunSpec};
use crate::session::record::RunRecord;

/// The run to be diagnosed.
pub(super) struct DiagnosedRun<'a> {
    pub(super) rig: &'a Rig,
    pub(super) spec: &'a RunSpec,
    /// Key of the main camera.
    pub(super) camera_key: &'a str,
    /// Inputs of all steps.
    pub(super) inputs: Vec<Arc<OwnedStepInput>>,
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
    pub(super) restarts: usize,
}

impl DiagnosedRun<'_> {
    /// First step at or after a stamp.
    pub(super) fn step_at(&self, stamp_ns: i64) -> usize {
        self.inputs.partition_point(|input| input.stamp_ns < stamp_ns)
    }

    /// Computes the steps of a span with changes from step `change_at` on. `None` if the changes do not fit the run, a step
    /// fails, the cost exceeds a bound, or after an interrupt.
    pub(super) fn trial(
        &self,
        span: &TrialSpan,
        change_at: usize,
        changes: &ForkChanges,
        bound: Option<&CostBound>,
    ) -> Option<TrialResult> {
        self.steps(span, change_at, changes, bound, &mut |_, _| ())
    }

    /// Records the steps of a span with changes from step `change_at` on, as [`Self::trial`].
    pub(super) fn recorded(
        &self,
        span: &TrialSpan,
        change_at: usize,
        changes: &ForkChanges,
        mut record: RunRecord,
    ) -> Option<RunRecord> {
        let push = &mut |report: StepReport, input: &OwnedStepInput| record.push(input.record(report, None));
        self.steps(span, change_at, changes, None, push)?;
        Some(record)
    }

    fn steps(
        &self,
        span: &TrialSpan,
        change_at: usize,
        changes: &ForkChanges,
        bound: Option<&CostBound>,
        on_report: &mut dyn FnMut(StepReport, &OwnedStepInput),
    ) -> Option<TrialResult> {
        let mut engine = span.engine.clone();
        let change_at = change_at.max(span.steps.start);
        let mut result = TrialResult::default();
        let mut tracked = false;
        for number in span.steps.clone() {
            if self.interrupted.load(Ordering::Relaxed) {
                return None;
            }
            if number == change_at {
                apply_fork(changes, &mut engine, self.rig, self.camera_key).ok()?;
            }
            let input = self.inputs.get(number)?;
            if !tracked && span.window_by.is_some_and(|limit| number > limit) {
                result.steps.push(StepMisfit { stamp_ns: input.stamp_ns, ..StepMisfit::default() });
                continue;
            }
            let report = guarded(input.stamp_ns, || engine.report_without_rank(input)).ok()?;
            tracked |= !report.window.is_empty();
            let scale = if number >= change_at { pixel_scale(changes) } else { 1.0 };
            result.take(
                number,
                StepMisfit::of(&report, input.main_tracks().statistics.tracked, scale, Some(self.resolution_px())),
                &report,
            );
            on_report(report, input);
            if bound.is_some_and(|bound| bound.is_exceeded(changes, &result.steps)) {
                return None;
            }
        }
        Some(result)
    }

    fn resolution_px(&self) -> [usize; 2] {
        self.rig.camera(self.camera_key).map_or([0; 2], |camera| camera.model.resolution_px)
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
        self.restarts = report.restarts;
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
        self.steps.iter().find(|step| step.tracking).map(|step| step.stamp_ns)
    }
}
