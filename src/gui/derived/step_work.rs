//! Slow computation from the report of one step, on another thread or while the caller waits. No estimator runs here;
//! results of an estimator are requested from the session by a command.

use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, OnceLock};
use std::thread::Builder;
use std::time::Duration;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::session::StepRecord;

/// Period at which the window checks for the result.
pub(in crate::gui) const REPAINT: Duration = Duration::from_millis(50);

/// The result for the step that was requested last.
#[derive(Debug)]
pub(in crate::gui) struct StepWork<T> {
    known: Option<(Arc<StepRecord>, Option<T>)>,
    coming: Option<Coming<T>>,
}

/// Result that is being computed.
#[derive(Debug)]
struct Coming<T> {
    step: Arc<StepRecord>,
    result: Receiver<Option<T>>,
    /// Work that has not begun when this is dropped is left out: on one thread the work of many steps would queue up.
    _wanted: Arc<()>,
}

impl<T> Default for StepWork<T> {
    fn default() -> Self {
        Self { known: None, coming: None }
    }
}

impl<T: Send + 'static> StepWork<T> {
    pub(in crate::gui) fn has_result(&self, step: &StepRecord) -> bool {
        self.known.as_ref().is_some_and(|(known, _)| std::ptr::eq(Arc::as_ptr(known), step))
    }

    pub(in crate::gui) fn is_busy(&self) -> bool {
        self.coming.is_some()
    }

    /// Starts the computation `work` for a step unless it is running or done, and receives finished results.
    pub(in crate::gui) fn request<W>(
        &mut self,
        step: &Arc<StepRecord>,
        thread_name: &str,
        in_background: bool,
        work: impl FnOnce() -> W,
    ) where
        W: Fn() -> Option<T> + Clone + Send + 'static,
    {
        if self.has_result(step) {
            return;
        }
        if !self.coming.as_ref().is_some_and(|coming| Arc::ptr_eq(&coming.step, step)) {
            let wanted = Arc::new(());
            let result = started(thread_name, in_background, &wanted, work());
            self.coming = Some(Coming { step: Arc::clone(step), result, _wanted: wanted });
        }
        self.receive();
    }

    /// Receives the result for the step that was requested last.
    pub(in crate::gui) fn receive(&mut self) {
        let Some(coming) = &self.coming else { return };
        let result = match coming.result.try_recv() {
            Err(TryRecvError::Empty) => return,
            received => received.ok().flatten(),
        };
        self.known = self.coming.take().map(|coming| (coming.step, result));
    }

    /// The step that was computed last, with its result.
    pub(in crate::gui) fn last(&self) -> Option<(&Arc<StepRecord>, Option<&T>)> {
        self.known.as_ref().map(|(step, result)| (step, result.as_ref()))
    }
}

fn started<T, W>(thread_name: &str, in_background: bool, wanted: &Arc<()>, work: W) -> Receiver<Option<T>>
where
    T: Send + 'static,
    W: Fn() -> Option<T> + Clone + Send + 'static,
{
    let (sender, receiver) = channel();
    let (later, given, wanted) = (sender.clone(), work.clone(), Arc::downgrade(wanted));
    let background = move || drop(later.send(apart(move || wanted.upgrade().and_then(|_| given()))));
    if !(in_background && Builder::new().name(thread_name.to_owned()).spawn(background).is_ok()) {
        // Cannot fail: the receiver is returned below.
        drop(sender.send(work()));
    }
    receiver
}

/// Runs work on a separate rayon thread, so that painting never waits for one of its tasks.
fn apart<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    static APART: OnceLock<Option<ThreadPool>> = OnceLock::new();
    let pool = APART.get_or_init(|| ThreadPoolBuilder::new().num_threads(1).build().ok());
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_in_the_background_leaves_the_other_threads_to_the_painter() {
        assert_eq!(apart(rayon::current_num_threads), 1);
        // Its parallel tasks stay on that thread, too.
        let names = apart(|| rayon::join(rayon::current_thread_index, rayon::current_thread_index));
        assert_eq!(names, (Some(0), Some(0)));
    }
}
