//! Rig files: this program's schema and Kalibr's, read and written.

pub(crate) mod attitude;
pub(crate) mod camera_facts;
mod document;
pub(crate) mod fields;
pub(crate) mod kalibr;
mod keys;
mod mask;
pub(crate) mod read;
mod sensor;
#[cfg(test)]
mod tests;
mod write;

use std::path::Path;

use self::camera_facts::{CameraFacts, NoFacts};
pub(crate) use self::document::Document;
use self::mask::InFolder;
use super::FileError;
use super::output::StagedFile;
use crate::sensors::Rig;

/// Rig files of the schema of this program.
pub trait RigFile: Sized {
    /// Reads a rig file: the schema of this program, or Kalibr's `camchain-imucam.yaml` with `imu.yaml` in the same
    /// folder.
    fn from_file(path: &Path) -> Result<Self, FileError>;

    /// Parses the text of a rig in the schema of this program; `file` is named in errors.
    fn from_yaml(text: &str, file: &Path) -> Result<Self, FileError>;

    /// Returns the rig as a YAML file, with its chain in the classical parameterization. Numbers read back exactly;
    /// rotation matrices read back to within rounding.
    fn to_yaml(&self) -> String;

    /// Writes the rig as YAML, with `appended` (further top-level entries, or nothing) at its end.
    fn save(&self, path: &Path, appended: &str) -> Result<(), FileError> {
        let staged = self.stage(path, appended)?;
        staged.commit().map_err(|source| FileError::Io { action: "write the rig", source, path: path.to_owned() })
    }

    /// [`Self::save`] without the final rename, so that the file can appear together with others.
    fn stage(&self, path: &Path, appended: &str) -> Result<StagedFile, FileError> {
        let text = format!("{}{appended}", self.to_yaml());
        StagedFile::with_content(path, text.as_bytes()).map_err(|source| FileError::Io {
            action: "write the rig",
            source,
            path: path.to_owned(),
        })
    }
}

impl RigFile for Rig {
    fn from_file(path: &Path) -> Result<Self, FileError> {
        from_file(path, &NoFacts).map(|(rig, _)| rig)
    }

    fn from_yaml(text: &str, file: &Path) -> Result<Self, FileError> {
        let facts = InFolder { facts: &NoFacts, folder: folder_of(file) };
        from_document(&Document::parse(text, file)?, &facts).map(|(rig, _)| rig)
    }

    fn to_yaml(&self) -> String {
        write::yaml(self)
    }
}

/// Rig with the paths of known but unused keys of its file.
pub(crate) type RigWithUnusedKeys = (Rig, Vec<String>);

/// Reads a rig file with the facts of its log.
pub(crate) fn from_file(path: &Path, facts: &dyn CameraFacts) -> Result<RigWithUnusedKeys, FileError> {
    from_document(&Document::read(path)?, &InFolder { facts, folder: folder_of(path) })
}

/// Folder of the files next to a rig.
fn folder_of(rig: &Path) -> &Path {
    rig.parent().unwrap_or(rig)
}

pub(crate) fn from_document(document: &Document, facts: &dyn CameraFacts) -> Result<RigWithUnusedKeys, FileError> {
    let file = &document.file;
    let stem = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let name = stem.split('.').next().unwrap_or_default();
    let root = document.root();
    if !kalibr::is_camera_chain(&document.value) {
        let rig = read::read_rig(&root, name, facts)?;
        return Ok((rig, keys::check_rig(&document.value, file)?));
    }
    if root.field("imu0").is_present() {
        let rig = kalibr::read_camera_chain(&root, &root, name, facts)?;
        return Ok((rig, keys::check_rig(&document.value, file)?));
    }
    let candidates = kalibr::imu_files(file);
    let Some(imu_file) = candidates.iter().find(|candidate| candidate.is_file()) else {
        let names: Vec<String> = candidates
            .iter()
            .filter_map(|path| path.file_name())
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        let expected = format!("the IMU in one of {} next to this camera chain", names.join(", "));
        return Err(root.field("imu0").unexpected(&expected));
    };
    let imu = Document::read(imu_file)?;
    let rig = kalibr::read_camera_chain(&root, &imu.root(), name, facts)?;
    let mut unused = keys::check_rig(&document.value, file)?;
    unused.extend(keys::check_imu_file(&imu.value, imu_file)?);
    Ok((rig, unused))
}
