//! Faults of a log that its check finds: no change of a run undoes a heading that steps or a joint that freezes.

use std::cell::OnceCell;
use std::path::Path;
use std::sync::Arc;

use crate::flight_log::FlightLog;
use crate::log_check::{self, Finding};
use crate::sensors::Rig;
use crate::session::engine::image_rotations;

/// Result of the check of a log, made for the first run that needs it.
#[derive(Debug, Default)]
pub struct LogFaults {
    found: OnceCell<Vec<Finding>>,
}

impl LogFaults {
    /// At most three errors and warnings of the check, those with the largest effect on a result first; none if the log can
    /// no longer be read.
    pub(super) fn of(&self, log_path: &Path, rig: &Rig) -> &[Finding] {
        self.found.get_or_init(|| {
            let Ok(log) = FlightLog::open(log_path) else { return Vec::new() };
            let log = Arc::new(log);
            let rotations = image_rotations(&log, rig);
            log_check::check(&log, Ok(rig), &rotations).verdict().first
        })
    }
}
