//! The computation of a session, shared between the collector thread and its readers.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::{Builder, JoinHandle};

use parking_lot::Mutex;

use crate::session::engine::{Computation, EngineMessage, RecomputeRequest, Recomputed};
use crate::session::plan::SessionError;
use crate::session::record::Recording;

#[derive(Debug)]
struct State {
    computation: Mutex<Computation>,
    generation: AtomicU64,
}

impl State {
    fn change(&self, change: impl FnOnce(&mut Computation)) {
        change(&mut self.computation.lock());
        self.generation.fetch_add(1, Ordering::Release);
    }
}

/// A computation behind a mutex that is locked only for a change or a copy.
#[derive(Debug)]
pub(super) struct SharedComputation {
    state: Arc<State>,
    collector: Option<JoinHandle<()>>,
}

impl SharedComputation {
    pub(super) fn new(computation: Computation) -> Self {
        let state = State { computation: Mutex::new(computation), generation: AtomicU64::new(1) };
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

    /// A function for the recompute thread that stores its results.
    pub(super) fn receiver_of_recomputed(&self) -> impl FnMut(&RecomputeRequest, Recomputed) + Send + 'static {
        let state = Arc::clone(&self.state);
        move |request, recomputed| state.change(|computation| computation.add_recomputed(request, recomputed))
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
