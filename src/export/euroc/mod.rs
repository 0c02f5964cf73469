//! A flight log as a folder in the format of EuRoC (ASL), which other estimators read.
//!
//! The folder is `mav0` with a folder per sensor. Everything is written sample by sample into a folder beside it, which is
//! renamed when it is complete.

mod conversion;
mod report;
mod sensor_yaml;
#[cfg(test)]
mod tests;

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use self::conversion::{BODY, Conversion};
pub use self::report::{EurocCamera, EurocReport};
use self::sensor_yaml::body_yaml;
use super::error::ExportError;
use crate::files::output;
use crate::flight_log::{FlightLog, LogError};
use crate::sensors::{CameraMount, CameraRig, Rig};
use crate::text::log_name;

/// Folder of the sensors.
const SENSORS: &str = "mav0";

/// Checks that a log may be written as `mav0` into a folder: an existing `mav0` must come from the same log.
///
/// # Errors
/// If the folder cannot be written or, without `force`, has another `mav0`.
pub fn check_euroc_folder(folder: &Path, log: &Path, force: bool) -> Result<(), ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    let sensors = folder.join(SENSORS);
    if force || fs::symlink_metadata(&sensors).is_err() {
        return Ok(());
    }
    let ours = fs::read_to_string(sensors.join(BODY)).is_ok_and(|text| text == body_yaml(&log_name(log)));
    let problem = format!("the folder exists and is not {} as this command writes it", log_name(log));
    if ours { Ok(()) } else { Err(ExportError::Existing { problem, path: sensors }) }
}

/// Writes a log as `mav0` into a folder, replacing an older one; `cameras` are keys of the rig in the order of `cam0`,
/// `cam1`, …, by default the rigid cameras before those on a gimbal. `progress` is called with the completed fraction.
/// `None` if it breaks, in which case nothing is written.
///
/// # Errors
/// If a camera is unknown or not in the log, or the folder cannot be written.
pub fn write_euroc(
    log: &Arc<FlightLog>,
    rig: &Rig,
    cameras: &[String],
    folder: &Path,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Option<EurocReport>, ExportError> {
    let (cameras, left) = chosen_cameras(log, rig, cameras)?;
    fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let unfinished = tempfile::Builder::new().prefix(".mav0.dcvins-").suffix(".tmp").tempdir_in(folder);
    let unfinished = unfinished.map_err(ExportError::write(folder))?;
    let topics = [&rig.imu.topic].into_iter().chain(cameras.iter().map(|camera| &camera.topic));
    let topics = topics.chain(rig.ground_truth_topic.as_ref()).chain(rig.gimbal.iter().flat_map(|it| &it.topic));
    let total = topics.filter_map(|topic| log.topic(topic)).map(|info| info.count).sum::<u64>().max(1);
    let mut conversion = Conversion {
        log,
        rig,
        root: unfinished.path().to_owned(),
        done: 0,
        total,
        progress,
        report: EurocReport::new(log, folder.join(SENSORS)),
    };
    conversion.report.notes.extend(left);
    if conversion.write(&cameras)?.is_break() {
        return Ok(None);
    }
    let report = conversion.report;
    let target = folder.join(SENSORS);
    let write_error = || ExportError::write(&target);
    // An existing folder leaves only when the new one is complete.
    let replaced = tempfile::Builder::new().prefix(".mav0.dcvins-").suffix(".tmp").tempdir_in(folder);
    let replaced = replaced.map_err(write_error())?;
    if fs::symlink_metadata(&target).is_ok() {
        fs::rename(&target, replaced.path().join(SENSORS)).map_err(write_error())?;
    }
    fs::rename(unfinished.keep(), &target).map_err(write_error())?;
    replaced.close().map_err(write_error())?;
    Ok(Some(report))
}

/// Cameras in the order of their numbers, and notes about those that are left out.
fn chosen_cameras<'a>(
    log: &FlightLog,
    rig: &'a Rig,
    keys: &[String],
) -> Result<(Vec<&'a CameraRig>, Vec<String>), ExportError> {
    if !keys.is_empty() {
        let chosen = keys.iter().map(|key| rig.camera(key).map_err(LogError::from));
        return Ok((chosen.collect::<Result<_, _>>()?, Vec::new()));
    }
    let (mut cameras, missing): (Vec<&CameraRig>, Vec<&CameraRig>) =
        rig.cameras.iter().partition(|camera| log.topic(&camera.topic).is_some());
    // Programs for one camera take cam0, which they assume to be rigid.
    cameras.sort_by_key(|camera| camera.mount == CameraMount::Gimbal);
    let note = |camera: &&CameraRig| format!("{} is left out: the log has no topic {}", camera.key, camera.topic);
    Ok((cameras, missing.iter().map(note).collect()))
}
