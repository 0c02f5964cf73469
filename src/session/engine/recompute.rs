//! A thread that takes steps again which somebody looks at: outlined ones, and what the solver went through in one.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use super::history::History;
use crate::session::plan::SessionError;
use crate::session::record::StepRecord;

/// Steps up to a wanted one that are taken again with it, because people step back.
pub(in crate::session) const STEPS_AT_ONCE: usize = 32;

/// What of a step is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::session) enum Detail {
    /// Everything that it left.
    Whole,
    /// The states that the solver went through.
    Iterations,
}

/// A step to be taken again.
#[derive(Clone, Debug)]
pub(in crate::session) struct Wish {
    /// [`RunRecord::id`](crate::session::RunRecord::id).
    pub(in crate::session) run: u64,
    /// How the run came there.
    pub(in crate::session) history: Arc<History>,
    /// Number of the step.
    pub(in crate::session) step: usize,
    /// What of it.
    pub(in crate::session) detail: Detail,
    /// Whether nobody looks at it yet: it is left when something else is wanted.
    pub(in crate::session) ahead: bool,
}

impl PartialEq for Wish {
    fn eq(&self, other: &Self) -> bool {
        (self.run, self.step, self.detail) == (other.run, other.step, other.detail)
    }
}

/// What has been taken again.
#[derive(Debug)]
pub(in crate::session) enum Retaken {
    /// Steps with their numbers.
    Whole(Vec<(usize, StepRecord)>),
    /// The states of one step.
    Iterations(Vec<StepRecord>),
}

#[derive(Debug, Default)]
struct Queue {
    waiting: VecDeque<Wish>,
    working: Option<Wish>,
    /// Whether what is being worked on is still wanted.
    working_wanted: bool,
    closed: bool,
}

impl Queue {
    /// Whether a wish that is being worked on is still wanted, and nobody waits for anything else.
    fn is_wanted(&self, wish: &Wish) -> bool {
        let looked_at = self.working.as_ref().is_some_and(|working| working == wish && !working.ahead);
        let others = self.waiting.iter().any(|waiting| !waiting.ahead);
        !self.closed && (looked_at || self.working_wanted && !others)
    }

    fn is_looked_for(&self) -> bool {
        self.working.iter().chain(&self.waiting).any(|wish| !wish.ahead)
    }
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
pub(in crate::session) struct Retaking {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Retaking {
    /// Starts the thread, which hands over what it has taken again.
    pub(in crate::session) fn start(
        mut deliver: impl FnMut(&Wish, Retaken) + Send + 'static,
    ) -> Result<Self, SessionError> {
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
                queue.working_wanted = true;
                let Some(wish) = queue.working.clone() else { continue };
                drop(queue);
                let retaken = match wish.detail {
                    Detail::Whole => {
                        let still_wanted = || !wish.ahead || seen.lock().is_wanted(&wish);
                        wish.history.retake_while(wish.step, STEPS_AT_ONCE, &still_wanted).map(Retaken::Whole)
                    }
                    Detail::Iterations => Some(Retaken::Iterations(wish.history.iterations(wish.step))),
                };
                if let Some(retaken) = retaken {
                    deliver(&wish, retaken);
                }
                seen.lock().working = None;
                seen.changed.notify_all();
            }
        };
        let thread = Builder::new().name("retaking".to_owned()).spawn(work);
        Ok(Self { shared, thread: Some(thread.map_err(|source| SessionError::Thread { source })?) })
    }

    /// From now on these are wanted, in this order, and nothing else.
    pub(in crate::session) fn want(&self, wishes: Vec<Wish>) {
        let mut queue = self.shared.lock();
        queue.waiting.clear();
        let mut working_wanted = false;
        for wish in wishes {
            match &mut queue.working {
                // What is made ready beforehand may have come to be looked at meanwhile.
                Some(working) if *working == wish => {
                    working.ahead = wish.ahead;
                    working_wanted = true;
                }
                _ => queue.waiting.push_back(wish),
            }
        }
        queue.working_wanted = working_wanted;
        drop(queue);
        self.shared.changed.notify_all();
    }

    /// Waits until everything that somebody looks at has been handed over.
    pub(in crate::session) fn settle(&self) {
        drop(self.shared.changed.wait_while(self.shared.lock(), |queue| !queue.closed && queue.is_looked_for()));
    }

    /// Whether something is being taken again that somebody looks at.
    pub(in crate::session) fn is_busy(&self) -> bool {
        self.shared.lock().is_looked_for()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_looks_at_yet_keeps_nobody_waiting() {
        let history = Arc::new(History::new(0));
        let wish = |step, ahead| Wish { run: 1, history: Arc::clone(&history), step, detail: Detail::Whole, ahead };
        let mut queue = Queue { working: Some(wish(7, true)), working_wanted: true, ..Queue::default() };
        assert!(!queue.is_looked_for() && queue.is_wanted(&wish(7, true)));
        // Something else is looked at: the work ahead is left.
        queue.waiting.push_back(wish(90, false));
        assert!(queue.is_looked_for() && !queue.is_wanted(&wish(7, true)));
        // The work ahead itself has come to be looked at.
        let retaking =
            Retaking { shared: Arc::new(Shared { queue: Mutex::new(queue), ..Shared::default() }), thread: None };
        retaking.want(vec![wish(7, false), wish(3, true)]);
        let queue = retaking.shared.lock();
        assert!(queue.is_wanted(&wish(7, true)) && queue.is_looked_for());
        assert_eq!(queue.waiting.iter().map(|wish| wish.step).collect::<Vec<_>>(), [3]);
    }
}
