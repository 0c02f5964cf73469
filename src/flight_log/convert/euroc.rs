//! EuRoC/ASL folders: `mav0` with a folder per sensor, each with `data.csv` and `sensor.yaml`.

use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::path::{Component, Path, PathBuf};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::super::MessageTimes;
use super::super::file::kind_of;
use super::super::image_decoding::compressed_format;
use super::super::limits::{LINE_BYTES, LogLimits};
use super::super::stamp_text::{StampUnit, WrittenStamp, is_heading, read_stamp};
use super::super::text::without_bom;
use super::ConvertError;
use super::euroc_sensor::{CameraSensor, IMU_TOPIC, image_topic, rig_of, sensor_pose};
use super::sink::LogSink;
use crate::geometry::RigidTransform;
use crate::sensors::Rig;

/// Sensors with poses, the best ground truth first.
const POSE_FOLDERS: [&str; 3] = ["state_groundtruth_estimate0", "mocap0", "vicon0"];
/// Topic type in the report for image files.
const IMAGE_TYPE: &str = "sensor_msgs/msg/CompressedImage";
const IMU_TYPE: &str = "sensor_msgs/msg/Imu";
const POSE_TYPE: &str = "geometry_msgs/msg/PoseStamped";

/// Folder of the sensors: `mav0` in the source, or the source itself.
pub(super) fn root(source: &Path) -> Option<PathBuf> {
    let has_sensors = |folder: &Path| folder.join("imu0/data.csv").is_file() || folder.join("cam0/data.csv").is_file();
    [source.join("mav0"), source.to_owned()].into_iter().find(|folder| has_sensors(folder))
}

/// Shortest step between two images or two poses.
const SHORTEST_STEP_NS: i64 = 500_000;
/// Shortest step between two samples of an IMU.
const SHORTEST_IMU_STEP_NS: i64 = 50_000;

/// Row of a table with its line and its stamp as written.
struct Row {
    line: usize,
    stamp: WrittenStamp,
    sample: Sample,
}

/// Samples of a table with stamps in nanoseconds; a note if the table has another unit.
fn in_nanoseconds(
    rows: Vec<Row>,
    shortest_step_ns: i64,
    table: &Path,
    name: &str,
    sink: &mut LogSink<'_>,
) -> Result<Vec<(i64, Sample)>, ConvertError> {
    let stamps: Vec<WrittenStamp> = rows.iter().map(|row| row.stamp).collect();
    let unit = StampUnit::of(&stamps, StampUnit::Nanoseconds, shortest_step_ns);
    if unit != StampUnit::Nanoseconds {
        sink.note(format!("the stamps of {name}/data.csv are in {}, which are converted to nanoseconds", unit.name()));
    }
    let sample = |row: Row| {
        let stamp_ns = unit.nanoseconds(row.stamp).filter(|stamp_ns| *stamp_ns >= 0);
        let problem = || format!("a stamp of {} {}, which no clock has", row.stamp / 1_000_000_000, unit.name());
        Ok((stamp_ns.ok_or_else(|| bad_line(row.line, problem(), table))?, row.sample))
    };
    rows.into_iter().map(sample).collect()
}

/// Row of any sensor.
enum Sample {
    Imu { angular_velocity_rad_per_s: Vector3<f64>, specific_force_m_per_s2: Vector3<f64> },
    Image { camera: usize, name: String },
    Pose { source: usize, world_from_imu: RigidTransform },
}

/// Converts a folder into a log and returns its rig if the sensors are described.
pub(super) fn convert(source: &Path, sink: &mut LogSink<'_>) -> Result<Option<Rig>, ConvertError> {
    let Some(root) = root(source) else { return Ok(None) };
    let mut folders = sensor_folders(&root)?;
    let mut samples: Vec<(i64, Sample)> = Vec::new();
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
        } else {
            let mut rows = 0;
            for_each_row(&table, |_, _| {
                rows += 1;
                Ok(())
            })?;
            sink.leave(&format!("/{name}"), "data.csv", rows, "no sensor that the program reads");
        }
    }
    // Stable sort: sensors with equal stamps stay in the order of their names.
    samples.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    let count = samples.len();
    for (index, (stamp_ns, sample)) in samples.into_iter().enumerate() {
        write(stamp_ns, &sample, &cameras, &poses, sink)?;
        sink.progress((index + 1) as f64 / count as f64);
        sink.ensure_running()?;
    }
    let ground_truth = POSE_FOLDERS.into_iter().find(|name| poses.iter().any(|present| present == name));
    Ok(rig_of(source, &root, &cameras, ground_truth.map(pose_topic), sink))
}

