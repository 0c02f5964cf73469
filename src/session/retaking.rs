//! A thread that takes steps again which somebody looks at: outlined ones, and what the solver went through in one.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use super::history::History;
use super::plan::SessionError;
use super::recording::StepRecord;

/// Steps before a wanted one that are taken again with it, because people step back.
const STEPS_AT_ONCE: usize = 32;

/// What of a step is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Detail {
    /// Everything that it left.
    Whole,
    /// The states that the solver went through.
    Iterations,
}

/// A step to be taken again.
#[derive(Clone, Debug)]
pub(super) struct Wish {
    /// [`RunRecord::id`](super::RunRecord::id).
    pub(super) run: u64,
    /// How the run came there.
    pub(super) history: Arc<History>,
    /// Number of the step.
    pub(super) step: usize,
    /// What of it.
    pub(super) detail: Detail,
}

impl PartialEq for Wish {
    fn eq(&self, other: &Self) -> bool {
        (self.run, self.step, self.detail) == (other.run, other.step, other.detail)
    }
}

/// What has been taken again.
#[derive(Debug)]
pub(super) enum Retaken {
    /// Steps with their numbers.
    Whole(Vec<(usize, StepRecord)>),
    /// The states of one step.
    Iterations(Vec<StepRecord>),
}

#[derive(Debug, Default)]
struct Queue {
    waiting: VecDeque<Wish>,
    working: Option<Wish>,
    closed: bool,
}

#[derive(Debug, Default)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // Wishes are only ever put in and taken out whole.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The thread; dropping it ends it after the wish that it works on.
#[derive(Debug)]
pub(super) struct Retaking {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Retaking {
    /// Starts the thread, which hands over what it has taken again.
    pub(super) fn start(mut deliver: impl FnMut(&Wish, Retaken) + Send + 'static) -> Result<Self, SessionError> {
        let shared = Arc::new(Shared::default());
        let seen = Arc::clone(&shared);
        let work = move || {
            loop {
                let ready = seen.changed.wait_while(seen.lock(), |queue| queue.waiting.is_empty() && !queue.closed);
                let mut queue = ready.unwrap_or_else(PoisonError::into_inner);
                if queue.closed {
                    return;
                }
                queue.working = queue.waiting.pop_front();
                let Some(wish) = queue.working.clone() else { continue };
                drop(queue);
                let retaken = match wish.detail {
                    Detail::Whole => Retaken::Whole(wish.history.retake(wish.step, STEPS_AT_ONCE)),
                    Detail::Iterations => Retaken::Iterations(wish.history.iterations(wish.step)),
                };
                deliver(&wish, retaken);
                seen.lock().working = None;
                seen.changed.notify_all();
            }
        };
        let thread = Builder::new().name("retaking".to_owned()).spawn(work);
        Ok(Self { shared, thread: Some(thread.map_err(|source| SessionError::Thread { source })?) })
    }

    /// From now on these are wanted, and nothing else.
    pub(super) fn want(&self, wishes: Vec<Wish>) {
        let mut queue = self.shared.lock();
        queue.waiting = wishes.into_iter().filter(|wish| queue.working.as_ref() != Some(wish)).collect();
        drop(queue);
        self.shared.changed.notify_all();
    }

    /// Waits until everything that was wanted has been handed over.
    pub(super) fn settle(&self) {
        let busy = |queue: &mut Queue| !queue.closed && (queue.working.is_some() || !queue.waiting.is_empty());
        drop(self.shared.changed.wait_while(self.shared.lock(), busy));
    }

    /// Whether something is being taken again.
    pub(super) fn is_busy(&self) -> bool {
        let queue = self.shared.lock();
        queue.working.is_some() || !queue.waiting.is_empty()
    }
}

impl Drop for Retaking {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}
