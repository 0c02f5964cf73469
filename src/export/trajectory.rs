//! Trajectories in TUM's format (`t x y z qx qy qz qw`, seconds and metres) and as tables in EuRoC's format,
//! with the covariances of their poses.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix6, Vector4};

use super::error::ExportError;
use crate::calibration::BatchPose;
use crate::flight_log::{BATCH_REFERENCE, LogError, RecordedPose, read_trajectory_file};
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::session::accuracy::StampedPose;
use crate::session::{CalibrationRun, RunRecord};
use crate::table::{Column, Stamp, csv, csv_text};

/// Columns of EuRoC's `state_groundtruth_estimate0`: stamp, position, orientation, velocity and biases.
pub(super) const EUROC_COLUMNS: [&str; 17] = [
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
];

/// Absolute header stamp in seconds with nanosecond resolution.
fn absolute_seconds(epoch_ns: i64, stamp_ns: i64) -> String {
    let absolute_ns = i128::from(epoch_ns) + i128::from(stamp_ns);
    let sign = if absolute_ns < 0 { "-" } else { "" };
    let absolute_ns = absolute_ns.unsigned_abs();
    format!("{sign}{}.{:09}", absolute_ns / 1_000_000_000, absolute_ns % 1_000_000_000)
}

/// Trajectory of a run, one line per estimated frame: pose of the IMU in the estimator's world at the stamp of the
/// step.
pub fn tum_of_run(run: &RunRecord, epoch_ns: i64) -> String {
    let newest = run.steps.iter().filter_map(|step| step.report.newest());
    tum(newest.map(|newest| (newest.stamp_ns, newest.world_from_imu)), epoch_ns)
}

/// A trajectory of an offline calibration, marked by its first line as a reference.
pub(super) fn tum_of_calibration(poses: &[BatchPose], epoch_ns: i64) -> String {
    let poses = poses.iter().map(|pose| (pose.stamp_ns, pose.world_from_imu));
    format!("{BATCH_REFERENCE} by dcvins calibrate: t x y z qx qy qz qw\n{}", tum(poses, epoch_ns))
}

fn tum(poses: impl Iterator<Item = (i64, RigidTransform)>, epoch_ns: i64) -> String {
    let mut text = String::new();
    for (stamp_ns, pose) in poses {
        let position = pose.translation_m;
        let rotation = pose.rotation.quaternion();
        let stamp = absolute_seconds(epoch_ns, stamp_ns);
        let numbers = [position.x, position.y, position.z, rotation.i, rotation.j, rotation.k, rotation.w];
        text.push_str(&stamp);
        for number in numbers {
            write!(text, " {number:.9}").expect("writing into a string cannot fail");
        }
        text.push('\n');
    }
    text
}

/// Trajectory of a run as a table like EuRoC's `state_groundtruth_estimate0`: stamp in nanoseconds, position,
/// orientation (w first) and velocity of the IMU in the estimator's world, gyroscope and accelerometer bias.
pub fn euroc_of_run(run: &RunRecord, epoch_ns: i64) -> String {
    let rows = run.steps.iter().filter_map(|step| step.report.newest()).map(|newest| {
        let rotation = newest.world_from_imu.rotation.quaternion();
        let orientation = Vector4::new(rotation.w, rotation.i, rotation.j, rotation.k);
        let stamp_ns = i128::from(epoch_ns) + i128::from(newest.stamp_ns);
        let numbers = newest.world_from_imu.translation_m.iter().chain(&orientation).chain(&newest.velocity_m_per_s);
        let numbers = numbers.chain(&newest.gyroscope_bias_rad_per_s).chain(&newest.accelerometer_bias_m_per_s2);
        let cells = numbers.map(|number| format!("{number:.9}"));
        std::iter::once(stamp_ns.to_string()).chain(cells).collect::<Vec<_>>()
    });
    csv_text(EUROC_COLUMNS, rows)
}

/// Reads a trajectory in TUM's or EuRoC's format, see [`read_trajectory_file`]. Every pose must have an attitude.
///
/// # Errors
/// If the file cannot be read, or a line is not a pose.
pub fn read_trajectory(path: &Path) -> Result<Vec<StampedPose>, ExportError> {
    let recorded = read_trajectory_file(path).map_err(|error| match error {
        LogError::Io { source, path, .. } => ExportError::Read { source, path },
        other => ExportError::Log(other),
    })?;
    let stamped = |pose: &RecordedPose| {
        let rotation = pose.rotation?;
        // Whole seconds and their fraction are converted separately: a double resolves the sum only to 240 ns.
        let whole_s = pose.stamp_ns.div_euclid(1_000_000_000) as f64;
        let stamp_s = whole_s + seconds_from_ns(pose.stamp_ns.rem_euclid(1_000_000_000));
        Some(StampedPose { stamp_s, pose: RigidTransform::new(rotation, pose.position_m) })
    };
    recorded.iter().map(stamped).collect::<Option<Vec<_>>>().ok_or_else(|| ExportError::NotComparable {
        problem: format!("the trajectory has positions without attitudes: {}", path.display()),
    })
}

/// Covariances of the poses of a run; with ground truth also the normalized squared errors.
pub(super) fn covariance_csv(run: &RunRecord) -> String {
    let errors = run.pose_errors();
    let poses = run.steps.iter().filter_map(|step| {
        let report = &step.report;
        let covariance = report.newest_pose_covariance?.in_world(&report.newest()?.world_from_imu.rotation);
        let error = errors.binary_search_by_key(&report.stamp_ns, |error| error.stamp_ns).ok();
        Some((report.stamp_ns, covariance, error.and_then(|index| errors[index].nees())))
    });
    table(poses, true)
}

/// Covariances of the adjusted poses of an offline calibration.
pub(super) fn covariance_of_calibration(run: &CalibrationRun) -> String {
    let poses = run.outcome.trajectory.iter().filter_map(|pose| {
        let covariance = pose.covariance?.in_world(&pose.world_from_imu.rotation);
        Some((pose.stamp_ns, covariance, None))
    });
    table(poses, false)
}

/// Stamp, covariance and normalized squared error of a pose.
type CovarianceRow = (i64, Matrix6<f64>, Option<f64>);
type PoseColumn = Column<'static, CovarianceRow>;

/// Upper triangle of each covariance in the order of ROS messages: position before rotation, both about the world axes;
/// with `with_nees` also the normalized squared error.
fn table(poses: impl Iterator<Item = CovarianceRow>, with_nees: bool) -> String {
    const AXES: [(&str, &str); 6] = [("x", "m"), ("y", "m"), ("z", "m"), ("rx", "rad"), ("ry", "rad"), ("rz", "rad")];
    let upper = (0..AXES.len()).flat_map(|row| (row..AXES.len()).map(move |column| (row, column)));
    let name = |(row, column): &(usize, usize)| {
        let ((first, unit), (second, other_unit)) = (AXES[*row], AXES[*column]);
        let unit = if unit == other_unit { format!("{unit}2") } else { format!("{unit}_{other_unit}") };
        format!("{first}_{second}_{unit}")
    };
    let mut columns = vec![PoseColumn::new("t_s", |(stamp_ns, ..)| Stamp(*stamp_ns))];
    columns.extend(PoseColumn::each(upper, name, |(_, covariance, _), place| covariance[*place]));
    columns.extend(with_nees.then(|| PoseColumn::new("nees", |(.., nees)| *nees)));
    csv(&columns, poses)
}
