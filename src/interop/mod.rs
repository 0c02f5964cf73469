//! Configuration files of other estimators from a rig, with the gimbal fixed at given joint angles, and robot
//! descriptions with its joints.
//!
//! Each module writes the text of one program's files from a rig of static cameras; `Format` describes the
//! capabilities of the program. Unsupported properties are noted at the head of the files, or are an error.

mod basalt;
mod error;
mod format;
mod joint_angles;
mod kalibr;
mod openvins;
mod orb_slam3;
#[cfg(test)]
mod tests;
mod text;
mod urdf;
#[cfg(test)]
mod urdf_tests;
mod vins_fusion;

use std::path::{Path, PathBuf};

use crate::export::{ExportError, masks};
use crate::files::output;
use crate::files::output::OutputSet;
use crate::sensors::Rig;

pub use self::format::OtherEstimator;
pub use error::ConfigurationError;
pub use joint_angles::{AngleOrigin, FixedJointAngles};
pub use urdf::{calibrated_description, robot_description};

use format::Format;

/// Configuration files before they are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// Name and content of each file.
    pub files: Vec<(String, Vec<u8>)>,
    /// Conditions and unsupported properties; the text files start with the same lines.
    pub notes: Vec<String>,
}

/// The configuration of another program for a rig.
///
/// `cameras` are keys of the rig in the order of the program's cameras; if empty, every camera is used, up to the
/// number that the program supports.
///
/// # Errors
/// If a key or the joint angles do not belong to the rig, or the program does not support a lens or the number of
/// cameras.
pub fn configure(
    rig: &Rig,
    program: OtherEstimator,
    cameras: &[String],
    angles: &FixedJointAngles,
) -> Result<Configuration, ConfigurationError> {
    let format = Format::of(program);
    let chosen = format.choose_cameras(rig, cameras)?;
    format.check_lenses(&chosen)?;
    let mut notes = angles.notes(&chosen);
    notes.extend(format.notes(rig, &chosen, cameras.is_empty()));
    let mut fixed = angles.fix(&chosen)?;
    if format.has_imu_intrinsics {
        let (rotated, kalibr_from_imu) = fixed.in_kalibr_imu_frame();
        fixed = rotated;
        let angle_deg = kalibr_from_imu.angle().to_degrees();
        if angle_deg > 0.0 {
            notes.push(format!(
                "the IMU frame is rotated by {angle_deg:.3}° against that of the rig, so that the accelerometer's matrix is \
                 lower triangular as Kalibr defines the frame; extrinsics and trajectories are of the rotated frame"
            ));
        }
    }
    // Programs count cameras from 0 without a gap.
    for (number, camera) in fixed.cameras.iter_mut().enumerate() {
        camera.key = format!("cam{number}");
    }
    let head = text::head(program, &rig.name, &notes);
    let mut files = match program {
        OtherEstimator::Kalibr => kalibr::files(&fixed, &head),
        OtherEstimator::VinsFusion => vins_fusion::files(&fixed, &head),
        OtherEstimator::OpenVins => openvins::files(&fixed, &head),
        OtherEstimator::Basalt => basalt::files(&fixed, &head),
        OtherEstimator::OrbSlam3 => orb_slam3::files(&fixed, &head),
    };
    if format.has_masks {
        for (name, mask) in text::masks(program, &fixed) {
            files.push((name, masks::png(&mask).map_err(|error| ConfigurationError::Mask(error.to_string()))?));
        }
    }
    Ok(Configuration { files, notes })
}

/// Writes configuration files into a folder; returns their paths. Existing files are replaced if they were written by
/// this program.
///
/// # Errors
/// If a file cannot be written or, without `force`, is something else.
pub fn write_configuration(
    configuration: &Configuration,
    folder: &Path,
    force: bool,
) -> Result<Vec<PathBuf>, ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    let ours = |path: &Path| {
        std::fs::read(path).is_ok_and(|bytes| bytes.windows(text::MARK.len()).any(|part| part == text::MARK.as_bytes()))
    };
    // Masks have no mark; they are treated like the first file.
    let replaces = force || configuration.files.first().is_some_and(|(name, _)| ours(&folder.join(name)));
    for (name, _) in &configuration.files {
        let path = folder.join(name);
        let is_text = path.extension().is_none_or(|extension| extension != "png");
        if path.exists() && !(force || replaces && !is_text || is_text && ours(&path)) {
            return Err(ExportError::Existing {
                problem: "the file exists and was not written by 'dcvins export'".to_owned(),
                path,
            });
        }
    }
    std::fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    let mut outputs = OutputSet::default();
    let mut paths = Vec::new();
    for (name, content) in &configuration.files {
        let path = folder.join(name);
        outputs.write(&path, content).map_err(ExportError::write(&path))?;
        paths.push(path);
    }
    outputs.commit().map_err(ExportError::commit)?;
    Ok(paths)
}
