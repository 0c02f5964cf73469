//! The record of one run: its steps in time order and values derived from them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::antenna_record::{AntennaRecord, PositionTruth};
use super::diagnosis::Diagnosis;
use super::image_residuals::ImageResiduals;
use super::sigma_scale::{SigmaScale, scale_sigmas};
use super::solver_trace::SolverTrace;
use super::step::{RunWarning, StepFactorRows, StepRecord, add_warnings, warnings_of};
use super::summary::SummaryOrder;
use crate::estimator::{CalibrationPosterior, EventKind};
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::session::accuracy::{AlignmentSums, TrajectoryAlignment};
use crate::session::misfit::StepMisfit;
use crate::session::plan::{ForkChanges, RunSpec};

/// Maximum number of recomputed complete steps of a run.
const MAX_RECOMPUTED: usize = 96;

pub(super) static NEXT_ID: AtomicU64 = AtomicU64::new(0);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunMemory {
    /// Steps without their tracks.
    pub steps: usize,
    /// Tracks, which runs on the same camera share.
    pub tracks: usize,
    /// Step inputs and estimator snapshots for recomputation.
    pub history: usize,
    /// Number of steps of which only the summary is kept.
    pub summaries: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct ForkOrigin {
    /// [`RunRecord::id`] of the parent.
    pub parent: u64,
    /// Index of the first step of the fork that is not the parent's.
    pub step: usize,
    /// Stamp of that step, in nanoseconds since the log began.
    pub stamp_ns: i64,
    /// Changes against the parent.
    pub changes: ForkChanges,
}

/// Progress of a pass before the last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassProgress {
    /// Number of the pass, counted from 1.
    pub number: usize,
    /// Latest stamp of the pass, in nanoseconds since the log began.
    pub reached_ns: i64,
}

/// One run: an estimator on the log with all its steps so far, in time order.
#[derive(Clone, Debug)]
pub struct RunRecord {
    /// The specification; its `label` is the run's name in the window.
    pub spec: RunSpec,
    /// Key of the main camera (`cam0`), whose image is shown.
    pub camera_key: String,
    /// Steps in time order; some may be summaries.
    pub steps: Vec<Arc<StepRecord>>,
    /// True if the run has reached the end of the log or has failed.
    pub finished: bool,
    /// The current or latest pass before the last one, for runs with several passes.
    pub earlier_pass: Option<PassProgress>,
    /// Reason of an early end.
    pub error: Option<String>,
    /// Calibration at the end of the run, as prior of another flight; `None` before the end, and without a window then.
    pub posterior: Option<Arc<CalibrationPosterior>>,
    /// `true_from_estimate`: the yaw rotation and translation that align the estimated trajectory with the ground
    /// truth, `None` with too few frames.
    pub alignment: Option<RigidTransform>,
    /// Running sums over the frames with ground truth, from which `alignment` is computed.
    pub alignment_sums: AlignmentSums,
    /// Antenna positions that are the ground truth instead of poses.
    pub position_truth: Option<Arc<PositionTruth>>,
    /// Pairs of run poses and these positions, with their alignment.
    pub(super) antenna: AntennaRecord,
    /// Residuals of each step by sensor.
    pub(in crate::session) misfits: Vec<StepMisfit>,
    /// Result of the last diagnosis; `None` without one.
    pub diagnosis: Option<Arc<Diagnosis>>,
    /// Scale of the standard deviations of the calibration, from the steps so far.
    sigma_scale: SigmaScale,
    /// Residuals of every image in the step of that image, by place in the image.
    pub image_residuals: ImageResiduals,
    /// Warnings of its steps, each message once.
    pub warnings: Vec<RunWarning>,
    /// Memory of the steps and the history.
    pub memory: RunMemory,
    /// Complete steps by index, recomputed where `steps` has only the summary.
    pub recomputed: BTreeMap<usize, Arc<StepRecord>>,
    /// Solver states of the step at the cursor, while they are shown.
    pub trace: Option<SolverTrace>,
    /// The factor rows of the last request, of any step.
    pub factor_rows: Option<StepFactorRows>,
    /// Unique among all runs of the process.
    pub id: u64,
    /// `None` unless the run is a fork.
    pub origin: Option<ForkOrigin>,
    summary_order: SummaryOrder,
}

