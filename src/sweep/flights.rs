//! Simulated flights of a study: rendered once for all jobs and processes.

use std::fs::{self, File};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::StudyFileError;
use super::folder::StudyFolder;
use super::inputs::file_sha256;
use crate::files::output;
use crate::session::Stopwatch;
use crate::simulated_log::{SimulationError, SimulationProgress, simulate_interruptible};
use crate::study::SimulatedFlight;

/// File with the metadata of a rendered flight.
const NOTES: &str = "rendered.json";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderedFlight {
    /// SHA-256 of the log.
    pub sha256: String,
    pub duration_s: f64,
    /// Wall time of the rendering in seconds.
    pub rendered_in_s: f64,
}

fn file_name(flight: &SimulatedFlight) -> String {
    let plain = |letter: char| if letter.is_ascii_alphanumeric() || "-_".contains(letter) { letter } else { '-' };
    let name: String = flight.recipe.name.chars().map(plain).collect();
    format!("{name}-{}.mcap", flight.seed)
}

impl StudyFolder {
    /// Path of the log of a flight, which may not be rendered yet.
    pub fn flight_log(&self, flight: &SimulatedFlight) -> PathBuf {
        self.flight_folder(flight).join(file_name(flight))
    }

    /// Metadata of a flight, `None` before it is rendered.
    pub fn rendered(&self, flight: &SimulatedFlight) -> Option<RenderedFlight> {
        let text = fs::read(self.flight_folder(flight).join(NOTES)).ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// Renders a flight unless it is rendered, or waits while another process renders it.
    ///
    /// The flight is written into a temporary folder that is renamed when it is complete. A lock keeps two processes
    /// from rendering the same flight; on a file system without locks both do, and the first one is kept.
    ///
    /// # Errors
    /// As [`simulate_interruptible`], and if the folders cannot be written.
    pub fn render(
        &self,
        flight: &SimulatedFlight,
        progress: &mut dyn FnMut(SimulationProgress) -> ControlFlow<()>,
    ) -> Result<(), FlightError> {
        let target = self.flight_folder(flight);
        let flights = self.root().join("flights");
        let lock_path = flights.join(format!("{}.lock", flight.id()));
        let lock = File::options().create(true).append(true).open(&lock_path);
        let lock = lock.map_err(StudyFileError::write(&lock_path))?;
        // Without locks, the first rename is kept.
        let locked = lock.lock().is_ok();
        if self.rendered(flight).is_some() {
            return Ok(());
        }
        let prefix = format!(".{}.", flight.id());
        if locked {
            remove_leftovers(&flights, &prefix);
        }
        let temporary = tempfile::Builder::new().prefix(&prefix).tempdir_in(&flights);
        let temporary = temporary.map_err(StudyFileError::write(&flights))?;
        let stopwatch = Stopwatch::start();
        let log = temporary.path().join(file_name(flight));
        let options = flight.recipe.options(flight.seed, &flight.disturb)?;
        let summary = simulate_interruptible(&options, &log, progress)?;
        let notes = RenderedFlight {
            sha256: file_sha256(&log)?,
            duration_s: summary.duration_s,
            rendered_in_s: stopwatch.elapsed_ms() * 1e-3,
        };
        let path = temporary.path().join(NOTES);
        let text = serde_json::to_vec_pretty(&notes).unwrap_or_default();
        output::write_file(&path, &text).map_err(StudyFileError::write(&path))?;
        share(temporary.path());
        match fs::rename(temporary.path(), &target) {
            Err(_) if self.rendered(flight).is_some() => Ok(()),
            renamed => Ok(renamed.map_err(StudyFileError::write(&target))?),
        }
    }
}

/// Gives a temporary folder, readable only by its owner, the permissions of a new folder.
fn share(folder: &Path) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // A folder that remains private still works for its owner.
        drop(fs::set_permissions(folder, fs::Permissions::from_mode(0o755)));
    }
    #[cfg(not(unix))]
    drop(folder);
}

/// Removes files left by killed processes; this process holds the lock of the flight.
fn remove_leftovers(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        if entry.file_name().to_string_lossy().starts_with(prefix) {
            drop(fs::remove_dir_all(entry.path()));
        }
    }
}

/// Error of rendering a flight.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// The simulation failed or was interrupted.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    #[error(transparent)]
    File(Box<StudyFileError>),
}

impl From<StudyFileError> for FlightError {
    fn from(error: StudyFileError) -> Self {
        Self::File(Box::new(error))
    }
}