fn pose_topic(folder: &str) -> String {
    format!("/{folder}/pose")
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

fn write(
    stamp_ns: i64,
    sample: &Sample,
    cameras: &[CameraSensor],
    poses: &[String],
    sink: &mut LogSink<'_>,
) -> Result<(), ConvertError> {
    let times = MessageTimes { stamp_ns, log_time_ns: stamp_ns };
    match sample {
        Sample::Imu { angular_velocity_rad_per_s, specific_force_m_per_s2 } => {
            sink.writer.write_imu(IMU_TOPIC, "imu0", times, angular_velocity_rad_per_s, specific_force_m_per_s2)?;
            sink.taken(IMU_TOPIC, IMU_TYPE);
        }
        Sample::Image { camera, name } => {
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
        Sample::Pose { source, world_from_imu } => {
            let topic = pose_topic(&poses[*source]);
            sink.writer.write_pose(&topic, "world", times, world_from_imu)?;
            sink.taken(&topic, POSE_TYPE);
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

/// Calls `visit` with the line number and the cells of each row of a table, without comments and empty lines.
fn for_each_row(
    table: &Path,
    mut visit: impl FnMut(usize, &[&str]) -> Result<(), ConvertError>,
) -> Result<(), ConvertError> {
    let mut reader = BufReader::new(File::open(table).map_err(ConvertError::io("read", table))?);
    let mut line = 0;
    let mut is_first = true;
    let mut bytes = Vec::new();
    loop {
        bytes.clear();
        let read = reader.by_ref().take(LINE_BYTES).read_until(b'\n', &mut bytes);
        if read.map_err(ConvertError::io("read", table))? == 0 {
            return Ok(());
        }
        line += 1;
        if bytes.len() as u64 == LINE_BYTES {
            return Err(bad_line(
                line,
                format!("longer than {LINE_BYTES} bytes, expected numbers between commas"),
                table,
            ));
        }
        let text =
            std::str::from_utf8(&bytes).map_err(|error| bad_line(line, format!("not UTF-8 text ({error})"), table))?;
        let text = if line == 1 { without_bom(text) } else { text }.trim();
        if !text.is_empty() && !text.starts_with('#') {
            let cells: Vec<&str> = if text.contains(',') {
                text.split(',').map(str::trim).collect()
            } else {
                text.split_whitespace().collect()
            };
            // A row of names that is no comment.
            let is_heading = std::mem::take(&mut is_first) && is_heading(cells[0]);
            if !is_heading {
                visit(line, &cells)?;
            }
        }
    }
}

fn bad_line(line: usize, problem: impl Into<String>, table: &Path) -> ConvertError {
    ConvertError::Line { line, problem: problem.into(), path: table.to_owned() }
}

fn stamp_of(line: usize, row: &[&str], table: &Path) -> Result<WrittenStamp, ConvertError> {
    let text = row.first().copied().unwrap_or_default();
    let stamp = read_stamp(text).filter(|stamp| *stamp >= 0);
    stamp.ok_or_else(|| bad_line(line, format!("the stamp is '{text}', expected whole nanoseconds"), table))
}

/// First numbers after the stamp.
fn numbers<const N: usize>(line: usize, row: &[&str], table: &Path) -> Result<[f64; N], ConvertError> {
    let cells = row.get(1..=N).ok_or_else(|| {
        bad_line(line, format!("{} numbers after the stamp, expected {N}", row.len().saturating_sub(1)), table)
    })?;
    let mut numbers = [0.0; N];
    for (number, cell) in numbers.iter_mut().zip(cells) {
        let value = cell.parse::<f64>().ok().filter(|value| value.is_finite());
        *number = value.ok_or_else(|| bad_line(line, format!("'{cell}' is not a finite number"), table))?;
    }
    Ok(numbers)
}

fn read_imu(table: &Path) -> Result<Vec<Row>, ConvertError> {
    let mut rows = Vec::new();
    for_each_row(table, |line, row| {
        let [wx, wy, wz, ax, ay, az] = numbers(line, row, table)?;
        let sample = Sample::Imu {
            angular_velocity_rad_per_s: Vector3::new(wx, wy, wz),
            specific_force_m_per_s2: Vector3::new(ax, ay, az),
        };
        rows.push(Row { line, stamp: stamp_of(line, row, table)?, sample });
        Ok(())
    })?;
    Ok(rows)
}

fn read_images(table: &Path, camera: usize) -> Result<Vec<Row>, ConvertError> {
    let mut rows = Vec::new();
    for_each_row(table, |line, row| {
        let name = row.get(1).filter(|name| !name.is_empty());
        let name = name.ok_or_else(|| bad_line(line, "no file name after the stamp", table))?;
        let sample = Sample::Image { camera, name: (*name).to_owned() };
        rows.push(Row { line, stamp: stamp_of(line, row, table)?, sample });
        Ok(())
    })?;
    Ok(rows)
}

/// Reads poses of a sensor in the world (`p x y z`, `q w x y z`), transformed to the IMU.
fn read_poses(table: &Path, source: usize, sensor_from_imu: &RigidTransform) -> Result<Vec<Row>, ConvertError> {
    let mut rows = Vec::new();
    for_each_row(table, |line, row| {
        let [x, y, z, qw, qx, qy, qz] = numbers(line, row, table)?;
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        if (quaternion.norm() - 1.0).abs() > 0.1 {
            return Err(bad_line(line, format!("a quaternion of norm {:.3}, expected 1", quaternion.norm()), table));
        }
        let world_from_sensor = RigidTransform::new(UnitQuaternion::new_normalize(quaternion), Vector3::new(x, y, z));
        let sample = Sample::Pose { source, world_from_imu: world_from_sensor * *sensor_from_imu };
        rows.push(Row { line, stamp: stamp_of(line, row, table)?, sample });
        Ok(())
    })?;
    Ok(rows)
}
