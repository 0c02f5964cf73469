//! Named numbers of a run over time: calibration with σ, joint angles, rank, frame statistics.

use crate::flight_log::{LogError, LogWriter, MessageTimes};
use crate::gimbal::ParameterId;
use crate::sensors::Rig;
use crate::session::{RunRecord, StepRecord};

/// Columns of all rows.
pub(super) struct Series {
    /// Parameters of all parameterizations of the run, with the names of their two fields.
    parameters: Vec<(ParameterId, String, String)>,
    joints: Vec<String>,
}

impl Series {
    pub(super) fn new(run: &RunRecord, rig: &Rig) -> Self {
        let names = rig.parameter_names();
        let mut parameters: Vec<(ParameterId, String, String)> = Vec::new();
        for calibration in run.steps.iter().map(|step| &step.report.calibration) {
            for parameter in &calibration.parameters {
                if !parameters.iter().any(|(known, _, _)| known == parameter) {
                    let (name, unit) = (names.name(*parameter), parameter.dimension().unit());
                    parameters.push((*parameter, format!("{name}_{unit}"), format!("{name}_sigma_{unit}")));
                }
            }
        }
        Self { parameters, joints: rig.joint_names() }
    }

    pub(super) fn write(
        &self,
        log: &mut LogWriter,
        names: &Names,
        times: MessageTimes,
        step: &StepRecord,
    ) -> Result<(), LogError> {
        Self::write_frame(log, names, times, step)?;
        Self::write_rank(log, names, times, step)?;
        let Some(newest) = step.report.newest() else { return Ok(()) };
        let calibration = &step.report.calibration;
        let mut row: Vec<(&str, f64)> = Vec::new();
        for (parameter, value_field, sigma_field) in &self.parameters {
            // Parameters of another parameterization have no value in this step.
            let index = calibration.parameters.iter().position(|known| known == parameter);
            let of = |series: &[f64]| index.and_then(|index| series.get(index)).copied().unwrap_or(f64::NAN);
            row.push((value_field, of(&calibration.values)));
            row.push((sigma_field, of(&calibration.sigmas)));
        }
        log.write_row(&names.topic("calibration"), "dcvins_msgs/msg/Calibration", times, &row)?;
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

    fn write_frame(log: &mut LogWriter, names: &Names, times: MessageTimes, step: &StepRecord) -> Result<(), LogError> {
        let (report, statistics) = (&step.report, &step.tracks.statistics);
        let inliers = report.features.iter().filter(|feature| !feature.rejected).count();
        let row = [
            ("tracked", statistics.tracked as f64),
            ("new", statistics.detected as f64),
            ("lost", statistics.lost as f64),
            ("rejected", statistics.rejected as f64),
            ("inliers", inliers as f64),
            ("keyframe", f64::from(u8::from(report.keyframe))),
            ("reprojection_rms_before_px", report.reprojection_rms_before_px),
            ("reprojection_rms_after_px", report.reprojection_rms_after_px),
            ("iterations", report.iterations.len() as f64),
        ];
        log.write_row(&names.topic("frame"), "dcvins_msgs/msg/Frame", times, &row)
    }

    fn write_rank(log: &mut LogWriter, names: &Names, times: MessageTimes, step: &StepRecord) -> Result<(), LogError> {
        let Some(rank) = &step.rank else { return Ok(()) };
        let row = [
            ("columns", rank.parameters.len() as f64),
            ("rank_structural", rank.rank_structural as f64),
            ("rank_informed", rank.rank_informed as f64),
            ("deficit_parameterization", rank.deficit_parameterization as f64),
            ("deficit_joints", rank.deficit_joints as f64),
            ("deficit_absorbed", rank.deficit_absorbed as f64),
            ("deficit_motion", rank.deficit_motion as f64),
            ("largest_singular_value", rank.singular_values.first().copied().unwrap_or(f64::NAN)),
            ("smallest_singular_value", rank.singular_values.last().copied().unwrap_or(f64::NAN)),
            ("structural_threshold", rank.structural_threshold),
            ("informed_threshold", rank.informed_threshold),
        ];
        log.write_row(&names.topic("rank"), "dcvins_msgs/msg/Rank", times, &row)
    }
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
