//! Errors of a run's trajectory and chain against ground truth.

use std::fmt;

use serde::Serialize;

use super::run::RunRecord;
use super::step::StepRecord;
use crate::calibration::ChainDistance;
use crate::geometry::{seconds_from_ns, so3};
use crate::gimbal::ClassicalChain;
use crate::session::accuracy::{
    Alignment, ErrorStatistics, RelativeDelta, StampedPose, absolute_errors_m, align, path_length_m, relative_errors,
};
use crate::session::antenna::{AntennaAlignment, AntennaPair, align_antenna, antenna_errors_m, antenna_statistics};

/// Alignment of every run and trajectory with the ground truth.
const ALIGNMENT: Alignment = Alignment::YawPosition;

const NO_GROUND_TRUTH: &str = "no ground truth for the estimated frames in the log";

/// Largest difference of stamps between a step and the last antenna position before it, in nanoseconds.
pub(super) const MAX_POSITION_AGE_NS: i64 = 500_000_000;

/// Path lengths of the relative errors, in metres.
pub const RELATIVE_LENGTHS_M: [f64; 3] = [5.0, 10.0, 25.0];

/// Errors of a trajectory that is aligned with the ground truth by yaw and position; `accuracy` in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrajectoryAccuracy {
    /// Alignment of the estimate with the ground truth.
    pub alignment: Alignment,
    /// Root mean square of the absolute position error.
    pub ate_rmse_m: f64,
    /// Mean of the absolute position error.
    pub ate_mean_m: f64,
    /// Standard deviation of the absolute position error.
    pub ate_std_m: f64,
    /// Median of the absolute position error.
    pub ate_median_m: f64,
    /// Largest absolute position error.
    pub ate_max_m: f64,
    /// `ate_rmse_m` in percent of `length_m`; zero for a path without length.
    pub ate_percent_of_length: f64,
    /// Length of the ground-truth path over the estimated frames, in metres.
    #[serde(skip)]
    pub length_m: f64,
    /// Relative errors by path length, for lengths that the trajectory has; none against positions of an antenna.
    pub rpe: Vec<RelativeAccuracy>,
    /// Lever arm of the antenna whose positions are the ground truth, `None` for poses of the IMU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub antenna: Option<AntennaAlignment>,
}

/// Relative errors over sub-trajectories of one path length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RelativeAccuracy {
    /// Path length of a sub-trajectory in metres.
    pub delta_m: f64,
    /// Number of sub-trajectories.
    pub pairs: usize,
    /// Root mean square of the translation error.
    pub translation_rmse_m: f64,
    /// Root mean square of the rotation error.
    pub rotation_rmse_deg: f64,
}

impl TrajectoryAccuracy {
    /// Errors of estimated poses against ground truth, `None` with too few pairs to align them.
    pub fn of(pairs: &[(StampedPose, StampedPose)]) -> Option<Self> {
        let transform = align(pairs, ALIGNMENT)?;
        let relative = RELATIVE_LENGTHS_M.into_iter().filter_map(|delta_m| {
            let (translations, rotations) = relative_errors(pairs, &transform, RelativeDelta::Metres(delta_m));
            Some(RelativeAccuracy {
                delta_m,
                pairs: translations.len(),
                translation_rmse_m: ErrorStatistics::of(&translations)?.rmse,
                rotation_rmse_deg: ErrorStatistics::of(&rotations)?.rmse.to_degrees(),
            })
        });
        let length_m = path_length_m(pairs.iter().map(|(_, ground_truth)| &ground_truth.pose.translation_m));
        let errors_m = ErrorStatistics::of(&absolute_errors_m(pairs, &transform))?;
        Some(Self { rpe: relative.collect(), ..Self::absolute(&errors_m, length_m) })
    }

    /// Errors of the antenna position, `None` if there are no pairs.
    pub fn of_antenna(pairs: &[AntennaPair], alignment: &AntennaAlignment) -> Option<Self> {
        let (errors_m, length_m) = antenna_statistics(pairs, alignment)?;
        Some(Self { antenna: Some(*alignment), ..Self::absolute(&errors_m, length_m) })
    }

    fn absolute(errors_m: &ErrorStatistics, length_m: f64) -> Self {
        Self {
            alignment: ALIGNMENT,
            ate_rmse_m: errors_m.rmse,
            ate_mean_m: errors_m.mean,
            ate_std_m: errors_m.std,
            ate_median_m: errors_m.median,
            ate_max_m: errors_m.max,
            ate_percent_of_length: if length_m > 0.0 { 100.0 * errors_m.rmse / length_m } else { 0.0 },
            length_m,
            rpe: Vec::new(),
            antenna: None,
        }
    }
}

/// `ATE 50.0 mm RMSE, 0.120 m max (alignment yaw+position), 0.25 % of 20.0 m`, with the lever arm of an antenna.
impl fmt::Display for TrajectoryAccuracy {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "ATE {} RMSE, {} max (alignment {}), {:.2} % of {:.1} m",
            length_text(self.ate_rmse_m),
            length_text(self.ate_max_m),
            self.alignment.name(),
            self.ate_percent_of_length,
            self.length_m
        )?;
        self.antenna.iter().try_for_each(|antenna| write!(formatter, ", of {antenna}"))
    }
}