impl RunRecord {
    /// A run before its first step.
    pub fn new(spec: RunSpec, camera_key: String) -> Self {
        Self {
            spec,
            camera_key,
            steps: Vec::new(),
            finished: false,
            earlier_pass: None,
            error: None,
            posterior: None,
            alignment: None,
            alignment_sums: AlignmentSums::default(),
            position_truth: None,
            antenna: AntennaRecord::default(),
            misfits: Vec::new(),
            diagnosis: None,
            sigma_scale: SigmaScale::default(),
            image_residuals: ImageResiduals::default(),
            warnings: Vec::new(),
            memory: RunMemory::default(),
            recomputed: BTreeMap::new(),
            trace: None,
            factor_rows: None,
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            origin: None,
            summary_order: SummaryOrder::default(),
        }
    }

    /// True if no step follows: all are computed, or the run ended with an error.
    pub fn has_ended(&self) -> bool {
        self.finished || self.error.is_some()
    }

    /// Sets antenna positions as the ground truth; the run must not have steps yet.
    #[must_use]
    pub fn with_position_truth(mut self, truth: Option<Arc<PositionTruth>>) -> Self {
        self.position_truth = truth;
        self
    }

    /// A fork before its first step; the steps before it are the parent's.
    pub(in crate::session) fn fork(parent: &Self, spec: RunSpec, step: usize, changes: ForkChanges) -> Self {
        let stamp_ns = parent.steps.get(step).map_or(0, |step| step.report.stamp_ns);
        let mut fork = Self::new(spec, parent.camera_key.clone()).with_position_truth(parent.position_truth.clone());
        fork.origin = Some(ForkOrigin { parent: parent.id, step, stamp_ns, changes });
        fork.steps = parent.steps[..step].to_vec();
        // The parent counts the bytes of the shared steps; tracks are counted once for all runs.
        fork.memory.tracks = fork.steps.iter().map(|step| step.tracks_bytes()).sum();
        fork.warnings = warnings_of(&fork.steps);
        fork.sigma_scale = SigmaScale::of_steps(&fork.steps);
        fork.misfits = parent.misfits.get(..step).unwrap_or_default().to_vec();
        // Of steps that are kept as summaries the residuals are not known any more.
        fork.image_residuals = ImageResiduals::of_steps(fork.steps.iter().map(Arc::as_ref));
        fork.align();
        fork
    }

    /// Appends a step with the scale of the standard deviations of its calibration, and updates alignment and warnings.
    pub fn push(&mut self, mut record: StepRecord) {
        self.sigma_scale.observe(&record.report);
        scale_sigmas(&mut record.report.calibration, self.sigma_scale.factor());
        if let (Some(newest), Some(ground_truth)) = (record.report.newest(), &record.ground_truth) {
            self.alignment_sums.add(&newest.world_from_imu.translation_m, &ground_truth.translation_m);
            self.alignment =
                self.alignment_sums.solve(TrajectoryAlignment::YawPosition).map(|transform| transform.rigid);
        }
        if let (Some(newest), Some(truth)) = (record.report.newest(), &self.position_truth) {
            self.antenna.push(truth, newest.stamp_ns, newest.world_from_imu);
            self.alignment = self.antenna.alignment.map(|alignment| alignment.true_from_estimate);
        }
        self.memory.steps += record.own_bytes();
        self.memory.tracks += record.tracks_bytes();
        add_warnings(&mut self.warnings, &record.report);
        self.misfits.push(StepMisfit::of(&record.report, record.tracks.statistics.tracked, 1.0, None));
        self.image_residuals.add_step(&record.report);
        self.steps.push(Arc::new(record));
    }

    /// Reasons for which attempts to initialize waited, each with its number of images, the most frequent first. A reason
    /// is its last message.
    pub(in crate::session) fn waiting_reasons(&self) -> Vec<(String, usize)> {
        let mut reasons: Vec<(&str, usize)> = Vec::new();
        let events = self.steps.iter().flat_map(|step| &step.report.events);
        for event in events.filter(|event| event.kind == EventKind::InitializationWaits) {
            let subject = |message: &str| message.split(':').next().map(str::to_owned);
            let message = event.message.as_str();
            match reasons.iter_mut().find(|(known, _)| subject(known) == subject(message)) {
                Some((known, count)) => (*known, *count) = (message, *count + 1),
                None => reasons.push((message, 1)),
            }
        }
        reasons.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        reasons.into_iter().map(|(message, count)| (message.to_owned(), count)).collect()
    }

