use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::solver_trace::{SolverPosition, SolverTrace};
use super::summary::Thinning;
use super::warnings::{RunWarning, add_warnings, warnings_of};
use crate::estimator::{CalibrationEstimate, InformationGain, StepReport, allocated_bytes, rigid_columns};
use crate::flight_log::LogWarning;
use crate::frontend::TrackedFrame;
use crate::geometry::RigidTransform;
use crate::gimbal::{Chain, NearestForm, ParameterId, Parameterization};
use crate::observability::RankReport;
use crate::sensors::Rig;
use crate::session::accuracy::{Alignment, AlignmentSums};
use crate::session::engine::{EngineMessage, History, Retaken, Wish, tracks_bytes};
use crate::session::plan::{ForkChanges, RunSpec, SessionPlan};

/// One step of one run with what it was computed from.
#[derive(Clone, Debug)]
pub struct StepRecord {
    /// The estimator's report; its `linearization` has been analysed and dropped.
    pub report: StepReport,
    /// Observability of the calibration in this step, `None` while initializing.
    pub rank: Option<RankReport>,
    /// The tracks the step was given, of two cameras those of the main one; empty where it has no image.
    pub tracks: Arc<TrackedFrame>,
    /// True pose of the IMU, for drawing and comparing.
    pub truth: Option<RigidTransform>,
    /// Log time of the image since the log began, beside the report's header stamp.
    pub log_time_ns: i64,
    /// Whether features, older frames of the window and most landmarks were let go to save memory; see
    /// [`RunRecord::step_at`].
    pub outlined: bool,
}

impl StepRecord {
    /// The columns of the calibration and what the image told about them; `None` before the estimator tracks.
    pub fn gain(&self) -> Option<(&RankReport, &InformationGain)> {
        Some((self.rank.as_ref()?, self.report.gain.as_ref()?))
    }

    /// Bytes that it takes, without the tracks, which the runs that watch the same camera share.
    pub fn own_bytes(&self) -> usize {
        let reference_counts = 2 * size_of::<usize>();
        // The report's own fields lie within the record's.
        let fields = size_of::<Self>() - size_of::<StepReport>();
        allocated_bytes(reference_counts + fields)
            + self.report.bytes().total()
            + self.rank.as_ref().map_or(0, RankReport::heap_bytes)
    }

    /// Bytes of the tracks.
    pub fn tracks_bytes(&self) -> usize {
        tracks_bytes(&self.tracks)
    }
}

/// How much memory the steps of a run take, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunMemory {
    /// Everything but the tracks.
    pub own: usize,
    /// The tracks, which runs that watch the same camera share.
    pub tracks: usize,
    /// Number of steps that are kept in outline only.
    pub outlined: usize,
}

/// One run: an estimator over the log, and all its steps so far in time order.
#[derive(Clone, Debug)]
pub struct RunRecord {
    /// What was asked for; its `label` is the run's name on screen.
    pub spec: RunSpec,
    /// Key of the camera it watches (`cam0`), of two the one whose image is shown.
    pub camera_key: String,
    /// Steps in time order.
    pub steps: Vec<Arc<StepRecord>>,
    /// Whether the log's end has been reached.
    pub finished: bool,
    /// Why it ended early, when it did.
    pub error: Option<String>,
    /// `true_from_estimate`: the yaw and translation that lay the estimated trajectory on the truth, once there are
    /// enough frames with truth.
    pub alignment: Option<RigidTransform>,
    /// Sums over the frames with truth so far, from which `alignment` follows.
    pub alignment_sums: AlignmentSums,
    /// What its steps warned of.
    pub warnings: Vec<RunWarning>,
    /// How much memory its steps take.
    pub memory: RunMemory,
    /// How its steps came to be, so that any of them can be taken again; `None` for a run that was not computed here.
    pub history: Option<Arc<History>>,
    /// Outlined steps by number that were taken again, because somebody looks at them.
    pub retaken: BTreeMap<usize, Arc<StepRecord>>,
    /// The step that is looked at as the solver went through it.
    pub trace: Option<SolverTrace>,
    /// Tells the run apart from others, also from one that takes its place.
    pub id: u64,
    /// Where it comes from, for a fork.
    pub origin: Option<ForkOrigin>,
    thinning: Thinning,
}