/// Millimetres below a decimetre, else metres.
fn length_text(length_m: f64) -> String {
    if length_m < 0.1 { format!("{:.1} mm", 1e3 * length_m) } else { format!("{length_m:.3} m") }
}

impl RunRecord {
    /// Errors of the trajectory: of the poses of the IMU, or of the antenna positions if these are the ground truth.
    ///
    /// # Errors
    /// A message if there is no ground truth or it does not determine the alignment.
    pub fn accuracy(&self) -> Result<TrajectoryAccuracy, String> {
        let Some(truth) = &self.position_truth else {
            let pairs = self.pairs_with_ground_truth();
            let reason = if pairs.is_empty() { NO_GROUND_TRUTH } else { "too few frames with ground truth to align" };
            return TrajectoryAccuracy::of(&pairs).ok_or_else(|| reason.to_owned());
        };
        let pairs = &self.antenna.pairs;
        let alignment = align_antenna(pairs, truth.lever_arm).map_err(|error| error.to_string())?;
        TrajectoryAccuracy::of_antenna(pairs, &alignment).ok_or_else(|| NO_GROUND_TRUTH.to_owned())
    }

    /// Distances in metres between the aligned run and the ground truth at the estimated frames, or at the antenna
    /// positions if these are the ground truth; empty before the alignment.
    pub fn position_errors_m(&self) -> Vec<f64> {
        if self.position_truth.is_some() {
            let errors_m = |alignment| antenna_errors_m(&self.antenna.pairs, alignment);
            return self.antenna.alignment.as_ref().map(errors_m).unwrap_or_default();
        }
        self.steps.iter().filter_map(|step| self.pose_error_m(step)).collect()
    }

    /// The same distance at one step: at its frame, or at the last antenna position at or before it that is at most 0.5
    /// s old.
    pub fn position_error_m(&self, step: &StepRecord) -> Option<f64> {
        if self.position_truth.is_none() {
            return self.pose_error_m(step);
        }
        let alignment = self.antenna.alignment.as_ref()?;
        let stamp_ns = step.report.newest()?.stamp_ns;
        let last = self.antenna.pairs.partition_point(|pair| pair.stamp_ns <= stamp_ns).checked_sub(1)?;
        let pair = self.antenna.pairs.get(last).filter(|pair| stamp_ns - pair.stamp_ns <= MAX_POSITION_AGE_NS)?;
        antenna_errors_m(std::slice::from_ref(pair), alignment).first().copied()
    }

    /// Position error in metres and angle in radians of the pose of a step after the alignment of the whole run; `None`
    /// without a pose or ground truth.
    pub fn aligned_error(&self, step: &StepRecord) -> Option<[f64; 2]> {
        let (alignment, truth) = (self.alignment?, step.ground_truth?);
        let aligned = alignment * step.report.newest()?.world_from_imu;
        let turn = so3::log(&(truth.rotation.inverse() * aligned.rotation));
        Some([(aligned.translation_m - truth.translation_m).norm(), turn.norm()])
    }

    fn pose_error_m(&self, step: &StepRecord) -> Option<f64> {
        let estimate = self.alignment?.transform(&step.report.newest()?.world_from_imu.translation_m);
        Some((estimate - step.ground_truth?.translation_m).norm())
    }

    /// Length of the ground-truth path in metres over the frames with ground truth; `None` without ground truth.
    pub fn true_length_m(&self) -> Option<f64> {
        if self.position_truth.is_some() && !self.antenna.pairs.is_empty() {
            return Some(path_length_m(self.antenna.pairs.iter().map(|pair| &pair.antenna_m)));
        }
        let pairs = self.pairs_with_ground_truth();
        (!pairs.is_empty())
            .then(|| path_length_m(pairs.iter().map(|(_, ground_truth)| &ground_truth.pose.translation_m)))
    }

    /// Estimated and ground-truth `world_from_imu` of each frame that has both.
    pub fn pairs_with_ground_truth(&self) -> Vec<(StampedPose, StampedPose)> {
        self.steps
            .iter()
            .filter_map(|step| {
                let newest = step.report.newest()?;
                let stamp_s = seconds_from_ns(newest.stamp_ns);
                Some((
                    StampedPose { stamp_s, pose: newest.world_from_imu },
                    StampedPose { stamp_s, pose: step.ground_truth? },
                ))
            })
            .collect()
    }

    /// Distance of a chain from a reference over the joint angles of the run's frames, `None` before the first pose.
    pub fn chain_distance(&self, chain: &ClassicalChain, reference: &ClassicalChain) -> Option<ChainDistance> {
        let newest = self.steps.iter().filter_map(|step| step.report.newest());
        ChainDistance::over(chain, reference, newest.map(|newest| &newest.joint_angles_rad))
    }
}
