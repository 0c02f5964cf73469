//! A thread that recomputes steps at the cursor: steps of which only the summary is kept, solver states and factor
//! rows.

use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use parking_lot::{Condvar, Mutex};

use super::history::History;
use crate::estimator::FactorRows;
use crate::session::plan::SessionError;
use crate::session::record::{SolverPosition, StepRecord};

/// Number of steps that are recomputed in advance: before the cursor, or after it during playback.
pub(in crate::session) const STEPS_AT_ONCE: usize = 32;

/// Delay before prefetching, so that the window can first draw the delivered steps without competing for a processor.
const PREFETCHED_AFTER: Duration = Duration::from_millis(80);

/// The requested data of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::session) enum Detail {
    Step,
    /// States of the solver; the position selects the state that is shown.
    SolverStates(SolverPosition),
    /// The linearized rows of the factors other than reprojection.
    FactorRows,
}

#[derive(Clone, Debug)]
pub(in crate::session) struct RecomputeRequest {
    /// Id of the run, [`RunRecord::id`](crate::session::RunRecord::id).
    pub(in crate::session) run: u64,
    pub(in crate::session) history: Arc<History>,
    pub(in crate::session) step: usize,
    /// Number of complete records requested: this step and those before it.
    pub(in crate::session) count: usize,
    pub(in crate::session) detail: Detail,
    /// True for a prefetch, which a request at the cursor cancels.
    pub(in crate::session) prefetch: bool,
}

/// Two requests are equal if they need the same computation, regardless of the solver state that is shown.
impl PartialEq for RecomputeRequest {
    fn eq(&self, other: &Self) -> bool {
        let detail = std::mem::discriminant(&self.detail) == std::mem::discriminant(&other.detail);
        (self.run, self.step) == (other.run, other.step) && detail
    }
}

#[derive(Debug)]
pub(in crate::session) enum Recomputed {
    /// Steps with their indices.
    Steps(Vec<(usize, StepRecord)>),
    SolverStates(Vec<StepRecord>),
    /// The factor rows of one step, `None` where it has none.
    FactorRows(Option<Vec<FactorRows>>),
}

#[derive(Debug, Default)]
struct Queue {
    waiting: VecDeque<RecomputeRequest>,
    working: Option<RecomputeRequest>,
    /// True if the request in progress is still requested.
    working_wanted: bool,
    closed: bool,
}

impl Queue {
    /// True if the request in progress is still requested and, if it is a prefetch, no request at the cursor waits.
    fn is_wanted(&self) -> bool {
        let at_cursor = self.working.as_ref().is_some_and(|working| !working.prefetch);
        let others = self.waiting.iter().any(|waiting| !waiting.prefetch);
        !self.closed && self.working_wanted && (at_cursor || !others)
    }

    fn has_work_at_cursor(&self) -> bool {
        self.working.iter().chain(&self.waiting).any(|request| !request.prefetch)
    }
}

#[derive(Debug, Default)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

/// The recompute thread. Dropping it ends the thread after the request in progress.
#[derive(Debug)]
pub(in crate::session) struct RecomputeThread {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl RecomputeThread {
    /// Starts the thread, which passes every result to `deliver`.
    pub(in crate::session) fn start(
        mut deliver: impl FnMut(&RecomputeRequest, Recomputed) + Send + 'static,
    ) -> Result<Self, SessionError> {
        let shared = Arc::new(Shared::default());
        let seen = Arc::clone(&shared);
        let work = move || {
            loop {
                let mut queue = seen.queue.lock();
                seen.changed.wait_while(&mut queue, |queue| queue.waiting.is_empty() && !queue.closed);
                if !queue.has_work_at_cursor() && !queue.closed {
                    seen.changed.wait_for(&mut queue, PREFETCHED_AFTER);
                }
                if queue.closed {
                    return;
                }
                queue.working = queue.waiting.pop_front();
                queue.working_wanted = true;
                let Some(request) = queue.working.clone() else { continue };
                drop(queue);
                let recomputed = match request.detail {
                    Detail::Step => {
                        let wanted = || seen.queue.lock().is_wanted();
                        Recomputed::Steps(request.history.recompute_while(request.step, request.count, &wanted))
                    }
                    Detail::SolverStates(_) => Recomputed::SolverStates(request.history.solver_states(request.step)),
                    Detail::FactorRows => Recomputed::FactorRows(request.history.factor_rows(request.step)),
                };
                // The shown solver state may have changed meanwhile.
                let request = seen.queue.lock().working.clone().unwrap_or(request);
                deliver(&request, recomputed);
                seen.queue.lock().working = None;
                seen.changed.notify_all();
            }
        };
        let thread = Builder::new().name("recompute".to_owned()).spawn(work);
        Ok(Self { shared, thread: Some(thread.map_err(|source| SessionError::Thread { source })?) })
    }

    /// Replaces all requests by `requests`, in this order.
    pub(in crate::session) fn request(&self, requests: Vec<RecomputeRequest>) {
        let mut queue = self.shared.queue.lock();
        queue.waiting.clear();
        let mut working_wanted = false;
        for request in requests {
            match &mut queue.working {
                // The cursor may have reached a prefetched step meanwhile.
                Some(working) if *working == request => {
                    working.prefetch = request.prefetch;
                    working.detail = request.detail;
                    working_wanted = true;
                }
                _ => queue.waiting.push_back(request),
            }
        }
        queue.working_wanted = working_wanted;
        drop(queue);
        self.shared.changed.notify_all();
    }

    /// Waits until all results for the cursor have been delivered.
    pub(in crate::session) fn settle(&self) {
        let mut queue = self.shared.queue.lock();
        self.shared.changed.wait_while(&mut queue, |queue| !queue.closed && queue.has_work_at_cursor());
    }

    /// As [`Self::settle`], but waits at most `time`.
    pub(in crate::session) fn settle_within(&self, time: Duration) {
        let mut queue = self.shared.queue.lock();
        let waits = |queue: &mut Queue| !queue.closed && queue.has_work_at_cursor();
        self.shared.changed.wait_while_for(&mut queue, waits, time);
    }

    /// True if a request at the cursor is waiting or in progress.
    pub(in crate::session) fn is_busy(&self) -> bool {
        self.shared.queue.lock().has_work_at_cursor()
    }
}

impl Drop for RecomputeThread {
    fn drop(&mut self) {
        self.shared.queue.lock().closed = true;
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
    fn requests_at_the_cursor_cancel_a_prefetch() {
        let history = Arc::new(History::new(0));
        let request = |step, prefetch| RecomputeRequest {
            run: 1,
            history: Arc::clone(&history),
            step,
            count: 1,
            detail: Detail::Step,
            prefetch,
        };
        let mut queue = Queue { working: Some(request(7, true)), working_wanted: true, ..Queue::default() };
        assert!(!queue.has_work_at_cursor() && queue.is_wanted());
        // A request at the cursor cancels the prefetch.
        queue.waiting.push_back(request(90, false));
        assert!(queue.has_work_at_cursor() && !queue.is_wanted());
        // The cursor has reached the prefetched step.
        let thread = RecomputeThread {
            shared: Arc::new(Shared { queue: Mutex::new(queue), ..Shared::default() }),
            thread: None,
        };
        thread.request(vec![request(7, false), request(3, true)]);
        let queue = thread.shared.queue.lock();
        assert!(queue.is_wanted() && queue.has_work_at_cursor());
        assert_eq!(queue.waiting.iter().map(|request| request.step).collect::<Vec<_>>(), [3]);
    }
}
