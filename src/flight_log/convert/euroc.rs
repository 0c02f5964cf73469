//! EuRoC/ASL folders: `mav0` with a folder per sensor, each with `data.csv` and `sensor.yaml`.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Component, Path, PathBuf};

use super::super::MessageTimes;
use super::ConvertError;
use super::euroc_sensor::{
    CameraSensor, EUROC_GIMBAL, EUROC_GROUND_TRUTH, IMU_TOPIC, JOINT_TOPIC, image_topic, pose_topic, rig_in, rig_of,
    sensor_pose,
};
use super::euroc_tables::{
    EurocSample, SHORTEST_IMU_STEP_NS, SHORTEST_STEP_NS, for_each_row, in_nanoseconds, read_images, read_imu,
    read_joints, read_poses,
};
use super::sink::LogSink;
use crate::files::LogLimits;
use crate::flight_log::container::file::kind_of;
use crate::flight_log::images::decoding::compressed_format;
use crate::sensors::Rig;

/// Sensors with poses, the best ground truth first.
const POSE_FOLDERS: [&str; 3] = [EUROC_GROUND_TRUTH, "mocap0", "vicon0"];
/// Topic type in the report for image files.
const IMAGE_TYPE: &str = "sensor_msgs/msg/CompressedImage";
const IMU_TYPE: &str = "sensor_msgs/msg/Imu";
const POSE_TYPE: &str = "geometry_msgs/msg/PoseStamped";
const JOINT_TYPE: &str = "sensor_msgs/msg/JointState";

/// Folder of the sensors: `mav0` in the source, or the source itself.
pub(super) fn root(source: &Path) -> Option<PathBuf> {
    let has_sensors = |folder: &Path| folder.join("imu0/data.csv").is_file() || folder.join("cam0/data.csv").is_file();
    [source.join("mav0"), source.to_owned()].into_iter().find(|folder| has_sensors(folder))
}

/// Converts a folder into a log and returns its rig if the sensors are described.
pub(super) fn convert(source: &Path, sink: &mut LogSink<'_>) -> Result<Option<Rig>, ConvertError> {
    let Some(root) = root(source) else { return Ok(None) };
    let rig = rig_in(&root, sink);
    let joint_names = rig.as_ref().map(Rig::joint_names).unwrap_or_default();
    let mut folders = sensor_folders(&root)?;
    let mut samples: Vec<(i64, EurocSample)> = Vec::new();
    let mut cameras: Vec<CameraSensor> = Vec::new();
    let mut poses: Vec<String> = Vec::new();
    folders.retain(|name| {
        root.join(name).join("data.csv").is_file() || {
            sink.note(format!("{name} has no data.csv and is left out"));
            false
        }
    });
    for name in &folders {
        let table = root.join(name).join("data.csv");
        if name == "imu0" {
            samples.extend(in_nanoseconds(read_imu(&table)?, SHORTEST_IMU_STEP_NS, &table, name, sink)?);
        } else if name.starts_with("cam") {
            let camera = cameras.len();
            let first = samples.len();
            let rows = read_images(&table, camera)?;
            samples.extend(in_nanoseconds(rows, SHORTEST_STEP_NS, &table, name, sink)?);
            let stamps_ns: Vec<i64> = samples[first..].iter().map(|(stamp_ns, _)| *stamp_ns).collect();
            cameras.push(CameraSensor { key: name.clone(), folder: root.join(name), stamps_ns });
        } else if POSE_FOLDERS.contains(&name.as_str()) {
            let imu_from_sensor = sensor_pose(&root, name, sink);
            let rows = read_poses(&table, poses.len(), &imu_from_sensor.inverse())?;
            samples.extend(in_nanoseconds(rows, SHORTEST_STEP_NS, &table, name, sink)?);
            poses.push(name.clone());
        } else if name == EUROC_GIMBAL && !joint_names.is_empty() {
            let rows = read_joints(&table, joint_names.len())?;
            samples.extend(in_nanoseconds(rows, SHORTEST_IMU_STEP_NS, &table, name, sink)?);
        } else {
            let mut rows = 0;
            for_each_row(&table, |_, _| {
                rows += 1;
                Ok(())
            })?;
            sink.leave(&format!("/{name}"), "data.csv", rows, "no sensor that the program reads");
        }
    }
    let sensors = FolderSensors { cameras, poses, joint_names };
    // Stable sort: sensors with equal stamps stay in the order of their names.
    samples.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    let count = samples.len();
    for (index, (stamp_ns, sample)) in samples.into_iter().enumerate() {
        write(stamp_ns, &sample, &sensors, sink)?;
        sink.progress((index + 1) as f64 / count as f64);
        sink.ensure_running()?;
    }
    let ground_truth = POSE_FOLDERS.into_iter().find(|name| sensors.poses.iter().any(|present| present == name));
    Ok(rig.or_else(|| rig_of(source, &root, &sensors.cameras, ground_truth.map(pose_topic), sink)))
}

