//! Check of the log and its rig while runs are computed, on a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;
use std::time::Duration;

use rayon::ThreadPoolBuilder;

use crate::log_check::Finding;
use crate::session::plan::SessionError;

/// Time between two looks for the first step of a run, before which the check does not begin.
const WAIT: Duration = Duration::from_millis(50);

/// A check on its thread. Dropping it discards its result; a check that has begun goes on to its end.
#[derive(Debug)]
pub(super) struct BackgroundCheck {
    cancelled: Arc<AtomicBool>,
}

impl BackgroundCheck {
    /// Starts `check` on one core as soon as `has_begun`, so that it delays no first image; `store` gets its findings.
    pub(super) fn start(
        check: impl FnOnce() -> Vec<Finding> + Send + 'static,
        has_begun: impl Fn() -> bool + Send + 'static,
        store: impl FnOnce(Vec<Finding>) + Send + 'static,
    ) -> Result<Self, SessionError> {
        let cancelled = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&cancelled);
        let is_cancelled = move || stop.load(Ordering::Relaxed);
        let work = move || {
            while !has_begun() {
                if is_cancelled() {
                    return;
                }
                std::thread::sleep(WAIT);
            }
            let findings = match ThreadPoolBuilder::new().num_threads(1).build() {
                Ok(pool) => pool.install(check),
                Err(_no_threads) => check(),
            };
            if !is_cancelled() {
                store(findings);
            }
        };
        // The handle is not kept: a window that closes a log does not wait for its check.
        let thread = Builder::new().name("check".to_owned()).spawn(work);
        thread.map_err(|source| SessionError::Thread { source })?;
        Ok(Self { cancelled })
    }
}

impl Drop for BackgroundCheck {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}
