//! Diagnosis of a run while it is played, on a thread of its own.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};

use parking_lot::Mutex;
use rayon::ThreadPoolBuilder;

use crate::session::diagnosis::{LogFaults, TRIALS_S, diagnose};
use crate::session::engine::Computation;
use crate::session::plan::SessionError;
use crate::session::record::Diagnosis;

/// Progress of a diagnosis; its result is [`RunRecord::diagnosis`](crate::session::RunRecord::diagnosis).
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosisProgress {
    /// [`RunRecord::id`](crate::session::RunRecord::id) of the run.
    pub run: u64,
    /// From 0 to 1.
    pub ratio: f64,
    /// The change that was tried last.
    pub label: String,
}

/// A diagnosis on its thread. Dropping it ends it.
#[derive(Debug)]
pub(super) struct BackgroundDiagnosis {
    progress: Arc<Mutex<DiagnosisProgress>>,
    cancelled: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl BackgroundDiagnosis {
    /// Starts the diagnosis of run number `run` of a computation, on all cores but one; `store` gets its result.
    pub(super) fn start(
        computation: Computation,
        run: usize,
        store: impl FnOnce(Diagnosis) + Send + 'static,
    ) -> Result<Self, SessionError> {
        let id = computation.recording().runs.get(run).map_or(0, |run| run.id);
        let progress = Arc::new(Mutex::new(DiagnosisProgress { run: id, ratio: 0.0, label: String::new() }));
        let cancelled = Arc::new(AtomicBool::new(false));
        let (shared, stop) = (Arc::clone(&progress), Arc::clone(&cancelled));
        let work = move || {
            let mut on_progress = |ratio: f64, label: &str| {
                let mut progress = shared.lock();
                (progress.ratio, progress.label) = (ratio, label.to_owned());
                if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let checked = computation.recording().check.as_deref();
            let faults = checked.map_or_else(LogFaults::default, |findings| LogFaults::among(findings));
            if let Some(found) = diagnose(&computation, run, &faults, TRIALS_S, &mut on_progress) {
                store(found);
            }
        };
        let threads = std::thread::available_parallelism().map_or(1, |cores| cores.get().saturating_sub(1).max(1));
        let apart = move || match ThreadPoolBuilder::new().num_threads(threads).build() {
            Ok(pool) => pool.install(work),
            Err(_no_threads) => work(),
        };
        let thread = Builder::new().name("diagnosis".to_owned()).spawn(apart);
        Ok(Self { progress, cancelled, thread: Some(thread.map_err(|source| SessionError::Thread { source })?) })
    }

    /// Progress; `None` when the diagnosis has ended.
    pub(super) fn progress(&self) -> Option<DiagnosisProgress> {
        let is_running = self.thread.as_ref().is_some_and(|thread| !thread.is_finished());
        is_running.then(|| self.progress.lock().clone())
    }

    /// Ends it after the changes that are being tried, with what is known so far.
    pub(super) fn stop(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

impl Drop for BackgroundDiagnosis {
    fn drop(&mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported on standard error.
            drop(thread.join());
        }
    }
}