impl RunRecord {
    /// A run before its first step.
    pub fn new(spec: RunSpec, camera_key: String) -> Self {
        Self {
            spec,
            camera_key,
            steps: Vec::new(),
            finished: false,
            error: None,
            alignment: None,
            alignment_sums: AlignmentSums::default(),
            warnings: Vec::new(),
            memory: RunMemory::default(),
            history: None,
            retaken: BTreeMap::new(),
            trace: None,
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            origin: None,
            thinning: Thinning::default(),
        }
    }

    /// A fork of another run before its first own step: the steps up to there are the parent's.
    pub(in crate::session) fn fork(parent: &Self, spec: RunSpec, step: usize, changes: ForkChanges) -> Self {
        let stamp_ns = parent.steps.get(step).map_or(0, |step| step.report.stamp_ns);
        let mut fork = Self::new(spec, parent.camera_key.clone());
        fork.origin = Some(ForkOrigin { parent: parent.id, step, stamp_ns, changes });
        fork.steps = parent.steps[..step].to_vec();
        // The steps are the parent's, who counts them; tracks are counted once for all runs.
        fork.memory.tracks = fork.steps.iter().map(|step| step.tracks_bytes()).sum();
        fork.warnings = warnings_of(&fork.steps);
        fork.align();
        fork
    }

    /// Adds a step behind the last one.
    pub fn push(&mut self, record: StepRecord) {
        if let (Some(newest), Some(truth)) = (record.report.newest(), &record.truth) {
            self.alignment_sums.add(&newest.world_from_imu.translation_m, &truth.translation_m);
            self.alignment = self.alignment_sums.solve(Alignment::YawPosition).map(|transform| transform.rigid);
        }
        self.memory.own += record.own_bytes();
        self.memory.tracks += record.tracks_bytes();
        add_warnings(&mut self.warnings, &record.report);
        self.steps.push(Arc::new(record));
    }

    /// Takes back the steps after a time; there may be some that another run's speed let it take.
    pub(in crate::session) fn end_at(&mut self, stamp_ns: i64) {
        let count = self.steps.partition_point(|step| step.report.stamp_ns <= stamp_ns);
        if count == self.steps.len() {
            return;
        }
        let steps = self.steps.split_off(count);
        let back = |bytes: fn(&StepRecord) -> usize| steps.iter().map(|step| bytes(step)).sum::<usize>();
        self.memory.own -= back(StepRecord::own_bytes);
        self.memory.tracks -= back(StepRecord::tracks_bytes);
        self.finished = true;
        self.warnings = warnings_of(&self.steps);
        self.align();
    }

    /// Whether its last step is the one at a time, or none can come before that time any more.
    pub(in crate::session) fn ends_at(&self, stamp_ns: i64) -> bool {
        self.steps.last().is_some_and(|step| step.report.stamp_ns >= stamp_ns)
    }

    /// Lays the trajectory on the truth anew.
    fn align(&mut self) {
        self.alignment_sums = AlignmentSums::default();
        for step in &self.steps {
            if let (Some(newest), Some(truth)) = (step.report.newest(), &step.truth) {
                self.alignment_sums.add(&newest.world_from_imu.translation_m, &truth.translation_m);
            }
        }
        self.alignment = self.alignment_sums.solve(Alignment::YawPosition).map(|transform| transform.rigid);
    }

    /// Number of the last step at or before a time.
    pub fn index_at(&self, stamp_ns: i64) -> Option<usize> {
        self.steps.partition_point(|step| step.report.stamp_ns <= stamp_ns).checked_sub(1)
    }

    /// A step as it is shown: as the solver went through it, or with everything where it has been taken again.
    pub fn step(&self, number: usize) -> Option<&Arc<StepRecord>> {
        let traced = self.trace.as_ref().filter(|trace| trace.step == number).and_then(SolverTrace::shown);
        traced.or_else(|| self.retaken.get(&number)).or_else(|| self.steps.get(number))
    }

    /// Whether the step is there in outline only.
    pub(in crate::session) fn lacks(&self, number: usize) -> bool {
        self.steps.get(number).is_some_and(|step| step.outlined) && !self.retaken.contains_key(&number)
    }

