//! Trajectory files: TUM (`t x y z qx qy qz qw`) and EuRoC's tables (`stamp in ns, x, y, z, qw, qx, qy, qz, …`).

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::super::LogError;
use super::RecordedPose;
use crate::flight_log::stamps::text::{StampUnit, WrittenStamp, is_heading, read_stamp};
use crate::text::{shortened, without_bom};

/// Largest file: an hour of poses in steps of 1 ms, with about 100 bytes each.
const MAX_BYTES: u64 = 512 << 20;
/// Maximum deviation of a quaternion's norm from 1.
const QUATERNION_TOLERANCE: f64 = 1e-2;

/// Shortest step between two poses, which are written at up to 1 kHz.
const SHORTEST_STEP_NS: i64 = 500_000;

/// Start of the first line of a trajectory from an offline calibration, which is no independent ground truth.
pub const BATCH_REFERENCE: &str = "# batch reference";

/// True for the reference of an offline calibration; `false` for an unreadable file.
pub fn is_batch_reference(path: &Path) -> bool {
    let mut begin = [0; BATCH_REFERENCE.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut begin));
    read.is_ok() && begin == BATCH_REFERENCE.as_bytes()
}

/// Reads the poses of a trajectory file in the order of their stamps; of several with one stamp the first is kept.
///
/// Lines with commas are a table of EuRoC: stamps in nanoseconds, the quaternion's w first, further columns ignored.
/// Others are TUM: stamps in seconds, the quaternion's w last. Stamps whose steps are not possible in that unit are read
/// in the one in which they are. Lines without a quaternion, or with one of zeros, are positions. Lines that begin with
/// `#` are comments; a first line of names is skipped.
///
/// # Errors
/// When the file cannot be read, a line is no pose, or there is none.
pub fn read_trajectory_file(path: &Path) -> Result<Vec<RecordedPose>, LogError> {
    let failed = |source| LogError::Io { action: "read the trajectory", source, path: path.to_owned() };
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes)).map_err(failed)?;
    let unusable = |problem: String| LogError::Trajectory { problem, path: path.to_owned() };
    if bytes.len() as u64 > MAX_BYTES {
        return Err(unusable(format!(
            "more than {} MiB, expected a trajectory in TUM's or EuRoC's format",
            MAX_BYTES >> 20
        )));
    }
    let no_text = "no text, expected 't x y z qx qy qz qw' on each line (TUM) or a table of EuRoC";
    let text = String::from_utf8(bytes).map_err(|_binary| unusable(no_text.to_owned()))?;
    let at_line = |line: usize, problem: String| LogError::TrajectoryLine { line, problem, path: path.to_owned() };
    let mut rows: Vec<(usize, WrittenPose)> = Vec::new();
    let mut is_euroc = false;
    let lines = (1..).zip(without_bom(&text).lines().map(str::trim));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).peekable();
    let first_cell = |line: &str| line.split([',', ' ', '\t']).next().unwrap_or_default().to_owned();
    if lines.peek().is_some_and(|(_, line)| is_heading(&first_cell(line))) {
        lines.next();
    }
    for (number, line) in lines {
        is_euroc |= line.contains(',');
        let pose = if line.contains(',') { euroc_pose(line) } else { tum_pose(line) };
        rows.push((number, pose.map_err(|problem| at_line(number, problem))?));
    }
    if rows.is_empty() {
        return Err(unusable("no pose in it".to_owned()));
    }
    let stamps: Vec<WrittenStamp> = rows.iter().map(|(_, pose)| pose.stamp).collect();
    let expected = if is_euroc { StampUnit::Nanoseconds } else { StampUnit::Seconds };
    let unit = StampUnit::of(&stamps, expected, SHORTEST_STEP_NS);
    let mut poses = Vec::with_capacity(rows.len());
    for (number, WrittenPose { stamp, position_m, rotation }) in rows {
        let problem = || format!("has a stamp of {} {}, which no clock has", stamp / 1_000_000_000, unit.name());
        let stamp_ns = unit.nanoseconds(stamp).ok_or_else(|| at_line(number, problem()))?;
        poses.push(RecordedPose { stamp_ns, position_m, rotation });
    }
    poses.sort_by_key(|pose| pose.stamp_ns);
    poses.dedup_by_key(|pose| pose.stamp_ns);
    Ok(poses)
}

fn number(word: &str) -> Result<f64, String> {
    let value = word.parse::<f64>().ok().filter(|number| number.is_finite());
    value.ok_or_else(|| format!("holds '{}', which is not a finite number", shortened(word, 40)))
}

/// Pose with its stamp as written.
struct WrittenPose {
    stamp: WrittenStamp,
    position_m: Vector3<f64>,
    rotation: Option<UnitQuaternion<f64>>,
}

fn tum_pose(line: &str) -> Result<WrittenPose, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let numbers = words.iter().map(|word| number(word)).collect::<Result<Vec<f64>, _>>()?;
    let stamp = read_stamp(words[0]).ok_or_else(|| format!("has a stamp of {} s, which no clock has", words[0]))?;
    match numbers.as_slice() {
        &[_, x, y, z] => Ok(WrittenPose { stamp, position_m: Vector3::new(x, y, z), rotation: None }),
        &[_, x, y, z, qx, qy, qz, qw] => {
            let rotation = rotation_of(Quaternion::new(qw, qx, qy, qz))?;
            Ok(WrittenPose { stamp, position_m: Vector3::new(x, y, z), rotation })
        }
        numbers => Err(format!("holds {} numbers", numbers.len())),
    }
}

fn euroc_pose(line: &str) -> Result<WrittenPose, String> {
    let cells: Vec<&str> = line.split(',').map(str::trim).collect();
    // Tables with stamps in seconds are TUM's with commas for some programs and EuRoC's for others.
    let whole = cells[0].bytes().all(|byte| byte.is_ascii_digit() || byte == b'-');
    let stamp = read_stamp(cells[0]).filter(|_| whole).ok_or_else(|| {
        format!(
            "begins with '{}', expected a stamp in whole nanoseconds as in EuRoC's tables with commas (w of the quaternion \
             first); write seconds with spaces instead of commas (TUM, w last)",
            shortened(cells[0], 40)
        )
    })?;
    let numbers = cells[1..].iter().take(7).map(|cell| number(cell)).collect::<Result<Vec<f64>, _>>()?;
    match *numbers.as_slice() {
        [x, y, z] => Ok(WrittenPose { stamp, position_m: Vector3::new(x, y, z), rotation: None }),
        [x, y, z, qw, qx, qy, qz] => {
            let rotation = rotation_of(Quaternion::new(qw, qx, qy, qz))?;
            Ok(WrittenPose { stamp, position_m: Vector3::new(x, y, z), rotation })
        }
        _ => Err(format!("holds {} cells, expected a stamp, x, y, z and qw, qx, qy, qz", cells.len())),
    }
}

/// Attitude, `None` for a quaternion of zeros.
fn rotation_of(quaternion: Quaternion<f64>) -> Result<Option<UnitQuaternion<f64>>, String> {
    let norm = quaternion.norm();
    if norm == 0.0 {
        return Ok(None);
    }
    if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
        return Err(format!("has a quaternion of norm {norm:.4}, not 1"));
    }
    Ok(Some(UnitQuaternion::new_normalize(quaternion)))
}
