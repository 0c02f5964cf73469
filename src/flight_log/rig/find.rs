use std::path::{Path, PathBuf};

use super::super::{FlightLog, LogError};
use crate::files::FileError;
use crate::files::rig::camera_facts::{CameraFacts, PublishedCamera};
use crate::files::rig::{Document, RigWithUnusedKeys, from_document, from_file};
use crate::sensors::Rig;

/// The rig of a log.
pub trait RigOfLog: Sized {
    /// Finds the rig of a log: the file given by the user, else the one next to the log, else the one attached to it.
    /// Missing intrinsics and image rates are taken from the log.
    fn for_log(log: &FlightLog, explicit: Option<&Path>) -> Result<Self, LogError>;

    /// Returns the rig of [`Self::for_log`], with the paths of the keys in its file that other programs write and that
    /// are not used.
    fn for_log_with_unused_keys(log: &FlightLog, explicit: Option<&Path>) -> Result<(Self, Vec<String>), LogError>;

    /// Finds the ground-truth rig in the same way (`NAME.truth.yaml`, or attached); `None` if there is none.
    fn ground_truth_for_log(log: &FlightLog, explicit: Option<&Path>) -> Result<Option<Self>, LogError>;

    /// Finds the ground truth of this rig, as [`Self::ground_truth_for_log`]. A file that was not asked for is left out if
    /// it belongs to another mechanism, as where one log is run with several rigs.
    ///
    /// # Errors
    ///
    /// If the given file has another number of joints for a camera of this rig.
    fn own_ground_truth(&self, log: &FlightLog, explicit: Option<&Path>) -> Result<Option<Self>, LogError>;
}

impl RigOfLog for Rig {
    fn for_log(log: &FlightLog, explicit: Option<&Path>) -> Result<Self, LogError> {
        Self::for_log_with_unused_keys(log, explicit).map(|(rig, _)| rig)
    }

    fn for_log_with_unused_keys(log: &FlightLog, explicit: Option<&Path>) -> Result<(Self, Vec<String>), LogError> {
        let beside = log.path().with_extension("rig.yaml");
        find(log, explicit, &beside, ".rig.yaml")?
            .ok_or_else(|| LogError::NoRig { beside, path: log.path().to_owned() })
    }

    fn ground_truth_for_log(log: &FlightLog, explicit: Option<&Path>) -> Result<Option<Self>, LogError> {
        let found = find(log, explicit, &log.path().with_extension("truth.yaml"), ".truth.yaml")?;
        Ok(found.map(|(rig, _)| rig))
    }

    fn own_ground_truth(&self, log: &FlightLog, explicit: Option<&Path>) -> Result<Option<Self>, LogError> {
        let Some(truth) = Self::ground_truth_for_log(log, explicit)? else { return Ok(None) };
        let joints = |rig: &Self, key: &str| rig.chain_of_camera(key).map(|chain| chain.joint_count());
        let differs = |key: &&str| joints(&truth, key).is_some_and(|count| joints(self, key) != Some(count));
        let Some(key) = self.cameras.iter().map(|camera| &*camera.key).find(differs) else { return Ok(Some(truth)) };
        let Some(path) = explicit else { return Ok(None) };
        let [given, expected] = [&truth, self].map(|rig| joints(rig, key).unwrap_or(0));
        let problem = format!("{given} joints in the ground truth, {expected} in the rig '{}'", self.name);
        Err(FileError::Rig { field: key.to_owned(), problem, path: path.to_owned() }.into())
    }
}

fn find(
    log: &FlightLog,
    explicit: Option<&Path>,
    beside: &Path,
    ending: &str,
) -> Result<Option<RigWithUnusedKeys>, LogError> {
    if let Some(path) = explicit {
        return Ok(Some(from_file(path, log)?));
    }
    if beside.is_file() {
        return Ok(Some(from_file(beside, log)?));
    }
    let Some((name, content)) = log.attachment(ending) else { return Ok(None) };
    let file = PathBuf::from(format!("{} (attachment {name})", log.path().display()));
    Ok(Some(from_document(&Document::from_bytes(content, &file)?, &Attached(log))?))
}

impl CameraFacts for FlightLog {
    fn published(&self, image_topic: &str) -> Result<PublishedCamera, String> {
        self.published_camera(image_topic, image_topic)
    }

    fn rate_hz(&self, image_topic: &str) -> Option<f64> {
        self.topic(image_topic).map(|info| info.rate_hz)
    }
}

/// Facts of a log, and its attachments.
struct Attached<'a>(&'a FlightLog);

impl CameraFacts for Attached<'_> {
    fn published(&self, image_topic: &str) -> Result<PublishedCamera, String> {
        self.0.published(image_topic)
    }

    fn rate_hz(&self, image_topic: &str) -> Option<f64> {
        self.0.rate_hz(image_topic)
    }

    fn file_beside_rig(&self, name: &str) -> Result<Vec<u8>, String> {
        let attached = self.0.attachment(file_name(name)).map(|(_, content)| content);
        attached.ok_or_else(|| format!("the log has no readable attachment {:?}", file_name(name)))
    }
}

fn file_name(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}
