//! The sample flight, simulated on this machine for a program without the sample logs of the repository.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use directories::ProjectDirs;

use crate::gui::desktop::SampleProgress;
use crate::simulated_log::{SimulationOptions, simulate_interruptible};
use crate::simulation::Experiment;

const NAME: &str = "garden.mcap";
const DURATION_S: f64 = 8.5;
/// Capacity of the channel to the window; further progress messages are dropped.
const WAITING_MESSAGES: usize = 4;

/// Folder of the user's sample logs: `sample_logs` in `~/.local/share/dcvins` on Linux, in the user's local application
/// data elsewhere, and in `dcvins-output` for a user without a home folder.
pub(super) fn folder() -> PathBuf {
    let user = ProjectDirs::from("", "", "dcvins");
    let base = user.map_or_else(|| PathBuf::from("dcvins-output"), |folders| folders.data_local_dir().to_path_buf());
    base.join("sample_logs")
}

/// The flight of `sample_logs/garden.mcap` in the repository.
fn options() -> SimulationOptions {
    SimulationOptions { duration_s: Some(DURATION_S), ..SimulationOptions::new(Experiment::T1) }
}

/// Starts to simulate the flight into a folder, on a thread that ends early when the receiver is dropped.
///
/// # Errors
/// If the thread cannot be started.
pub(super) fn start(folder: &Path) -> Result<Receiver<SampleProgress>, String> {
    let (sender, receiver) = sync_channel(WAITING_MESSAGES);
    let folder = folder.to_path_buf();
    let thread = std::thread::Builder::new().name("sample-flight".to_owned());
    let started = thread.spawn(move || {
        let result = write(&folder, &options(), &sender);
        // The receiver is dropped if the user has cancelled.
        drop(sender.send(SampleProgress::Done(result)));
    });
    started.map(|_| receiver).map_err(|error| format!("Cannot start a thread: {error}"))
}

fn write(folder: &Path, options: &SimulationOptions, sender: &SyncSender<SampleProgress>) -> Result<PathBuf, String> {
    let path = folder.join(NAME);
    fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder of the sample flight: {error}: {}", folder.display()))?;
    let mut progress = |at: crate::simulated_log::SimulationProgress| {
        let message = SampleProgress::Images { done: at.images_done, total: at.images_total };
        match sender.try_send(message) {
            Err(TrySendError::Disconnected(_)) => ControlFlow::Break(()),
            Ok(()) | Err(TrySendError::Full(_)) => ControlFlow::Continue(()),
        }
    };
    let summary = simulate_interruptible(options, &path, &mut progress).map_err(|error| error.to_string())?;
    Ok(summary.log)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flight_is_written_with_its_rig_and_progress_and_can_be_cancelled() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("share/sample_logs");
        let small =
            SimulationOptions { duration_s: Some(0.5), resolution_px: [64, 48], static_camera: false, ..options() };
        let (sender, receiver) = sync_channel(100);
        let log = write(&place, &small, &sender).unwrap();
        assert!(log.ends_with("share/sample_logs/garden.mcap") && log.is_file());
        assert!(log.with_extension("rig.yaml").is_file() && log.with_extension("truth.yaml").is_file());
        let last = receiver.try_iter().last();
        assert!(matches!(last, Some(SampleProgress::Images { done, total }) if done == total && done > 5), "{last:?}");

        fs::remove_file(&log).unwrap();
        drop(receiver);
        let problem = write(&place, &small, &sender).unwrap_err();
        assert!(problem.starts_with("interrupted") && !log.exists(), "{problem}");
    }

    #[test]
    fn the_flight_is_the_one_of_the_repository() {
        let readme = include_str!("../../sample_logs/README.md");
        let command =
            format!("dcvins simulate T1 --seed {} --duration {DURATION_S} -o sample_logs/{NAME}", options().seed);
        assert!(readme.contains(&command), "sample_logs/README.md has another command than {command}");
    }
}
