//! Output files of `dcvins run` for each run.

use crate::files::RigFile as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::error::ExportError;
use super::folder_files::{json_text, remove_others};
use super::masks;
use super::posterior::{POSTERIOR, posterior_of_run};
use super::results::stage_results;
use super::tables::{calibration_csv, frames_csv, information_csv, rank_csv};
use super::trajectory::{covariance_csv, euroc_of_run, tum_of_run};
use crate::files::output::OutputSet;
use crate::session::{Recording, RunRecord, RunSummary, summarize_with_motion};

/// Trajectory as a table in EuRoC's format.
const EUROC_TRAJECTORY: &str = "trajectory.euroc.csv";
/// The run for Foxglove and Rerun.
const RESULTS: &str = "results.mcap";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunFileOptions {
    /// True to write measured times; without them two runs give the same bytes in every file.
    pub timing: bool,
    /// True to write `results.mcap` for Foxglove and Rerun.
    pub mcap: bool,
    /// True to write `trajectory.euroc.csv`.
    pub euroc_trajectory: bool,
}

impl Default for RunFileOptions {
    /// The default files, with measured times.
    fn default() -> Self {
        Self { timing: true, mcap: false, euroc_trajectory: false }
    }
}

/// Writes the files of one run into `folder/LABEL/` and returns that folder and the summary.
///
/// All files are complete before the first one replaces an older one; files of an earlier run that are not written
/// again are removed.
pub fn write_run(
    recording: &Recording,
    run: &RunRecord,
    folder: &Path,
    options: RunFileOptions,
) -> Result<(PathBuf, RunSummary), ExportError> {
    let mut outputs = OutputSet::default();
    let (folder, summary) = stage_run(recording, run, folder, options, &mut outputs)?;
    let paths = outputs.paths();
    outputs.commit().map_err(ExportError::commit)?;
    remove_unwritten(&folder, &paths)?;
    Ok((folder, summary))
}

/// Prepares the files of one run without giving them their names.
pub(crate) fn stage_run(
    recording: &Recording,
    run: &RunRecord,
    folder: &Path,
    options: RunFileOptions,
    outputs: &mut OutputSet,
) -> Result<(PathBuf, RunSummary), ExportError> {
    let folder = folder.join(&run.spec.label);
    fs::create_dir_all(&folder).map_err(ExportError::write(&folder))?;
    let summary = summarize_with_motion(recording, run, options.timing);
    let json = json_text(&summary, &folder.join("summary.json"))?;
    let mut rig = run.calibrated_rig(&recording.rig);
    let masks = masks::beside(&mut rig)?;
    // The summary contains the name of the log, so it is the first file.
    let mut files = vec![
        ("summary.json", json),
        ("trajectory.tum", tum_of_run(run, recording.epoch_ns)),
        ("covariance.csv", covariance_csv(run)),
        ("calibration.csv", calibration_csv(run, &recording.rig)),
        ("rank.csv", rank_csv(run, &recording.rig.parameter_names())),
        ("information.csv", information_csv(run, &recording.rig)),
        ("frames.csv", frames_csv(run, options.timing)),
        ("rig.yaml", rig.to_yaml()),
    ];
    let posterior = posterior_of_run(recording, run);
    files.extend(posterior.map(|text| (POSTERIOR, text)));
    if options.euroc_trajectory {
        files.push((EUROC_TRAJECTORY, euroc_of_run(run, recording.epoch_ns)));
    }
    for (name, text) in files {
        let path = folder.join(name);
        outputs.write(&path, text.as_bytes()).map_err(ExportError::write(&path))?;
    }
    for (name, png) in masks {
        let path = folder.join(name);
        outputs.write(&path, &png).map_err(ExportError::write(&path))?;
    }
    if options.mcap {
        outputs.add(stage_results(recording, run, &folder.join(RESULTS))?);
    }
    Ok((folder, summary))
}

/// Removes the files that an earlier run left in the folder of a run and that are not among the `written` ones.
pub(crate) fn remove_unwritten(folder: &Path, written: &[PathBuf]) -> Result<(), ExportError> {
    remove_others(&[EUROC_TRAJECTORY, RESULTS, POSTERIOR], written, folder)
}
