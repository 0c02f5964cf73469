//! The threads of a session: one tracker per camera, one estimator per run, results in order over one channel.
//!
//! Every run is computed on its own thread from its own copy of the tracks, so what comes out does not depend on how the
//! threads are scheduled. A run that watches two cameras is fed by two trackers, each on its own thread.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};

use super::computation::Computation;
use super::configuration::estimator_config;
use super::history::History;
use super::run_engine::RunEngine;
use super::step_inputs::Material;
use super::synchronized_frames::Instants;
use super::tracker::{CameraTracker, TrackedSensorFrame};
use crate::flight_log::LogWarning;
use crate::session::plan::{SessionError, SessionPlan, cameras_of_run};
use crate::session::record::StepRecord;

/// Frames that may wait between the tracker and an estimator.
const QUEUED_FRAMES: usize = 8;
/// Steps that may wait for whoever collects them.
const QUEUED_STEPS: usize = 64;

/// What the threads report.
#[derive(Debug)]
pub(in crate::session) enum EngineMessage {
    /// A run has done a step.
    Step {
        /// Number of the run.
        run: usize,
        /// The step.
        record: Box<StepRecord>,
    },
    /// A run has reached the end of the log, or failed for a reason that no restart cures.
    Finished {
        /// Number of the run.
        run: usize,
        /// Why it ended early.
        error: Option<String>,
    },
    /// The log has something wrong with it.
    Warnings(Vec<LogWarning>),
}

/// Running threads; dropping it stops them.
#[derive(Debug)]
pub(in crate::session) struct Engine {
    sender: Option<SyncSender<EngineMessage>>,
    receiver: Option<Receiver<EngineMessage>>,
    cancelled: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Default for Engine {
    fn default() -> Self {
        let (sender, receiver) = sync_channel(QUEUED_STEPS);
        Self {
            sender: Some(sender),
            receiver: Some(receiver),
            cancelled: Arc::new(AtomicBool::new(false)),
            threads: Vec::new(),
        }
    }
}

impl Engine {
    /// Starts every run of the plan; each keeps its way in the history of its record.
    pub(in crate::session) fn start(plan: &SessionPlan, computation: &Computation) -> Result<Self, SessionError> {
        let mut engine = Self::default();
        engine.start_runs(plan, computation, &(0..plan.runs.len()).collect::<Vec<_>>())?;
        Ok(engine)
    }

    /// Starts the given runs of the plan from the begin of the log; runs that watch the same camera share one tracker.
    pub(in crate::session) fn start_runs(
        &mut self,
        plan: &SessionPlan,
        computation: &Computation,
        runs: &[usize],
    ) -> Result<(), SessionError> {
        let Some(sender) = self.sender.clone() else { return Ok(()) };
        let mut queues: BTreeMap<&str, Vec<SyncSender<Arc<TrackedSensorFrame>>>> = BTreeMap::new();
        for &run in runs {
            let (spec, _) = &plan.runs[run];
            let mut frames = Vec::new();
            for camera in cameras_of_run(&plan.rig, spec)?.iter() {
                let (queue, receiver) = sync_channel(QUEUED_FRAMES);
                queues.entry(&camera.key).or_default().push(queue);
                frames.push((camera.key.clone(), receiver));
            }
            let mut config = estimator_config(&plan.rig, spec)?;
            if let Some(change) = plan.changes.get(run) {
                change(&mut config);
            }
            let engine = RunEngine::new(config, plan.keep_linearization_every);
            let results = sender.clone();
            let Some(history) = computation.history(run).cloned() else { continue };
            self.threads.push(spawn(format!("estimator {run}"), move || {
                run_thread(run, engine, Instants::new(frames), &history, &results);
            })?);
        }
        for (camera_key, queues) in queues {
            let tracker =
                CameraTracker::new(Arc::clone(&plan.log), &plan.rig, camera_key, plan.start_s, plan.duration_s)?;
            let results = sender.clone();
            let cancelled = Arc::clone(&self.cancelled);
            self.threads.push(spawn(format!("tracker {camera_key}"), move || {
                track_thread(tracker, queues, &results, &cancelled);
            })?);
        }
        Ok(())
    }