    /// Takes the steps at a time again where only their outlines are kept, so that pictures of that time show everything.
    pub fn fill_in(&mut self, stamp_ns: i64) {
        let Some(number) = self.index_at(stamp_ns).filter(|number| self.lacks(*number)) else { return };
        let steps = self.retake(number, 1);
        self.take_again(number, steps);
    }

    /// Takes over steps that were taken again around `number`; those farthest from it are forgotten.
    fn take_again(&mut self, number: usize, steps: Vec<(usize, StepRecord)>) {
        let outlined = |step: usize| self.steps.get(step).is_some_and(|step| step.outlined);
        let steps: Vec<_> = steps.into_iter().filter(|(step, _)| outlined(*step)).collect();
        self.retaken.extend(steps.into_iter().map(|(step, record)| (step, Arc::new(record))));
        while self.retaken.len() > MOST_RETAKEN {
            let (first, last) = (self.retaken.first_key_value(), self.retaken.last_key_value());
            let (Some((first, _)), Some((last, _))) = (first, last) else { return };
            let farthest = if number.abs_diff(*first) > number.abs_diff(*last) { *first } else { *last };
            self.retaken.remove(&farthest);
        }
    }

    /// The step with everything that it left, taken again where only its outline was kept: the same bits, but for the
    /// measured times.
    pub fn whole_step(&self, number: usize) -> Option<Arc<StepRecord>> {
        let step = self.steps.get(number)?;
        if !step.outlined {
            return Some(Arc::clone(step));
        }
        let (_, record) = self.retake(number, 1).pop()?;
        Some(Arc::new(record))
    }

    /// Takes the step `last` again, and before it up to `most - 1` others, from the nearest snapshot of the estimator,
    /// whatever is kept of them; with their numbers, in order.
    pub fn retake(&self, last: usize, most: usize) -> Vec<(usize, StepRecord)> {
        self.history.as_ref().map_or_else(Vec::new, |history| history.retake(last, most))
    }

    /// The states that the solver went through in a step: before its first iteration, after it, and so on to the last,
    /// which is the step itself. A step that makes the first window has only that.
    pub fn solver_states(&self, number: usize) -> Vec<StepRecord> {
        self.history.as_ref().map_or_else(Vec::new, |history| history.iterations(number))
    }

    /// Bytes of its steps, its snapshots and what its steps were given, without tracks that runs share.
    pub fn own_bytes(&self) -> usize {
        let retaken = self.retaken.values().chain(self.trace.iter().flat_map(|trace| &trace.records));
        self.memory.own
            + retaken.map(|step| step.own_bytes()).sum::<usize>()
            + self.history.as_ref().map_or(0, |history| history.bytes())
    }

    /// Keeps one more step in outline; whether there was one left.
    fn outline_one(&mut self) -> bool {
        let Some(history) = &self.history else { return false };
        let spacing = history.spacing();
        while let Some(victim) = self.thinning.next_victim(history.begin(), self.steps.len(), spacing) {
            let step = &self.steps[victim];
            if step.outlined {
                continue;
            }
            let outline = step.outline(victim);
            self.memory.own -= step.own_bytes() - outline.own_bytes();
            self.memory.outlined += 1;
            self.steps[victim] = Arc::new(outline);
            return true;
        }
        false
    }

    /// What a rig says about the columns of the run's calibration in the parameterization of an estimate; `None`
    /// when the rig does not have the cameras.
    ///
    /// Of the equivalent numbers of the classical form it takes those nearest to what `given` says, the rig that the run
    /// began with: in those the run counts.
    pub fn values_in(&self, rig: &Rig, given: &Rig, estimate: &CalibrationEstimate) -> Option<Vec<(ParameterId, f64)>> {
        let main = rig.chain_of_camera(&self.camera_key)?;
        let parameterization = estimate.parameterization.parse().ok()?;
        let form = self.form_in(given, estimate, parameterization)?;
        let chain = form.of(&Chain::from_classical(&main, Parameterization::Classical));
        let mut values: Vec<_> = chain.parameters().into_iter().zip(chain.values().iter().copied()).collect();
        let mut clocks = vec![(ParameterId::timeshift(0), self.camera_key.as_str())];
        for (camera, (key, _)) in (1..).zip(&estimate.rigid_cameras) {
            values.extend(rigid_columns(camera, &rig.chain_of_camera(key)?.imu_from_camera(&[])));
            clocks.push((ParameterId::timeshift(camera), key));
        }
        for (clock, key) in clocks.into_iter().filter(|(clock, _)| estimate.parameters.contains(clock)) {
            values.push((clock, rig.camera(key).ok()?.timeshift_cam_imu_s));
        }
        Some(values)
    }

