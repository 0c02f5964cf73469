use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::RunSpec;
use super::accuracy::{Alignment, AlignmentSums};
use super::engine::EngineMessage;
use super::plan::SessionPlan;
use crate::estimator::{CalibrationEstimate, StepReport, allocated_bytes, rigid_columns};
use crate::flight_log::{LogWarning, Rig};
use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::geometry::RigidTransform;
use crate::gimbal::Chain;
use crate::observability::RankReport;

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
}

impl StepRecord {
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
        let features = &self.tracks.features;
        allocated_bytes(size_of::<TrackedFrame>() + 2 * size_of::<usize>())
            + allocated_bytes(features.capacity() * size_of::<TrackedFeature>())
    }
}

/// How much memory the steps of a run take, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunMemory {
    /// Everything but the tracks.
    pub own: usize,
    /// The tracks, which runs that watch the same camera share.
    pub tracks: usize,
}

impl RunMemory {
    fn add(&mut self, step: &StepRecord) {
        self.own += step.own_bytes();
        self.tracks += step.tracks_bytes();
    }
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
    /// How much memory its steps take.
    pub memory: RunMemory,
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
            memory: RunMemory::default(),
        }
    }

    /// Adds a step behind the last one.
    pub fn push(&mut self, record: StepRecord) {
        if let (Some(newest), Some(truth)) = (record.report.newest(), &record.truth) {
            self.alignment_sums.add(&newest.world_from_imu.translation_m, &truth.translation_m);
            self.alignment = self.alignment_sums.solve(Alignment::YawPosition).map(|transform| transform.rigid);
        }
        self.memory.add(&record);
        self.steps.push(Arc::new(record));
    }

    /// What a rig says about the columns of the run's calibration, by name, in the parameterization of an estimate; `None`
    /// when the rig does not have the cameras.
    pub fn values_in(&self, rig: &Rig, estimate: &CalibrationEstimate) -> Option<Vec<(String, f64)>> {
        let main = rig.chain_of_camera(&self.camera_key)?;
        let chain = Chain::from_classical(&main, estimate.parameterization.parse().ok()?);
        let mut values: Vec<_> = chain.parameter_names().into_iter().zip(chain.values().iter().copied()).collect();
        for (key, _) in &estimate.rigid_cameras {
            values.extend(rigid_columns(key, &rig.chain_of_camera(key)?.imu_from_camera(&[])));
        }
        Some(values)
    }

    /// The last step at or before a time, as a cursor shows it.
    pub fn step_at(&self, stamp_ns: i64) -> Option<&Arc<StepRecord>> {
        let after = self.steps.partition_point(|step| step.report.stamp_ns <= stamp_ns);
        after.checked_sub(1).and_then(|index| self.steps.get(index))
    }
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
}

impl Recording {
    /// Nothing computed yet.
    pub fn new(plan: &SessionPlan) -> Self {
        Self {
            log_path: plan.log_path.clone(),
            rig: Arc::clone(&plan.rig),
            truth_rig: plan.truth_rig.clone(),
            duration_ns: plan.log.duration_ns(),
            epoch_ns: plan.log.epoch_ns(),
            runs: plan.runs.iter().map(|(spec, camera_key)| RunRecord::new(spec.clone(), camera_key.clone())).collect(),
            warnings: Vec::new(),
        }
        .with_warnings(plan.log.warnings())
    }

    fn with_warnings(mut self, warnings: &[LogWarning]) -> Self {
        self.take(EngineMessage::Warnings(warnings.to_vec()));
        self
    }

    /// Adds what a thread has reported.
    pub fn take(&mut self, message: EngineMessage) {
        match message {
            EngineMessage::Step { run, record } => {
                if let Some(run) = self.runs.get_mut(run) {
                    run.push(*record);
                }
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

    /// How much memory the recorded steps take, in bytes; tracks that runs share are counted once.
    pub fn memory_bytes(&self) -> usize {
        let mut tracks: BTreeMap<&str, usize> = BTreeMap::new();
        for run in &self.runs {
            let shared = tracks.entry(&run.camera_key).or_default();
            *shared = run.memory.tracks.max(*shared);
        }
        tracks.values().sum::<usize>() + self.runs.iter().map(|run| run.memory.own).sum::<usize>()
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
