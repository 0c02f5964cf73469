//! Check of the log and its rig while runs are computed, on a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;
use std::time::Duration;

use rayon::ThreadPoolBuilder;

use crate::flight_log::FlightLog;
use crate::log_check::{self, Finding};
use crate::sensors::Rig;
use crate::session::engine::image_rotations;
use crate::session::plan::SessionError;

/// Time between two looks for the first step of a run, before which the check does not begin.
const WAIT: Duration = Duration::from_millis(50);

/// A check on its thread. Dropping it discards its result; the thread ends after the part that it computes.
#[derive(Debug)]
pub(super) struct BackgroundCheck {
    cancelled: Arc<AtomicBool>,
}

impl BackgroundCheck {
    /// Starts the check on one core as soon as `has_begun`, so that it delays no first image; `store` gets the findings.
    pub(super) fn start(
        log: Arc<FlightLog>,
        rig: Arc<Rig>,
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
            let checked = || {
                let rotations = image_rotations(&log, &rig);
                (!is_cancelled()).then(|| log_check::check(&log, Ok(&rig), &rotations).findings)
            };
            let found = match ThreadPoolBuilder::new().num_threads(1).build() {
                Ok(pool) => pool.install(checked),
                Err(_no_threads) => checked(),
            };
            if let Some(findings) = found.filter(|_| !is_cancelled()) {
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
