//! Rigs that a log without one may belong to, and the sensors that a log lacks for any rig.

use crate::flight_log::RigOfLog as _;
use std::path::{Path, PathBuf};

use super::super::{FlightLog, MessageKind};
use crate::files::rig::Document;
use crate::files::rig::kalibr;
use crate::sensors::{CameraMount, Rig};
use crate::text::{counted, log_name};

/// Largest number of rig files that are read in a folder.
const MAX_FILES: usize = 60;
/// Largest number of entries of a folder that are looked at.
const MAX_ENTRIES: usize = 5000;

/// Rig file that fits a log, or the reason why it does not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RigCandidate {
    pub path: PathBuf,
    /// True for a camera chain of Kalibr or OpenVINS.
    pub is_kalibr: bool,
    /// Cameras and joints of the rig, or the reason why the log cannot be read with it.
    pub description: Result<String, String>,
}

/// True for the name of a rig: `*.rig.yaml`, `rig.yaml`, or a camera chain of Kalibr or OpenVINS.
pub fn is_rig_name(path: &Path) -> bool {
    let name = log_name(path).to_ascii_lowercase();
    let is_yaml = [".yaml", ".yml"].iter().any(|ending| name.ends_with(ending));
    is_yaml && (name.contains("rig.y") || kalibr::is_chain_name(&name))
}

/// True if a file has one of the names of the IMU of this camera chain, in the same folder.
pub fn is_imu_file_of(path: &Path, camera_chain: &Path) -> bool {
    kalibr::is_chain_name(&log_name(camera_chain).to_ascii_lowercase())
        && kalibr::imu_files(camera_chain).iter().any(|file| file == path)
}

/// Rigs in these folders, those that fit the log first; each file is listed once.
pub fn rig_candidates(log: &FlightLog, folders: &[PathBuf]) -> Vec<RigCandidate> {
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in folders {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok).take(MAX_ENTRIES);
        let mut found: Vec<PathBuf> =
            entries.map(|entry| entry.path()).filter(|path| is_rig_name(path) && path.is_file()).collect();
        found.sort();
        found.retain(|path| !files.contains(path));
        files.extend(found);
    }
    let mut candidates: Vec<RigCandidate> =
        files.into_iter().take(MAX_FILES).map(|path| candidate(log, path)).collect();
    candidates.sort_by_key(|candidate| candidate.description.is_err());
    candidates
}

fn candidate(log: &FlightLog, path: PathBuf) -> RigCandidate {
    let is_kalibr = Document::read(&path).is_ok_and(|document| kalibr::is_camera_chain(&document.value));
    let description = Rig::for_log(log, Some(&path)).map_err(|error| error.to_string()).and_then(|rig| {
        let missing = missing_topics(log, &rig);
        if missing.is_empty() { Ok(described(&rig)) } else { Err(format!("not in the log: {}", missing.join(", "))) }
    });
    RigCandidate { path, is_kalibr, description }
}

/// Topics of the rig's IMU and cameras that the log lacks.
fn missing_topics(log: &FlightLog, rig: &Rig) -> Vec<String> {
    let topics = std::iter::once(&rig.imu.topic).chain(rig.cameras.iter().map(|camera| &camera.topic));
    topics.filter(|topic| log.topic(topic).is_none()).cloned().collect()
}

fn described(rig: &Rig) -> String {
    let gimballed = rig.cameras.iter().filter(|camera| camera.mount == CameraMount::Gimbal).count();
    let cameras = counted(rig.cameras.len(), "camera");
    let gimbal = match &rig.gimbal {
        Some(gimbal) if gimballed > 0 => {
            let names: Vec<&str> = gimbal.joints.iter().map(|joint| joint.name.as_str()).collect();
            format!("{gimballed} on a gimbal with joints {}", names.join(", "))
        }
        _ => "rigid".to_owned(),
    };
    let assumed = match rig.assumed.len() {
        0 => String::new(),
        count => format!("; {} assumed, not measured", counted(count, "value")),
    };
    format!("{cameras}, {gimbal}{assumed}")
}

/// Sensors that a log lacks for every rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MissingSensors {
    pub imu: bool,
    pub images: bool,
}

/// Sensors without which nothing can be estimated from the log; `None` if it has both.
pub fn missing_sensors(log: &FlightLog) -> Option<MissingSensors> {
    let missing = MissingSensors {
        imu: log.topics_of(&[MessageKind::Imu]).is_empty(),
        images: log.topics_of(&MessageKind::IMAGES).is_empty(),
    };
    (missing.imu || missing.images).then_some(missing)
}

impl std::fmt::Display for MissingSensors {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(match (self.imu, self.images) {
            (true, true) => {
                "it has neither images nor an IMU: record both (sensor_msgs/msg/Image or CompressedImage, \
                             sensor_msgs/msg/Imu), or open the video together with the log of its autopilot"
            }
            (true, false) => {
                "it has images but no IMU: record sensor_msgs/msg/Imu at 100 Hz or more, or open it together \
                              with the log of the autopilot"
            }
            (false, _) => {
                "it has an IMU but no images: open it together with the video (.mp4) of the flight, or record \
                           sensor_msgs/msg/Image or CompressedImage"
            }
        })
    }
}