    /// Starts a fork from an engine as it is before the first step of its history.
    pub(in crate::session) fn start_fork(
        &mut self,
        run: usize,
        engine: RunEngine,
        history: Arc<History>,
    ) -> Result<(), SessionError> {
        let Some(results) = self.sender.clone() else { return Ok(()) };
        self.threads.push(spawn(format!("fork {run}"), move || {
            let materials = (history.begin()..).map_while(|step| history.materials().wait_for(step));
            run_steps(run, engine, materials.map(Ok), &history, &results);
        })?);
        Ok(())
    }

    /// Lets go of the engine's own end of the channel: once all runs are done, [`Engine::receive`] returns `None`.
    pub(in crate::session) fn no_more_runs(&mut self) {
        self.sender = None;
    }

    /// Takes the receiving end, for a collecting thread of one's own.
    pub(in crate::session) fn take_receiver(&mut self) -> Option<Receiver<EngineMessage>> {
        self.receiver.take()
    }

    /// The next message; waits for it. `None` when every thread has ended.
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
            // A thread that panicked has already reported its run as failed.
            drop(thread.join());
        }
    }
}

fn spawn(name: String, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, SessionError> {
    Builder::new().name(name).spawn(work).map_err(|source| SessionError::Thread { source })
}

/// Feeds the tracked frames to every estimator of the camera.
fn track_thread(
    mut tracker: CameraTracker,
    mut queues: Vec<SyncSender<Arc<TrackedSensorFrame>>>,
    results: &SyncSender<EngineMessage>,
    cancelled: &AtomicBool,
) {
    while !cancelled.load(Ordering::Relaxed) {
        let Some(tracked) = tracker.next_frame() else {
            // Nobody listens any more when the session was closed.
            drop(results.send(EngineMessage::Warnings(tracker.remaining_warnings().to_vec())));
            return;
        };
        if !tracked.frame.warnings.is_empty()
            && results.send(EngineMessage::Warnings(tracked.frame.warnings.clone())).is_err()
        {
            return;
        }
        let tracked = Arc::new(tracked);
        queues.retain(|queue| queue.send(Arc::clone(&tracked)).is_ok());
        if queues.is_empty() {
            return;
        }
    }
}

/// Steps one estimator over the instants that come, keeps what each brings, and reports each step.
fn run_thread(
    run: usize,
    engine: RunEngine,
    mut instants: Instants,
    history: &History,
    results: &SyncSender<EngineMessage>,
) {
    let materials = std::iter::from_fn(|| match instants.next() {
        Ok(instant) => instant.map(|instant| {
            let material = Arc::new(Material::of(&instant));
            history.materials().push(Arc::clone(&material));
            Ok(material)
        }),
        Err(reason) => Some(Err(reason.to_string())),
    });
    run_steps(run, engine, materials, history, results);
    history.materials().end();
}

/// Takes a step with all material that comes, and reports each.
fn run_steps(
    run: usize,
    mut engine: RunEngine,
    materials: impl Iterator<Item = Result<Arc<Material>, String>>,
    history: &History,
    results: &SyncSender<EngineMessage>,
) {
    let mut error = None;
    for (step, material) in (history.begin()..).zip(materials) {
        let material = match material {
            Ok(material) => material,
            Err(reason) => {
                error = Some(reason);
                break;
            }
        };
        history.before_step(step, &engine, &material);
        let Ok(record) = catch_unwind(AssertUnwindSafe(|| engine.step(&material))) else {
            let time_s = crate::geometry::seconds_from_ns(material.stamp_ns);
            error = Some(format!("internal error in the estimator at {time_s:.3} s; please report it with the log"));
            break;
        };
        if results.send(EngineMessage::Step { run, record: Box::new(record) }).is_err() {
            // Nobody listens any more when the session was closed.
            return;
        }
    }
    drop(results.send(EngineMessage::Finished { run, error }));
}