fn sensor_folders(root: &Path) -> Result<Vec<String>, ConvertError> {
    let mut names = Vec::new();
    for entry in fs::read_dir(root).map_err(ConvertError::io("open the folder", root))? {
        let entry = entry.map_err(ConvertError::io("open the folder", root))?;
        if entry.path().is_dir() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// Sensors to which samples refer by number.
struct FolderSensors {
    cameras: Vec<CameraSensor>,
    /// Folders of ground truth, to which poses refer.
    poses: Vec<String>,
    joint_names: Vec<String>,
}

fn write(
    stamp_ns: i64,
    sample: &EurocSample,
    sensors: &FolderSensors,
    sink: &mut LogSink<'_>,
) -> Result<(), ConvertError> {
    let FolderSensors { cameras, poses, joint_names } = sensors;
    let times = MessageTimes { stamp_ns, log_time_ns: stamp_ns };
    match sample {
        EurocSample::Imu { angular_velocity_rad_per_s, specific_force_m_per_s2 } => {
            sink.writer.write_imu(IMU_TOPIC, "imu0", times, angular_velocity_rad_per_s, specific_force_m_per_s2)?;
            sink.taken(IMU_TOPIC, IMU_TYPE);
        }
        EurocSample::Image { camera, name } => {
            let CameraSensor { key, folder, .. } = &cameras[*camera];
            let topic = image_topic(key);
            match read_image_file(&folder.join("data"), name, sink.limits()) {
                Ok((format, bytes)) => {
                    sink.writer.write_compressed_image(&topic, key, times, format, &bytes)?;
                    sink.taken(&topic, IMAGE_TYPE);
                }
                Err(problem) => sink.leave(&topic, IMAGE_TYPE, 1, format!("{name:?} {problem}")),
            }
        }
        EurocSample::Pose { source, world_from_imu } => {
            let topic = pose_topic(&poses[*source]);
            sink.writer.write_pose(&topic, "world", times, world_from_imu)?;
            sink.taken(&topic, POSE_TYPE);
        }
        EurocSample::Joints { angles_rad } => {
            sink.writer.write_joints(JOINT_TOPIC, times, joint_names, angles_rad)?;
            sink.taken(JOINT_TOPIC, JOINT_TYPE);
        }
    }
    Ok(())
}

/// Returns format and bytes of an image in a folder; the error describes the problem.
///
/// The names come from a table of unknown origin: they must not lead out of the folder, and the files must be images.
fn read_image_file(folder: &Path, name: &str, limits: &LogLimits) -> Result<(&'static str, Vec<u8>), String> {
    let mut parts = Path::new(name).components();
    if !(matches!(parts.next(), Some(Component::Normal(_))) && parts.all(|part| matches!(part, Component::Normal(_)))) {
        return Err("leads out of the folder of the images".to_owned());
    }
    let cannot = |error: io::Error| format!("cannot be read: {error}");
    let path = fs::canonicalize(folder.join(name)).map_err(cannot)?;
    if !path.starts_with(fs::canonicalize(folder).map_err(cannot)?) {
        return Err("is a link that leads out of the folder of the images".to_owned());
    }
    let metadata = fs::metadata(&path).map_err(cannot)?;
    if !metadata.is_file() {
        return Err(format!("is {}, no image", kind_of(&metadata)));
    }
    limits
        .check_record("an image", metadata.len(), metadata.len())
        .map_err(|error| format!("is too large: {error}"))?;
    let mut bytes = Vec::new();
    let most = limits.record_bytes(metadata.len());
    File::open(&path).and_then(|file| file.take(most).read_to_end(&mut bytes)).map_err(cannot)?;
    compressed_format(&bytes).map(|format| (format, bytes)).ok_or_else(|| "is neither PNG nor JPEG".to_owned())
}
