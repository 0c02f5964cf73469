//! Trajectories in TUM's format: `t x y z qx qy qz qw`, seconds and metres.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::error::ExportError;
use super::tables::INTO_STRING;
use crate::geometry::RigidTransform;
use crate::session::RunRecord;
use crate::session::accuracy::StampedPose;

/// Furthest that the norm of a quaternion may lie from one.
const QUATERNION_TOLERANCE: f64 = 1e-2;

/// Absolute header stamp with all its nanoseconds, in seconds.
fn absolute_seconds(epoch_ns: i64, stamp_ns: i64) -> String {
    let absolute_ns = i128::from(epoch_ns) + i128::from(stamp_ns);
    let sign = if absolute_ns < 0 { "-" } else { "" };
    let absolute_ns = absolute_ns.unsigned_abs();
    format!("{sign}{}.{:09}", absolute_ns / 1_000_000_000, absolute_ns % 1_000_000_000)
}

/// The trajectory of a run, one line per estimated frame: pose of the IMU in the estimator's world at the time of the
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
            write!(text, " {number:.9}").expect(INTO_STRING);
        }
        text.push('\n');
    }
    text
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
