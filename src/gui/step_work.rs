//! Something about one step that takes a while to compute from its report: on a thread of its own, or while the caller
//! waits. No estimator runs here: what needs one is requested from the session by a command.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread::Builder;
use std::time::Duration;

use crate::session::StepRecord;

/// How often it is worth a look whether it has come.
pub(super) const REPAINT: Duration = Duration::from_millis(50);

/// What was worked out about the step that was asked for last.
#[derive(Debug)]
pub(super) struct StepWork<T> {
    known: Option<(Arc<StepRecord>, Option<T>)>,
    coming: Option<(Arc<StepRecord>, Receiver<Option<T>>)>,
}

impl<T> Default for StepWork<T> {
    fn default() -> Self {
        Self { known: None, coming: None }
    }
}

impl<T: Send + 'static> StepWork<T> {
    /// Whether a step's has been worked out.
    pub(super) fn is_known(&self, step: &StepRecord) -> bool {
        self.known.as_ref().is_some_and(|(known, _)| std::ptr::eq(Arc::as_ptr(known), step))
    }

    /// Whether something is still to come.
    pub(super) fn is_busy(&self) -> bool {
        self.coming.is_some()
    }

    /// Sees to it that a step's comes: begins with what `work` hands over unless that is under way or done, and takes what
    /// has come.
    pub(super) fn ask<W>(
        &mut self,
        step: &Arc<StepRecord>,
        thread_name: &str,
        in_background: bool,
        work: impl FnOnce() -> W,
    ) where
        W: Fn() -> Option<T> + Clone + Send + 'static,
    {
        if self.is_known(step) {
            return;
        }
        if !self.coming.as_ref().is_some_and(|(asked, _)| Arc::ptr_eq(asked, step)) {
            self.coming = Some((Arc::clone(step), begun(thread_name, in_background, work())));
        }
        self.receive();
    }

    /// Takes what has come of the step that was asked for last.
    pub(super) fn receive(&mut self) {
        let Some((_, coming)) = &self.coming else { return };
        let result = match coming.try_recv() {
            Err(TryRecvError::Empty) => return,
            told => told.ok().flatten(),
        };
        self.known = self.coming.take().map(|(step, _)| (step, result));
    }

    /// The step that was worked out last, with what came of it.
    pub(super) fn last(&self) -> Option<(&Arc<StepRecord>, Option<&T>)> {
        self.known.as_ref().map(|(step, result)| (step, result.as_ref()))
    }
}

fn begun<T, W>(thread_name: &str, in_background: bool, work: W) -> Receiver<Option<T>>
where
    T: Send + 'static,
    W: Fn() -> Option<T> + Clone + Send + 'static,
{
    let (sender, receiver) = channel();
    let (later, given) = (sender.clone(), work.clone());
    let background = move || drop(later.send(given()));
    if !(in_background && Builder::new().name(thread_name.to_owned()).spawn(background).is_ok()) {
        // Nobody else has the receiver.
        drop(sender.send(work()));
    }
    receiver
}