    /// Keys of the cameras of its last step, the main one first.
    pub fn last_camera_keys(&self) -> Vec<&str> {
        let main = || vec![self.camera_key.as_str()];
        self.steps.last().map_or_else(main, |step| self.camera_keys(&step.report.calibration))
    }

    /// Removes the steps after a stamp.
    pub(in crate::session) fn end_at(&mut self, stamp_ns: i64) {
        let count = self.steps.partition_point(|step| step.report.stamp_ns <= stamp_ns);
        if count == self.steps.len() {
            return;
        }
        let steps = self.steps.split_off(count);
        let back = |bytes: fn(&StepRecord) -> usize| steps.iter().map(|step| bytes(step)).sum::<usize>();
        self.memory.steps -= back(StepRecord::own_bytes);
        self.memory.tracks -= back(StepRecord::tracks_bytes);
        self.finished = true;
        self.misfits.truncate(count);
        self.warnings = warnings_of(&self.steps);
        self.image_residuals = ImageResiduals::of_steps(self.steps.iter().map(Arc::as_ref));
        self.align();
    }

    /// True if the last step is at a stamp or after it.
    pub(in crate::session) fn ends_at(&self, stamp_ns: i64) -> bool {
        self.steps.last().is_some_and(|step| step.report.stamp_ns >= stamp_ns)
    }

    /// Aligns the trajectory with the ground truth, from all steps.
    fn align(&mut self) {
        self.alignment_sums = AlignmentSums::default();
        for step in &self.steps {
            if let (Some(newest), Some(ground_truth)) = (step.report.newest(), &step.ground_truth) {
                self.alignment_sums.add(&newest.world_from_imu.translation_m, &ground_truth.translation_m);
            }
        }
        self.alignment = self.alignment_sums.solve(TrajectoryAlignment::YawPosition).map(|transform| transform.rigid);
        if let Some(truth) = &self.position_truth {
            self.antenna = AntennaRecord::default();
            for newest in self.steps.iter().filter_map(|step| step.report.newest()) {
                self.antenna.push(truth, newest.stamp_ns, newest.world_from_imu);
            }
            self.alignment = self.antenna.alignment.map(|alignment| alignment.true_from_estimate);
        }
    }

    /// Index of the last step at or before a stamp.
    pub fn index_at(&self, stamp_ns: i64) -> Option<usize> {
        self.steps.partition_point(|step| step.report.stamp_ns <= stamp_ns).checked_sub(1)
    }

    /// The last step at or before a stamp as it is shown; see [`RunRecord::step`].
    pub fn step_at(&self, stamp_ns: i64) -> Option<&Arc<StepRecord>> {
        self.step(self.index_at(stamp_ns)?)
    }

    /// A step as it is shown: a solver state if one is selected, else the recomputed step if `steps` has only the
    /// summary.
    pub fn step(&self, number: usize) -> Option<&Arc<StepRecord>> {
        let traced = self.trace.as_ref().filter(|trace| trace.step == number).and_then(SolverTrace::shown);
        traced.or_else(|| self.recomputed.get(&number)).or_else(|| self.steps.get(number))
    }

    /// Scales the standard deviations of a recomputed record of a step as in that step.
    pub(in crate::session) fn scale_as(&self, number: usize, record: &mut StepRecord) {
        let factor = self.steps.get(number).map_or(1.0, |step| step.report.calibration.sigma_scale);
        scale_sigmas(&mut record.report.calibration, factor);
    }

    /// True if only the summary of a step is stored.
    pub(in crate::session) fn has_only_summary(&self, number: usize) -> bool {
        self.steps.get(number).is_some_and(|step| step.summary_only) && !self.recomputed.contains_key(&number)
    }

