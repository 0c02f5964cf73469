//! Diagnosis of a run while it is played, on a thread of its own.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};

use parking_lot::Mutex;
use rayon::ThreadPoolBuilder;

use crate::session::diagnosis::{Diagnosis, LogFaults, diagnose};
use crate::session::engine::Computation;
use crate::session::plan::SessionError;

/// Progress of a diagnosis, and its result.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosisProgress {
    /// [`RunRecord::id`](crate::session::RunRecord::id) of the run.
    pub run: u64,
    /// From 0 to 1.
    pub ratio: f64,
    /// The change that was tried last.
    pub label: String,
    /// `None` until the diagnosis has ended.
    pub result: Option<Arc<Diagnosis>>,
}

/// A diagnosis on its thread. Dropping it ends it.
#[derive(Debug)]
pub(super) struct BackgroundDiagnosis {
    progress: Arc<Mutex<DiagnosisProgress>>,
    cancelled: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl BackgroundDiagnosis {
    /// Starts the diagnosis of run number `run` of a computation, on all cores but one.
    pub(super) fn start(computation: Computation, run: usize) -> Result<Self, SessionError> {
        let id = computation.recording().runs.get(run).map_or(0, |run| run.id);
        let progress =
            Arc::new(Mutex::new(DiagnosisProgress { run: id, ratio: 0.0, label: String::new(), result: None }));
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
            let found = diagnose(&computation, run, &faults, &mut on_progress);
            let mut progress = shared.lock();
            (progress.ratio, progress.result) = (1.0, found.map(Arc::new));
        };
        let threads = std::thread::available_parallelism().map_or(1, |cores| cores.get().saturating_sub(1).max(1));
        let apart = move || match ThreadPoolBuilder::new().num_threads(threads).build() {
            Ok(pool) => pool.install(work),
            Err(_no_threads) => work(),
        };
        let thread = Builder::new().name("diagnosis".to_owned()).spawn(apart);
        Ok(Self { progress, cancelled, thread: Some(thread.map_err(|source| SessionError::Thread { source })?) })
    }

    pub(super) fn progress(&self) -> DiagnosisProgress {
        self.progress.lock().clone()
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
