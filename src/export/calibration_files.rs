//! Output files of `dcvins calibrate`.

use crate::files::RigFile as _;
use std::path::Path;

use super::calibration_report::CalibrationReport;
use super::error::ExportError;
use super::folder_files::{json_text, remove_others, write_files};
use super::masks;
use super::posterior::{POSTERIOR, posterior_of_calibration};
use super::trajectory::{covariance_of_calibration, tum_of_calibration};
use crate::geometry::Dimension;
use crate::session::CalibrationRun;

pub(super) const TRAJECTORY_FILES: [&str; 3] = [TRAJECTORY, STATIC_TRAJECTORY, "covariance.csv"];
/// Trajectory of the bundle adjustment of both cameras.
pub(crate) const TRAJECTORY: &str = "trajectory.tum";
/// Trajectory of the bundle adjustment of static camera and IMU.
pub(crate) const STATIC_TRAJECTORY: &str = "static_trajectory.tum";

/// Writes `rig.yaml`, `calibration.json`, `posterior.json` and `report.txt` into a folder, and on request the
/// trajectories of static camera and of both cameras, the latter with its covariances.
///
/// # Errors
/// If a file or the folder cannot be written.
pub fn write_calibration(
    run: &CalibrationRun,
    report: &CalibrationReport,
    folder: &Path,
    trajectory: bool,
) -> Result<(), ExportError> {
    let json = json_text(report, &folder.join("calibration.json"))?;
    let sigmas = report.parameters.iter().map(|it| (it.name.as_str(), it.dimension, it.sigma));
    let mut rig = run.rig.clone();
    let masks = masks::beside(&mut rig)?;
    let mut files = vec![
        ("calibration.json", json),
        ("rig.yaml", format!("{}{}", rig.to_yaml(), sigmas_yaml(&report.parameterization, sigmas))),
        ("report.txt", report.to_string()),
        (POSTERIOR, posterior_of_calibration(run)),
    ];
    if trajectory {
        let tum = |poses| tum_of_calibration(poses, run.epoch_ns);
        let texts = [tum(&run.outcome.trajectory), tum(&run.outcome.static_trajectory), covariance_of_calibration(run)];
        files.extend(TRAJECTORY_FILES.into_iter().zip(texts));
    }
    let texts = files.into_iter().map(|(name, text)| (name.to_owned(), text.into_bytes()));
    let paths = write_files(texts.chain(masks), folder)?;
    remove_others(&TRAJECTORY_FILES, &paths, folder)?;
    Ok(())
}

/// Standard deviations (name, dimension, σ) as an additional entry of the rig file, which readers of rigs ignore.
pub(super) fn sigmas_yaml<'a>(
    parameterization: &str,
    sigmas: impl Iterator<Item = (&'a str, Dimension, f64)>,
) -> String {
    let line = |(name, dimension, sigma): (&str, Dimension, f64)| {
        let key = format!("{name}_{}", dimension.unit());
        // A joint may have any name.
        let plain = key.chars().all(|letter| letter.is_ascii_alphanumeric() || "_.".contains(letter));
        let key = if plain { key } else { serde_json::Value::from(key).to_string() };
        format!("    {key}: {sigma:?}\n")
    };
    let sigmas: String = sigmas.map(line).collect();
    format!(
        "# Standard deviations of the calibrated parameters, in the parameterization named here.\n\
         calibration:\n  parameterization: {parameterization}\n  sigmas:\n{sigmas}"
    )
}
