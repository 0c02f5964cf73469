//! The computation of a session, shared between the collector thread and its readers.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::{Builder, JoinHandle};

use parking_lot::Mutex;

use crate::flight_log::FlightLog;
use crate::log_check::CheckReport;
use crate::session::engine::{Computation, EngineMessage, RecomputeRequest, Recomputed};
use crate::session::plan::SessionError;
use crate::session::record::{Diagnosis, Recording, RunRecord};

struct SharedState {
    computation: Mutex<Computation>,
    generation: AtomicU64,
    /// Called when a step at the cursor has been recomputed.
    wake: Mutex<Option<Wake>>,
}

/// Function that requests a new frame from a window, callable from any thread.
pub type Wake = Box<dyn Fn() + Send>;

impl SharedState {
    fn change(&self, change: impl FnOnce(&mut Computation)) {
        change(&mut self.computation.lock());
        self.generation.fetch_add(1, Ordering::Release);
    }
}

/// A computation behind a mutex that is locked only for a change or a copy.
pub(super) struct SharedComputation {
    state: Arc<SharedState>,
    collector: Option<JoinHandle<()>>,
}

impl fmt::Debug for SharedComputation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("SharedComputation").field("generation", &self.generation()).finish_non_exhaustive()
    }
}

impl SharedComputation {
    pub(super) fn new(computation: Computation) -> Self {
        let state =
            SharedState { computation: Mutex::new(computation), generation: AtomicU64::new(1), wake: Mutex::default() };
        Self { state: Arc::new(state), collector: None }
    }

    /// Starts the thread that stores the engine's messages.
    pub(super) fn collect(&mut self, messages: Option<Receiver<EngineMessage>>) -> Result<(), SessionError> {
        let state = Arc::clone(&self.state);
        let work = move || {
            for message in messages.iter().flatten() {
                state.change(|computation| computation.apply(message));
            }
        };
        let collector = Builder::new().name("collector".to_owned()).spawn(work);
        self.collector = Some(collector.map_err(|source| SessionError::Thread { source })?);
        Ok(())
    }

    /// Function for the recompute thread that stores its results.
    pub(super) fn receiver_of_recomputed(&self) -> impl FnMut(&RecomputeRequest, Recomputed) + Send + 'static {
        let state = Arc::clone(&self.state);
        move |request, recomputed| {
            state.change(|computation| computation.add_recomputed(request, recomputed));
            if let Some(wake) = state.wake.lock().as_ref().filter(|_| !request.prefetch) {
                wake();
            }
        }
    }

    /// Two functions: one is true once the check of a log may begin, when a run has a step and the log has ended, and the
    /// other one stores the findings.
    pub(super) fn receiver_of_check(
        &self,
        log: &Arc<FlightLog>,
    ) -> (impl Fn() -> bool + Send + 'static, impl FnOnce(CheckReport) + Send + 'static) {
        let (state, known) = (Arc::clone(&self.state), Arc::clone(&self.state));
        let followed = log.is_followed().then(|| Arc::clone(log));
        if followed.is_none() {
            self.change(Computation::begin_check);
        }
        let has_begun = move || {
            if followed.as_ref().is_some_and(|log| log.end().is_none()) {
                return false;
            }
            let recording = Arc::clone(known.computation.lock().recording());
            // A run without a usable image ends without any step.
            let begins = recording.runs.iter().any(|run| !run.steps.is_empty())
                || recording.runs.iter().all(RunRecord::has_ended);
            if begins && followed.is_some() {
                known.change(Computation::begin_check);
            }
            begins
        };
        let store = move |checked| {
            state.change(|computation| computation.set_check(checked));
            if let Some(wake) = state.wake.lock().as_ref() {
                wake();
            }
        };
        (has_begun, store)
    }

    /// Function that stores the result of a diagnosis of the run with an id.
    pub(super) fn receiver_of_diagnosis(&self, run: u64) -> impl FnOnce(Diagnosis) + Send + 'static {
        let state = Arc::clone(&self.state);
        move |diagnosis| {
            state.change(|computation| computation.set_diagnosis(run, Some(diagnosis)));
            if let Some(wake) = state.wake.lock().as_ref() {
                wake();
            }
        }
    }

    /// Sets the function that is called when a step at the cursor has been recomputed.
    pub(super) fn wake_with(&self, wake: Wake) {
        *self.state.wake.lock() = Some(wake);
    }

    pub(super) fn recording(&self) -> Arc<Recording> {
        Arc::clone(self.state.computation.lock().recording())
    }

    pub(super) fn computation(&self) -> Computation {
        self.state.computation.lock().clone()
    }

    /// A counter that grows with every change.
    pub(super) fn generation(&self) -> u64 {
        self.state.generation.load(Ordering::Acquire)
    }

    pub(super) fn change(&self, change: impl FnOnce(&mut Computation)) {
        self.state.change(change);
    }

    /// Waits for the end of the collector thread.
    pub(super) fn join(&mut self) {
        if let Some(collector) = self.collector.take() {
            drop(collector.join());
        }
    }
}
