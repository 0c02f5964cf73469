//! The threads of a session: one tracker per camera, one estimator per run, results over one channel.
//!
//! Every run is computed on its own thread from its own copy of the tracks, so the results do not depend on the
//! scheduling of threads. A run with two cameras receives inputs from two trackers.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};

use super::computation::{Computation, EngineMessage};
use super::configuration::estimator_config;
use super::frame_camera::FrameCamera;
use super::frame_sets::FrameSets;
use super::history::History;
use super::passes::{EarlierPasses, PassFailure, guarded};
use super::run_engine::RunEngine;
use super::step_inputs::OwnedStepInput;
use super::tracker::CameraTracker;
use crate::estimator::EstimatorConfig;
use crate::session::plan::{RunSpec, SessionError, SessionPlan, cameras_of_run};
use crate::session::record::KeptTracks;

/// Capacity in frames of the queue between a tracker and an estimator.
const FRAME_QUEUE_CAPACITY: usize = 8;
/// Capacity in steps of the queue to the collector.
const STEP_QUEUE_CAPACITY: usize = 64;

/// The running threads. Dropping it stops them.
#[derive(Debug)]
pub(in crate::session) struct Engine {
    sender: Option<SyncSender<EngineMessage>>,
    receiver: Option<Receiver<EngineMessage>>,
    cancelled: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Default for Engine {
    fn default() -> Self {
        let (sender, receiver) = sync_channel(STEP_QUEUE_CAPACITY);
        Self {
            sender: Some(sender),
            receiver: Some(receiver),
            cancelled: Arc::new(AtomicBool::new(false)),
            threads: Vec::new(),
        }
    }
}

impl Engine {
    pub(in crate::session) fn start(plan: &SessionPlan, computation: &Computation) -> Result<Self, SessionError> {
        let mut engine = Self::default();
        engine.start_runs(plan, computation, &(0..plan.runs.len()).collect::<Vec<_>>())?;
        Ok(engine)
    }

    /// Starts the given runs at the start of the log. Runs on the same camera share one tracker.
    pub(in crate::session) fn start_runs(
        &mut self,
        plan: &SessionPlan,
        computation: &Computation,
        runs: &[usize],
    ) -> Result<(), SessionError> {
        let Some(sender) = self.sender.clone() else { return Ok(()) };
        // Images that wait in a queue cannot be left out any more.
        let frame_queue_capacity = if plan.log.keeps_up() { 1 } else { FRAME_QUEUE_CAPACITY };
        let mut queues: BTreeMap<&str, Vec<SyncSender<Arc<OwnedStepInput>>>> = BTreeMap::new();
        let mut partners: BTreeMap<&str, &str> = BTreeMap::new();
        for &run in runs {
            let (spec, _) = &plan.runs[run];
            let cameras: Vec<_> = cameras_of_run(&plan.rig, spec)?.iter().collect();
            let mut frames = Vec::new();
            for camera in &cameras {
                let (queue, receiver) = sync_channel(frame_queue_capacity);
                queues.entry(&camera.key).or_default().push(queue);
                frames.push(receiver);
            }
            let mut config = config_with_prior(plan, spec)?;
            let pairs = cameras.iter().enumerate().filter_map(|(index, camera)| Some((camera, config.partner(index)?)));
            partners.extend(pairs.map(|(camera, partner)| (camera.key.as_str(), cameras[partner].key.as_str())));
            let has_gimbal_imu = config.gimbal_imu.is_some();
            let frame_camera = FrameCamera::of_run(&plan.log, &cameras, plan.start_s, has_gimbal_imu)?;
            config.frame_camera = frame_camera.map(|found| found.camera);
            let (passes, keep_linearization_every) = (spec.passes, plan.keep_linearization_every);
            let results = sender.clone();
            let Some(history) = computation.history(run).cloned() else { continue };
            self.threads.push(spawn(format!("estimator {run}"), move || {
                let run = RunOverLog { run, passes, config, keep_linearization_every, history, results };
                run.start(FrameSets::new(frames, frame_camera));
            })?);
        }
        for (camera_key, queues) in queues {
            let (log, rig, start_s, duration_s) = (&plan.log, &plan.rig, plan.start_s, plan.duration_s);
            let mut tracker = CameraTracker::new(Arc::clone(log), rig, camera_key, start_s, duration_s)?
                .with_ground_truth(plan.replaced_ground_truth());
            if let Some(partner) = partners.get(camera_key) {
                tracker = tracker.with_partner(log, rig, [camera_key, partner], start_s, duration_s)?;
            }
            let results = sender.clone();
            let cancelled = Arc::clone(&self.cancelled);
            self.threads.push(spawn(format!("tracker {camera_key}"), move || {
                track_thread(tracker, queues, &results, &cancelled);
            })?);
        }
        Ok(())
    }

    /// Starts a fork from an engine in its state before the fork's first step.
    pub(in crate::session) fn start_fork(
        &mut self,
        run: usize,
        engine: RunEngine,
        history: Arc<History>,
    ) -> Result<(), SessionError> {
        let Some(results) = self.sender.clone() else { return Ok(()) };
        self.threads.push(spawn(format!("fork {run}"), move || {
            let inputs = (history.begin()..).map_while(|step| history.inputs().wait_for(step));
            run_steps(run, engine, inputs, &history, &results);
        })?);
        Ok(())
    }

