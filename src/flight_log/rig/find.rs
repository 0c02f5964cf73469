use std::path::{Path, PathBuf};

use super::super::{FlightLog, LogError};
use super::camera_facts::{CameraFacts, NoFacts};
use super::camera_info::PublishedCamera;
use super::document::Document;
use super::mask::{Attached, InFolder};
use super::read;
use super::{kalibr, keys};
use crate::sensors::Rig;

impl Rig {
    /// Reads a rig file: the schema of this program, or Kalibr's `camchain-imucam.yaml` with `imu.yaml` in the same
    /// folder.
    pub fn from_file(path: &Path) -> Result<Self, LogError> {
        from_file(path, &NoFacts).map(|(rig, _)| rig)
    }

    /// Parses the text of a rig in the schema of this program; `file` is named in errors.
    pub fn from_yaml(text: &str, file: &Path) -> Result<Self, LogError> {
        let facts = InFolder { facts: &NoFacts, folder: folder_of(file) };
        from_document(&Document::parse(text.to_owned(), file)?, &facts).map(|(rig, _)| rig)
    }

    /// Finds the rig of a log: the file given by the user, else the one next to the log, else the one attached to it.
    /// Missing intrinsics and image rates are taken from the log.
    pub fn for_log(log: &FlightLog, explicit: Option<&Path>) -> Result<Self, LogError> {
        Self::for_log_with_unused_keys(log, explicit).map(|(rig, _)| rig)
    }

    /// Returns the rig of [`Self::for_log`], with the paths of the keys in its file that other programs write and that
    /// are not used.
    pub fn for_log_with_unused_keys(log: &FlightLog, explicit: Option<&Path>) -> Result<(Self, Vec<String>), LogError> {
        let beside = log.path().with_extension("rig.yaml");
        find(log, explicit, &beside, ".rig.yaml")?
            .ok_or_else(|| LogError::NoRig { beside, path: log.path().to_owned() })
    }

    /// Finds the ground-truth rig in the same way (`NAME.truth.yaml`, or attached); `None` if there is none.
    pub fn ground_truth_for_log(log: &FlightLog, explicit: Option<&Path>) -> Result<Option<Self>, LogError> {
        let found = find(log, explicit, &log.path().with_extension("truth.yaml"), ".truth.yaml")?;
        Ok(found.map(|(rig, _)| rig))
    }

    /// Finds the ground truth of this rig, as [`Self::ground_truth_for_log`]. A file that was not asked for is left out if
    /// it belongs to another mechanism, as where one log is run with several rigs.
    ///
    /// # Errors
    ///
    /// If the given file has another number of joints for a camera of this rig.
    pub fn own_ground_truth(&self, log: &FlightLog, explicit: Option<&Path>) -> Result<Option<Self>, LogError> {
        let Some(truth) = Self::ground_truth_for_log(log, explicit)? else { return Ok(None) };
        let joints = |rig: &Self, key: &str| rig.chain_of_camera(key).map(|chain| chain.joint_count());
        let differs = |key: &&str| joints(&truth, key).is_some_and(|count| joints(self, key) != Some(count));
        let Some(key) = self.cameras.iter().map(|camera| &*camera.key).find(differs) else { return Ok(Some(truth)) };
        let Some(path) = explicit else { return Ok(None) };
        let [given, expected] = [&truth, self].map(|rig| joints(rig, key).unwrap_or(0));
        let problem = format!("{given} joints in the ground truth, {expected} in the rig '{}'", self.name);
        Err(LogError::Rig { field: key.to_owned(), problem, path: path.to_owned() })
    }
}

/// Rig with the paths of known but unused keys of its file.
type RigWithUnusedKeys = (Rig, Vec<String>);

fn find(
    log: &FlightLog,
    explicit: Option<&Path>,
    beside: &Path,
    ending: &str,
) -> Result<Option<RigWithUnusedKeys>, LogError> {
    if let Some(path) = explicit {
        return from_file(path, log).map(Some);
    }
    if beside.is_file() {
        return from_file(beside, log).map(Some);
    }
    let Some((name, content)) = log.attachment(ending) else { return Ok(None) };
    let file = PathBuf::from(format!("{} (attachment {name})", log.path().display()));
    from_document(&Document::from_bytes(content, &file)?, &Attached(log)).map(Some)
}

fn from_file(path: &Path, facts: &dyn CameraFacts) -> Result<RigWithUnusedKeys, LogError> {
    from_document(&Document::read(path)?, &InFolder { facts, folder: folder_of(path) })
}

/// Folder of the files next to a rig.
fn folder_of(rig: &Path) -> &Path {
    rig.parent().unwrap_or(rig)
}

fn from_document(document: &Document, facts: &dyn CameraFacts) -> Result<RigWithUnusedKeys, LogError> {
    let file = &document.file;
    let stem = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let name = stem.split('.').next().unwrap_or_default();
    let with_line = |error| document.with_line(error);
    let root = document.root();
    if !kalibr::is_camera_chain(&document.value) {
        let rig = read::read_rig(&root, name, facts).map_err(with_line)?;
        return Ok((rig, keys::check_rig(&document.value, file).map_err(with_line)?));
    }
    if root.field("imu0").is_present() {
        let rig = kalibr::read_camera_chain(&root, &root, name, facts).map_err(with_line)?;
        return Ok((rig, keys::check_rig(&document.value, file).map_err(with_line)?));
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
    let with_line = |error| imu.with_line(document.with_line(error));
    let rig = kalibr::read_camera_chain(&root, &imu.root(), name, facts).map_err(with_line)?;
    let mut unused = keys::check_rig(&document.value, file).map_err(with_line)?;
    unused.extend(keys::check_imu_file(&imu.value, imu_file).map_err(with_line)?);
    Ok((rig, unused))
}

impl CameraFacts for FlightLog {
    fn published(&self, image_topic: &str) -> Result<PublishedCamera, String> {
        self.published_camera(image_topic, image_topic)
    }

    fn rate_hz(&self, image_topic: &str) -> Option<f64> {
        self.topic(image_topic).map(|info| info.rate_hz)
    }
}
