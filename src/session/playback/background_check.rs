//! Check of the log and its rig while runs are computed, on a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;
use std::time::Duration;

use rayon::ThreadPoolBuilder;

use crate::log_check::CheckReport;
use crate::session::plan::SessionError;

/// Time between two looks for the first step of a run, before which the check does not begin.
const WAIT: Duration = Duration::from_millis(50);

/// A check on its thread. Dropping it discards its result; a check that has begun goes on to its end.
#[derive(Debug)]
pub(super) struct BackgroundCheck {
    cancelled: Arc<AtomicBool>,
}

impl BackgroundCheck {
    /// Starts `check` on one core as soon as `has_begun`, so that it delays no first image; `store` gets its result.
    pub(super) fn start(
        check: impl FnOnce() -> CheckReport + Send + 'static,
        has_begun: impl Fn() -> bool + Send + 'static,
        store: impl FnOnce(CheckReport) + Send + 'static,
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
            let checked = match ThreadPoolBuilder::new().num_threads(1).build() {
                Ok(pool) => pool.install(check),
                Err(_no_threads) => check(),
            };
            if !is_cancelled() {
                store(checked);
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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::session::{Session, SessionPlan, SessionRequest, Stopwatch};

    #[test]
    fn a_log_without_a_usable_image_is_checked() {
        let request = SessionRequest {
            log_path: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../sample_logs/garden.mcap"),
            duration_s: Some(0.5),
            ..SessionRequest::default()
        };
        let mut plan = SessionPlan::open(&request).unwrap();
        for camera in &mut Arc::make_mut(&mut plan.rig).cameras {
            camera.model.resolution_px = [320, 240];
        }
        let mut session = Session::start(plan).unwrap();
        session.check_in_background(|log, rig| crate::log_check::check(log, Ok(rig), &[])).unwrap();
        let begin = Stopwatch::start();
        while session.recording().is_being_checked {
            assert!(begin.elapsed_ms() < 20_000.0, "the check has not begun");
            std::thread::sleep(WAIT);
        }
        let recording = session.recording();
        assert!(recording.runs.iter().all(|run| run.steps.is_empty()), "no image has the size of the rig");
        assert!(recording.check.is_some());
    }
}
