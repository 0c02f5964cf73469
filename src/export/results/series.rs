//! Named numbers of a run over time: calibration with σ, joint angles, rank, frame statistics.

use crate::flight_log::{LogError, LogWriter, MessageTimes};
use crate::sensors::Rig;
use crate::session::{RankColumn, RunRecord, StepColumn, StepRecord};
use crate::table::Column;

/// Numbers of the frames and of the ranks that become series.
const FRAME: [&str; 9] = [
    "tracked",
    "new",
    "lost",
    "rejected",
    "inliers",
    "keyframe",
    "reprojection_rms_before_px",
    "reprojection_rms_after_px",
    "iterations",
];
const RANK: [&str; 9] = [
    "columns",
    "rank_structural",
    "rank_informed",
    "deficit_parameterization",
    "deficit_joints",
    "deficit_absorbed",
    "deficit_motion",
    "structural_threshold",
    "informed_threshold",
];

/// Columns of the series of a run, in the order of its rows' cells.
pub(super) struct Series<'a> {
    /// Parameters of all parameterizations of the run, each with its σ.
    parameters: Vec<StepColumn<'a>>,
    frame: Vec<StepColumn<'a>>,
    rank: Vec<RankColumn<'a>>,
    joints: Vec<String>,
}

impl<'a> Series<'a> {
    pub(super) fn new(run: &RunRecord, rig: &Rig) -> Self {
        let mut frame = StepRecord::frame_columns(false);
        frame.retain(|column| FRAME.contains(&&*column.name));
        let mut rank = StepRecord::rank_columns();
        rank.retain(|column| RANK.contains(&&*column.name));
        let ends = [
            RankColumn::new("largest_singular_value", |(_, rank)| rank.singular_values.first().copied()),
            RankColumn::new("smallest_singular_value", |(_, rank)| rank.singular_values.last().copied()),
        ];
        // Before the thresholds.
        rank.splice(RANK.len() - 2..RANK.len() - 2, ends);
        Self {
            parameters: run.parameter_columns(rig).flat_map(|(_, columns)| columns).collect(),
            frame,
            rank,
            joints: rig.joint_names(),
        }
    }

    pub(super) fn write(
        &self,
        log: &mut LogWriter,
        names: &Names,
        times: MessageTimes,
        step: &'a StepRecord,
    ) -> Result<(), LogError> {
        log.write_row(&names.topic("frame"), "dcvins_msgs/msg/Frame", times, &row(&self.frame, step))?;
        if let Some(rank) = &step.rank {
            log.write_row(&names.topic("rank"), "dcvins_msgs/msg/Rank", times, &row(&self.rank, &(step, rank)))?;
        }
        let Some(newest) = step.report.newest() else { return Ok(()) };
        let calibration = row(&self.parameters, step);
        log.write_row(&names.topic("calibration"), "dcvins_msgs/msg/Calibration", times, &calibration)?;
        if !newest.joint_angles_rad.is_empty() && newest.joint_angles_rad.len() == self.joints.len() {
            log.write_joints(&names.topic("joints"), times, &self.joints, &newest.joint_angles_rad)?;
        }
        let (accelerometer, gyroscope) = (newest.accelerometer_bias_m_per_s2, newest.gyroscope_bias_rad_per_s);
        let biases = [
            ("accelerometer_x_m_per_s2", accelerometer.x),
            ("accelerometer_y_m_per_s2", accelerometer.y),
            ("accelerometer_z_m_per_s2", accelerometer.z),
            ("gyroscope_x_rad_per_s", gyroscope.x),
            ("gyroscope_y_rad_per_s", gyroscope.y),
            ("gyroscope_z_rad_per_s", gyroscope.z),
        ];
        log.write_row(&names.topic("biases"), "dcvins_msgs/msg/Biases", times, &biases)
    }
}

/// Numbers of a row by the names of their columns; NaN for a parameter of another parameterization.
fn row<'n, Row>(columns: &'n [Column<'_, Row>], row: &Row) -> Vec<(&'n str, f64)> {
    columns.iter().map(|column| (&*column.name, column.cell(row).number().unwrap_or(f64::NAN))).collect()
}

/// Prefix of the topics and frames of one run.
pub(super) struct Names {
    /// The label; characters that ROS does not allow in a topic are replaced.
    label: String,
}

impl Names {
    pub(super) fn new(label: &str) -> Self {
        let allowed = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
        let label: String = label.chars().map(allowed).collect();
        // The name of a topic must not begin with a digit.
        let digit = label.starts_with(|first: char| first.is_ascii_digit());
        Self { label: if digit || label.is_empty() { format!("run_{label}") } else { label } }
    }

    pub(super) fn topic(&self, name: &str) -> String {
        format!("/{}/{name}", self.label)
    }

    pub(super) fn frame(&self, name: &str) -> String {
        format!("{}/{name}", self.label)
    }
}