    /// Closes the engine's own sender: [`Engine::receive`] returns `None` when all runs have ended.
    pub(in crate::session) fn no_more_runs(&mut self) {
        self.sender = None;
    }

    /// Takes the receiver, for a collector thread.
    pub(in crate::session) fn take_receiver(&mut self) -> Option<Receiver<EngineMessage>> {
        self.receiver.take()
    }

    /// Next message; blocks until it is available. `None` when every thread has ended.
    pub(in crate::session) fn receive(&self) -> Option<EngineMessage> {
        self.receiver.as_ref().and_then(|receiver| receiver.recv().ok())
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
        self.sender = None;
        self.receiver = None;
        for thread in self.threads.drain(..) {
            // The panic of a thread has already been reported as a failed run.
            drop(thread.join());
        }
    }
}

fn spawn(name: String, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, SessionError> {
    Builder::new().name(name).spawn(work).map_err(|source| SessionError::Thread { source })
}

/// Sends the camera's step inputs to every run that uses it.
fn track_thread(
    mut tracker: CameraTracker,
    mut queues: Vec<SyncSender<Arc<OwnedStepInput>>>,
    results: &SyncSender<EngineMessage>,
    cancelled: &AtomicBool,
) {
    while !cancelled.load(Ordering::Relaxed) {
        let Some((input, warnings)) = tracker.next_input() else {
            // The receiver is dropped when the session is closed.
            drop(results.send(EngineMessage::Warnings(tracker.remaining_warnings().to_vec())));
            return;
        };
        if !warnings.is_empty() && results.send(EngineMessage::Warnings(warnings)).is_err() {
            return;
        }
        let input = Arc::new(input);
        queues.retain(|queue| queue.send(Arc::clone(&input)).is_ok());
        if queues.is_empty() {
            return;
        }
    }
}

/// Configuration of a run that starts from the plan's calibration of earlier flights, if it has one.
fn config_with_prior(plan: &SessionPlan, spec: &RunSpec) -> Result<EstimatorConfig, SessionError> {
    let config = estimator_config(&plan.rig, spec)?;
    let Some(prior) = &plan.prior else { return Ok(config) };
    let cameras: Vec<&str> = cameras_of_run(&plan.rig, spec)?.iter().map(|camera| camera.key.as_str()).collect();
    let prior = prior.of_run(&spec.label, &cameras, &plan.rig.joint_names(), &config)?;
    Ok(EstimatorConfig { calibration_prior: Some(Arc::new(prior)), ..config })
}

struct RunOverLog {
    run: usize,
    passes: usize,
    config: EstimatorConfig,
    keep_linearization_every: Option<usize>,
    history: Arc<History>,
    results: SyncSender<EngineMessage>,
}

impl RunOverLog {
    /// Runs the passes over the frame sets, stores each set in the history, and reports each step of the last pass.
    fn start(self, mut frames: FrameSets) {
        let history = &self.history;
        let tracked = std::iter::from_fn(|| frames.next().inspect(|input| history.inputs().push(Arc::clone(input))));
        let again = || (0..).map_while(|step| history.inputs().get(step));
        if self.passes == 1 {
            self.last_pass(self.config.clone(), tracked);
            history.inputs().end();
            return;
        }
        let earlier = EarlierPasses { run: self.run, results: &self.results };
        let mut config = earlier.run(1, &self.config, tracked);
        history.inputs().end();
        for number in 2..self.passes {
            config = config.and_then(|config| earlier.run(number, &config, again()));
        }
        match config {
            Ok(config) => self.last_pass(config, again()),
            // The receiver is dropped when the session is closed.
            Err(PassFailure::Closed) => {}
            Err(PassFailure::Failed(reason)) => {
                drop(self.results.send(EngineMessage::Finished {
                    run: self.run,
                    error: Some(reason),
                    posterior: None,
                }));
            }
        }
    }

    fn last_pass(&self, config: EstimatorConfig, inputs: impl Iterator<Item = Arc<OwnedStepInput>>) {
        let engine = RunEngine::new(config, self.keep_linearization_every);
        run_steps(self.run, engine, inputs, &self.history, &self.results);
    }
}

/// Computes and reports a step for each input.
fn run_steps(
    run: usize,
    mut engine: RunEngine,
    inputs: impl Iterator<Item = Arc<OwnedStepInput>>,
    history: &History,
    results: &SyncSender<EngineMessage>,
) {
    let mut error = None;
    let kept: Arc<dyn KeptTracks> = Arc::clone(history.inputs()) as _;
    for (step, input) in (history.begin()..).zip(inputs) {
        history.before_step(step, &engine);
        let mut record = match guarded(input.stamp_ns, || engine.step(&input)) {
            Ok(record) => record,
            Err(reason) => {
                error = Some(reason);
                break;
            }
        };
        record.keep_tracks_in(&kept, step);
        if results.send(EngineMessage::Step { run, record: Box::new(record) }).is_err() {
            // The receiver is dropped when the session is closed.
            return;
        }
    }
    let posterior = engine.estimator().posterior().map(Arc::new);
    drop(results.send(EngineMessage::Finished { run, error, posterior }));
}
