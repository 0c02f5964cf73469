//! Trajectories in TUM's format: `t x y z qx qy qz qw`, seconds and metres.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};

use super::csv_table::CsvTable;
use super::error::ExportError;
use crate::geometry::RigidTransform;
use crate::session::RunRecord;
use crate::session::accuracy::StampedPose;

/// Maximum deviation of a quaternion's norm from 1.
const QUATERNION_TOLERANCE: f64 = 1e-2;

/// Absolute header stamp in seconds with nanosecond resolution.
fn absolute_seconds(epoch_ns: i64, stamp_ns: i64) -> String {
    let absolute_ns = i128::from(epoch_ns) + i128::from(stamp_ns);
    let sign = if absolute_ns < 0 { "-" } else { "" };
    let absolute_ns = absolute_ns.unsigned_abs();
    format!("{sign}{}.{:09}", absolute_ns / 1_000_000_000, absolute_ns % 1_000_000_000)
}

/// The trajectory of a run, one line per estimated frame: pose of the IMU in the estimator's world at the stamp of the
/// step.
pub fn tum_of_run(run: &RunRecord, epoch_ns: i64) -> String {
    let mut text = String::new();
    for step in &run.steps {
        let Some(newest) = step.report.newest() else { continue };
        let position = newest.world_from_imu.translation_m;
        let rotation = newest.world_from_imu.rotation.quaternion();
        let stamp = absolute_seconds(epoch_ns, newest.stamp_ns);
        let numbers = [position.x, position.y, position.z, rotation.i, rotation.j, rotation.k, rotation.w];
        text.push_str(&stamp);
        for number in numbers {
            write!(text, " {number:.9}").expect("writing into a string cannot fail");
        }
        text.push('\n');
    }
    text
}

/// The trajectory of a run as a table like EuRoC's `state_groundtruth_estimate0`: stamp in nanoseconds, position,
/// orientation (w first) and velocity of the IMU in the estimator's world, gyroscope and accelerometer bias.
pub fn euroc_of_run(run: &RunRecord, epoch_ns: i64) -> String {
    let mut table = CsvTable::new([
        "#timestamp [ns]",
        "p_RS_R_x [m]",
        "p_RS_R_y [m]",
        "p_RS_R_z [m]",
        "q_RS_w []",
        "q_RS_x []",
        "q_RS_y []",
        "q_RS_z []",
        "v_RS_R_x [m s^-1]",
        "v_RS_R_y [m s^-1]",
        "v_RS_R_z [m s^-1]",
        "b_w_RS_S_x [rad s^-1]",
        "b_w_RS_S_y [rad s^-1]",
        "b_w_RS_S_z [rad s^-1]",
        "b_a_RS_S_x [m s^-2]",
        "b_a_RS_S_y [m s^-2]",
        "b_a_RS_S_z [m s^-2]",
    ]);
    for newest in run.steps.iter().filter_map(|step| step.report.newest()) {
        let rotation = newest.world_from_imu.rotation.quaternion();
        let orientation = Vector4::new(rotation.w, rotation.i, rotation.j, rotation.k);
        let stamp_ns = i128::from(epoch_ns) + i128::from(newest.stamp_ns);
        let numbers = newest.world_from_imu.translation_m.iter().chain(&orientation).chain(&newest.velocity_m_per_s);
        let numbers = numbers.chain(&newest.gyroscope_bias_rad_per_s).chain(&newest.accelerometer_bias_m_per_s2);
        let cells = numbers.map(|number| format!("{number:.9}"));
        table.push(std::iter::once(stamp_ns.to_string()).chain(cells));
    }
    table.into_text()
}

/// Reads a TUM trajectory; lines that begin with `#` are comments.
pub fn read_tum(path: &Path) -> Result<Vec<StampedPose>, ExportError> {
    let text = fs::read_to_string(path).map_err(|source| ExportError::Read { source, path: path.to_owned() })?;
    let mut poses = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let bad = |problem: String| ExportError::TrajectoryLine { line: index + 1, problem, path: path.to_owned() };
        let numbers = line
            .split_whitespace()
            .map(|word| {
                word.parse::<f64>()
                    .ok()
                    .filter(|number| number.is_finite())
                    .ok_or_else(|| bad(format!("holds '{word}', which is not a finite number")))
            })
            .collect::<Result<Vec<f64>, _>>()?;
        let &[stamp_s, x, y, z, qx, qy, qz, qw] = numbers.as_slice() else {
            return Err(bad(format!("holds {} numbers", numbers.len())));
        };
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        if (quaternion.norm() - 1.0).abs() > QUATERNION_TOLERANCE {
            return Err(bad(format!("has a quaternion of norm {:.4}, not 1", quaternion.norm())));
        }
        let rotation = UnitQuaternion::new_normalize(quaternion);
        poses.push(StampedPose { stamp_s, pose: RigidTransform::new(rotation, Vector3::new(x, y, z)) });
    }
    if poses.is_empty() {
        return Err(ExportError::NotComparable { problem: format!("no pose in the trajectory: {}", path.display()) });
    }
    poses.sort_by(|a, b| a.stamp_s.total_cmp(&b.stamp_s));
    Ok(poses)
}