    /// How mechanisms are said in a parameterization, with the numbers nearest to the rig's where there is a choice; the
    /// prior deviations of the estimate weigh them where it is of that parameterization. `None` when the rig does not have
    /// the camera.
    pub fn form_in(
        &self,
        given: &Rig,
        estimate: &CalibrationEstimate,
        parameterization: Parameterization,
    ) -> Option<NearestForm> {
        let near = Chain::from_classical(&given.chain_of_camera(&self.camera_key)?, parameterization);
        let parameters = near.parameters();
        let scales = if estimate.parameters.starts_with(&parameters) {
            estimate.prior_sigmas[..parameters.len()].to_vec()
        } else {
            parameters.iter().map(|parameter| parameter.dimension().scale()).collect()
        };
        Some(NearestForm::new(near, &scales.into()))
    }

    /// The last step at or before a time, as a cursor shows it.
    pub fn step_at(&self, stamp_ns: i64) -> Option<&Arc<StepRecord>> {
        self.step(self.index_at(stamp_ns)?)
    }
}

/// Number of the next run.
static NEXT_ID: AtomicU64 = AtomicU64::new(0);

/// Outlined steps of a run that are kept when they were taken again.
const MOST_RETAKEN: usize = 96;

/// Of the memory of a recording, the share that snapshots may take.
const SNAPSHOT_SHARE: usize = 4;

/// Where a fork has left its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct ForkOrigin {
    /// [`RunRecord::id`] of the parent.
    pub parent: u64,
    /// Number of the first step that is the fork's own.
    pub step: usize,
    /// Its stamp since the log began.
    pub stamp_ns: i64,
    /// What the fork does otherwise.
    pub changes: ForkChanges,
}

/// Everything computed so far about one log.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Where the log lies.
    pub log_path: PathBuf,
    /// The rig the runs were given.
    pub rig: Arc<Rig>,
    /// The rig with the true values, when known.
    pub truth_rig: Option<Arc<Rig>>,
    /// Length of the log in nanoseconds.
    pub duration_ns: i64,
    /// Absolute header stamp of the log's begin, in nanoseconds since the epoch.
    pub epoch_ns: i64,
    /// Runs in the order they were asked for.
    pub runs: Vec<RunRecord>,
    /// What is wrong with the log, as found so far.
    pub warnings: Vec<LogWarning>,
    /// How much memory it may take, in bytes.
    pub memory_budget_bytes: usize,
}

impl Recording {
    /// Nothing computed yet.
    pub fn new(plan: &SessionPlan) -> Self {
        let mut recording = Self {
            log_path: plan.log_path.clone(),
            rig: Arc::clone(&plan.rig),
            truth_rig: plan.truth_rig.clone(),
            duration_ns: plan.log.duration_ns(),
            epoch_ns: plan.log.epoch_ns(),
            runs: plan.runs.iter().map(|(spec, camera_key)| RunRecord::new(spec.clone(), camera_key.clone())).collect(),
            warnings: Vec::new(),
            memory_budget_bytes: plan.memory_budget_bytes,
        };
        for run in std::mem::take(&mut recording.runs) {
            recording.add_run(run);
        }
        recording.take(EngineMessage::Warnings(plan.log.warnings().to_vec()));
        recording
    }

    /// Adds a run that is to be computed.
    pub(in crate::session) fn add_run(&mut self, mut run: RunRecord) {
        if run.history.is_none() {
            run.history = Some(Arc::new(History::new(self.memory_budget_bytes)));
        }
        self.runs.push(run);
        self.share_out_memory();
    }

