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
    use crate::flight_log::FollowOptions;
    use crate::log_check::Finding;
    use crate::session::{Session, SessionPlan, SessionRequest, Stopwatch};

    fn sample() -> PathBuf {
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../sample_logs/garden.mcap")
    }

    /// A session that is checked in the background; no image has the size of the rig, so that no run has a step.
    fn checked(request: &SessionRequest) -> Session {
        let mut plan = SessionPlan::open(request).unwrap();
        for camera in &mut Arc::make_mut(&mut plan.rig).cameras {
            camera.model.resolution_px = [320, 240];
        }
        let mut session = Session::start(plan).unwrap();
        session.check_in_background(|log, rig| crate::log_check::check(log, Ok(rig), &[])).unwrap();
        session
    }

    /// Findings of the check, which has to end in time.
    fn findings(session: &mut Session) -> Arc<Vec<Finding>> {
        let begin = Stopwatch::start();
        loop {
            session.advance(0.0);
            let recording = session.recording();
            assert!(recording.runs.iter().all(|run| run.steps.is_empty()), "an image has the size of the rig");
            if let Some(findings) = recording.check.clone().filter(|_| !recording.is_being_checked) {
                return findings;
            }
            assert!(begin.elapsed_ms() < 60_000.0, "the check has not ended");
            std::thread::sleep(WAIT);
        }
    }

    #[test]
    fn a_log_without_a_usable_image_is_checked() {
        let request = SessionRequest { log_path: sample(), duration_s: Some(0.5), ..SessionRequest::default() };
        let mut session = checked(&request);
        assert!(session.recording().is_being_checked);
        findings(&mut session);
    }

    #[test]
    fn a_log_that_is_being_written_is_checked_once_it_has_ended() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mcap");
        let bytes = std::fs::read(sample()).unwrap();
        let (first, rest) = bytes.split_at(bytes.len() / 2);
        std::fs::write(&path, first).unwrap();
        let request = SessionRequest {
            log_path: path.clone(),
            rig_path: Some(sample().with_file_name("garden.rig.yaml")),
            following: Some(FollowOptions::default()),
            ..SessionRequest::default()
        };
        let mut session = checked(&request);
        for _ in 0..4 {
            session.advance(0.0);
            std::thread::sleep(WAIT);
            assert!(!session.recording().is_being_checked && session.recording().check.is_none());
        }
        let mut file = std::fs::OpenOptions::new().append(true).open(&path).unwrap();
        std::io::Write::write_all(&mut file, rest).unwrap();
        let of_followed = findings(&mut session);
        let of_complete = findings(&mut checked(&SessionRequest { following: None, ..request }));
        assert_eq!(of_followed, of_complete);
    }
}