    /// Stores recomputed steps around step `number`; beyond [`MAX_RECOMPUTED`], the farthest from it are evicted.
    pub(in crate::session) fn add_recomputed(&mut self, number: usize, steps: Vec<(usize, StepRecord)>) {
        let summary_only = |step: usize| self.steps.get(step).is_some_and(|step| step.summary_only);
        let steps: Vec<_> = steps.into_iter().filter(|(step, _)| summary_only(*step)).collect();
        for (step, mut record) in steps {
            self.scale_as(step, &mut record);
            self.recomputed.insert(step, Arc::new(record));
        }
        while self.recomputed.len() > MAX_RECOMPUTED {
            let (first, last) = (self.recomputed.first_key_value(), self.recomputed.last_key_value());
            let (Some((first, _)), Some((last, _))) = (first, last) else { return };
            let farthest = if number.abs_diff(*first) > number.abs_diff(*last) { *first } else { *last };
            self.recomputed.remove(&farthest);
        }
    }

    /// Bytes of the steps and the history, without tracks, which runs share.
    pub fn own_bytes(&self) -> usize {
        let recomputed = self.recomputed.values().chain(self.trace.iter().flat_map(|trace| &trace.records));
        self.memory.steps + recomputed.map(|step| step.own_bytes()).sum::<usize>() + self.memory.history
    }

    /// Replaces one more of the run's steps (from `begin` on) by its summary; `spacing` is the number of steps between
    /// two estimator snapshots. Returns true if there was a step left to summarize.
    pub(in crate::session) fn summarize_one(&mut self, begin: usize, spacing: usize) -> bool {
        while let Some(number) = self.summary_order.next(begin, self.steps.len(), spacing) {
            let step = &self.steps[number];
            if step.summary_only {
                continue;
            }
            let summary = step.summary(number);
            self.memory.steps -= step.own_bytes() - summary.own_bytes();
            self.memory.summaries += 1;
            self.steps[number] = Arc::new(summary);
            return true;
        }
        false
    }

    /// Log time from the last step to the end of a log of this duration, in seconds.
    pub fn behind_s(&self, duration_ns: i64) -> f64 {
        seconds_from_ns((duration_ns - self.reached_ns()).max(0))
    }

    /// Computed fraction of the run, all passes together, from 0 to 1; `duration_ns` is the duration of the log.
    pub fn computed_fraction(&self, duration_ns: i64) -> f64 {
        let passes = self.spec.passes.max(1);
        let before = match self.running_pass() {
            Some(pass) => pass.number - 1,
            None if self.steps.is_empty() => 0,
            None => passes - 1,
        };
        let of_pass = (self.reached_ns() as f64 / duration_ns.max(1) as f64).clamp(0.0, 1.0);
        (before as f64 + of_pass) / passes as f64
    }

    /// "pass 1 of 2 " while a pass before the last one runs, else nothing.
    pub fn pass_text(&self) -> String {
        match self.running_pass() {
            Some(pass) => format!("pass {} of {} ", pass.number, self.spec.passes),
            None => String::new(),
        }
    }

    /// Latest stamp of the running pass, in nanoseconds since the log began.
    pub fn reached_ns(&self) -> i64 {
        let last_ns = self.steps.last().map_or(0, |step| step.report.stamp_ns);
        self.running_pass().map_or(last_ns, |pass| pass.reached_ns)
    }

    /// The pass before the last one that runs; `None` once the last pass has its first step.
    fn running_pass(&self) -> Option<PassProgress> {
        self.earlier_pass.filter(|_| self.steps.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_counts_all_passes() {
        let mut run = RunRecord::new("auto:passes=2".parse().unwrap(), "cam0".to_owned());
        assert_eq!((run.computed_fraction(1000), run.pass_text().as_str()), (0.0, ""));
        run.earlier_pass = Some(PassProgress { number: 1, reached_ns: 500 });
        assert_eq!((run.computed_fraction(1000), run.pass_text().as_str()), (0.25, "pass 1 of 2 "));
        run.spec.passes = 1;
        run.earlier_pass = Some(PassProgress { number: 1, reached_ns: 2000 });
        assert_eq!(run.computed_fraction(1000), 1.0);
        assert_eq!(run.computed_fraction(0), 1.0);
    }
}