    /// From now on it may take so many bytes; steps that do not fit any more are kept in outline.
    pub(in crate::session) fn set_memory_budget(&mut self, bytes: usize) {
        self.memory_budget_bytes = bytes;
        self.share_out_memory();
        self.keep_within_budget();
    }

    /// Divides what snapshots may take among the runs.
    fn share_out_memory(&self) {
        let each = self.memory_budget_bytes / SNAPSHOT_SHARE / self.runs.len().max(1);
        for history in self.runs.iter().filter_map(|run| run.history.as_ref()) {
            history.set_budget(each);
        }
    }

    /// Keeps steps in outline until the recording fits into its memory, or only the newest steps are left.
    fn keep_within_budget(&mut self) {
        while self.memory_bytes() > self.memory_budget_bytes {
            // The run with the most to give goes first; forks come after the run that they share steps with.
            let mut runs: Vec<usize> = (0..self.runs.len()).collect();
            runs.sort_by_key(|run| std::cmp::Reverse(self.runs[*run].memory.own));
            if !runs.into_iter().any(|run| self.runs[run].outline_one()) {
                return;
            }
        }
    }

    /// Adds what a thread has reported.
    pub fn take(&mut self, message: EngineMessage) {
        match message {
            EngineMessage::Step { run, record } => {
                if let Some(run) = self.runs.get_mut(run) {
                    run.push(*record);
                }
                self.keep_within_budget();
            }
            EngineMessage::Finished { run, error } => {
                if let Some(run) = self.runs.get_mut(run) {
                    run.finished = true;
                    run.error = error;
                }
            }
            EngineMessage::Warnings(warnings) => {
                for warning in warnings {
                    let key = |known: &LogWarning| (known.stamp_ns, known.message.clone());
                    // Two cameras read the same log and find the same faults, in an order that their threads decide.
                    if let Err(index) = self.warnings.binary_search_by_key(&key(&warning), key) {
                        self.warnings.insert(index, warning);
                    }
                }
            }
        }
    }

    /// Takes the steps at a time again where only their outlines are kept; see [`RunRecord::fill_in`].
    pub fn fill_in(&mut self, stamp_ns: i64) {
        for run in &mut self.runs {
            run.fill_in(stamp_ns);
        }
    }

    /// Takes back everything after a time.
    pub(in crate::session) fn end_at(&mut self, stamp_ns: i64) {
        for run in &mut self.runs {
            run.end_at(stamp_ns);
        }
        self.warnings.retain(|warning| warning.stamp_ns <= stamp_ns);
    }

    /// Takes over what was taken again of a run; the state of the solver is the one at a position.
    pub(in crate::session) fn take_retaken(&mut self, wish: &Wish, retaken: Retaken, position: SolverPosition) {
        let Some(run) = self.runs.iter_mut().find(|run| run.id == wish.run) else { return };
        match retaken {
            Retaken::Whole(steps) => run.take_again(wish.step, steps),
            Retaken::Iterations(records) => {
                let records: Vec<_> = records.into_iter().map(Arc::new).collect();
                let at = position.of(records.len().saturating_sub(1));
                run.trace = Some(SolverTrace { step: wish.step, records, at });
            }
        }
    }

    /// How much memory the recorded steps take, in bytes; tracks that runs share are counted once.
    pub fn memory_bytes(&self) -> usize {
        let mut tracks: BTreeMap<&str, usize> = BTreeMap::new();
        for run in &self.runs {
            let shared = tracks.entry(&run.camera_key).or_default();
            *shared = run.memory.tracks.max(*shared);
        }
        tracks.values().sum::<usize>() + self.runs.iter().map(RunRecord::own_bytes).sum::<usize>()
    }

    /// How far every run has come, in nanoseconds since the log began; the end when all are finished.
    pub fn computed_ns(&self) -> i64 {
        let reached = |run: &RunRecord| run.steps.last().map_or(0, |step| step.report.stamp_ns);
        self.runs.iter().filter(|run| !run.finished).map(reached).min().unwrap_or_else(|| self.last_stamp_ns())
    }

    /// Stamp of the last step of any run.
    pub fn last_stamp_ns(&self) -> i64 {
        self.runs.iter().filter_map(|run| run.steps.last()).map(|step| step.report.stamp_ns).max().unwrap_or(0)
    }
}
