//! Tables of a EuRoC folder: stamps, numbers and names of files between commas.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::ConvertError;
use super::sink::LogSink;
use crate::files::limits::LINE_BYTES;
use crate::flight_log::stamps::text::{StampUnit, WrittenStamp, is_heading, read_stamp};
use crate::geometry::RigidTransform;
use crate::text::without_bom;

/// Shortest step between two images or two poses.
pub(super) const SHORTEST_STEP_NS: i64 = 500_000;
/// Shortest step between two samples of an IMU.
pub(super) const SHORTEST_IMU_STEP_NS: i64 = 50_000;

/// Row of a table with its line and its stamp as written.
pub(super) struct EurocRow {
    line: usize,
    stamp: WrittenStamp,
    sample: EurocSample,
}

/// Samples of a table with stamps in nanoseconds; a note if the table has another unit.
pub(super) fn in_nanoseconds(
    rows: Vec<EurocRow>,
    shortest_step_ns: i64,
    table: &Path,
    name: &str,
    sink: &mut LogSink<'_>,
) -> Result<Vec<(i64, EurocSample)>, ConvertError> {
    let stamps: Vec<WrittenStamp> = rows.iter().map(|row| row.stamp).collect();
    let unit = StampUnit::of(&stamps, StampUnit::Nanoseconds, shortest_step_ns);
    if unit != StampUnit::Nanoseconds {
        sink.note(format!("the stamps of {name}/data.csv are in {}, which are converted to nanoseconds", unit.name()));
    }
    let sample = |row: EurocRow| {
        let stamp_ns = unit.nanoseconds(row.stamp).filter(|stamp_ns| *stamp_ns >= 0);
        let problem = || format!("a stamp of {} {}, which no clock has", row.stamp / 1_000_000_000, unit.name());
        Ok((stamp_ns.ok_or_else(|| bad_line(row.line, problem(), table))?, row.sample))
    };
    rows.into_iter().map(sample).collect()
}

/// Row of any sensor.
pub(super) enum EurocSample {
    Imu {
        angular_velocity_rad_per_s: Vector3<f64>,
        specific_force_m_per_s2: Vector3<f64>,
    },
    Image {
        camera: usize,
        name: String,
    },
    Pose {
        source: usize,
        world_from_imu: RigidTransform,
    },
    /// One angle per joint of the rig.
    Joints {
        angles_rad: Vec<f64>,
    },
}

/// Calls `visit` with the line number and the cells of each row of a table, without comments and empty lines.
pub(super) fn for_each_row(
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
    let mut numbers = [0.0; N];
    read_numbers(line, row, &mut numbers, table)?;
    Ok(numbers)
}

/// Reads as many numbers after the stamp as there are places for them.
fn read_numbers(line: usize, row: &[&str], numbers: &mut [f64], table: &Path) -> Result<(), ConvertError> {
    let count = numbers.len();
    let cells = row.get(1..=count).ok_or_else(|| {
        bad_line(line, format!("{} numbers after the stamp, expected {count}", row.len().saturating_sub(1)), table)
    })?;
    for (number, cell) in numbers.iter_mut().zip(cells) {
        let value = cell.parse::<f64>().ok().filter(|value| value.is_finite());
        *number = value.ok_or_else(|| bad_line(line, format!("'{cell}' is not a finite number"), table))?;
    }
    Ok(())
}

pub(super) fn read_joints(table: &Path, joints: usize) -> Result<Vec<EurocRow>, ConvertError> {
    let mut rows = Vec::new();
    for_each_row(table, |line, row| {
        let mut angles_rad = vec![0.0; joints];
        read_numbers(line, row, &mut angles_rad, table)?;
        rows.push(EurocRow { line, stamp: stamp_of(line, row, table)?, sample: EurocSample::Joints { angles_rad } });
        Ok(())
    })?;
    Ok(rows)
}

pub(super) fn read_imu(table: &Path) -> Result<Vec<EurocRow>, ConvertError> {
    let mut rows = Vec::new();
    for_each_row(table, |line, row| {
        let [wx, wy, wz, ax, ay, az] = numbers(line, row, table)?;
        let sample = EurocSample::Imu {
            angular_velocity_rad_per_s: Vector3::new(wx, wy, wz),
            specific_force_m_per_s2: Vector3::new(ax, ay, az),
        };
        rows.push(EurocRow { line, stamp: stamp_of(line, row, table)?, sample });
        Ok(())
    })?;
    Ok(rows)
}

pub(super) fn read_images(table: &Path, camera: usize) -> Result<Vec<EurocRow>, ConvertError> {
    let mut rows = Vec::new();
    for_each_row(table, |line, row| {
        let name = row.get(1).filter(|name| !name.is_empty());
        let name = name.ok_or_else(|| bad_line(line, "no file name after the stamp", table))?;
        let sample = EurocSample::Image { camera, name: (*name).to_owned() };
        rows.push(EurocRow { line, stamp: stamp_of(line, row, table)?, sample });
        Ok(())
    })?;
    Ok(rows)
}

/// Reads poses of a sensor in the world (`p x y z`, `q w x y z`), transformed to the IMU.
pub(super) fn read_poses(
    table: &Path,
    source: usize,
    sensor_from_imu: &RigidTransform,
) -> Result<Vec<EurocRow>, ConvertError> {
    let mut rows = Vec::new();
    for_each_row(table, |line, row| {
        let [x, y, z, qw, qx, qy, qz] = numbers(line, row, table)?;
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        if (quaternion.norm() - 1.0).abs() > 0.1 {
            return Err(bad_line(line, format!("a quaternion of norm {:.3}, expected 1", quaternion.norm()), table));
        }
        let world_from_sensor = RigidTransform::new(UnitQuaternion::new_normalize(quaternion), Vector3::new(x, y, z));
        let sample = EurocSample::Pose { source, world_from_imu: world_from_sensor * *sensor_from_imu };
        rows.push(EurocRow { line, stamp: stamp_of(line, row, table)?, sample });
        Ok(())
    })?;
    Ok(rows)
}
