//! `covariance.csv`: the covariances of the poses of a trajectory.

use nalgebra::Matrix6;

use super::tables::optional_cell;
use crate::flight_log::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::session::{CalibrationRun, RunRecord};

/// The covariances of the poses of a run, with ground truth also the squared errors over the covariances.
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

/// The covariances of the adjusted poses of an offline calibration.
pub(super) fn covariance_of_calibration(run: &CalibrationRun) -> String {
    let poses = run.outcome.trajectory.iter().filter_map(|pose| {
        let covariance = pose.covariance?.in_world(&pose.world_from_imu.rotation);
        Some((pose.stamp_ns, covariance, None))
    });
    table(poses, false)
}

/// The upper triangle of each covariance as ROS messages have it, position before rotation and both about the axes of the
/// world, and the squared error over it where the table has that column.
fn table(poses: impl Iterator<Item = (i64, Matrix6<f64>, Option<f64>)>, with_nees: bool) -> String {
    const AXES: [(&str, &str); 6] = [("x", "m"), ("y", "m"), ("z", "m"), ("rx", "rad"), ("ry", "rad"), ("rz", "rad")];
    let upper = || (0..AXES.len()).flat_map(|row| (row..AXES.len()).map(move |column| (row, column)));
    let name = |(row, column): (usize, usize)| {
        let ((first, unit), (second, other_unit)) = (AXES[row], AXES[column]);
        let unit = if unit == other_unit { format!("{unit}2") } else { format!("{unit}_{other_unit}") };
        format!("{first}_{second}_{unit}")
    };
    let mut header = vec!["t_s".to_owned()];
    header.extend(upper().map(name));
    header.extend(with_nees.then(|| "nees".to_owned()));
    let mut table = CsvWriter::new(header);
    for (stamp_ns, covariance, nees) in poses {
        let mut row = vec![seconds_cell(stamp_ns)];
        row.extend(upper().map(|place| number_cell(covariance[place])));
        row.extend(with_nees.then(|| optional_cell(nees.as_ref())));
        table.row(row);
    }
    table.into_text()
}
