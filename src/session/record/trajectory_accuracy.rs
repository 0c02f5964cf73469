//! Absolute and relative errors of a trajectory against ground truth.

use std::fmt;

use serde::Serialize;

use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::sensors::{PoseSample, PoseTrack};
use crate::session::accuracy::{
    ErrorStatistics, RelativeDelta, StampedPose, TrajectoryAlignment, absolute_errors_m, align, heading_drift_rad,
    path_length_m, relative_errors,
};
use crate::session::antenna::{AntennaAlignment, AntennaPair, antenna_statistics};

/// Alignment of every run and trajectory with the ground truth.
const ALIGNMENT: TrajectoryAlignment = TrajectoryAlignment::YawPosition;

/// Largest difference of stamps between a step and the last antenna position before it, in nanoseconds.
pub(super) const MAX_POSITION_AGE_NS: i64 = 500_000_000;

/// Path lengths of the relative errors, in metres.
pub const RELATIVE_LENGTHS_M: [f64; 3] = [5.0, 10.0, 25.0];

/// Errors of a trajectory that is aligned with the ground truth by yaw and position; `accuracy` in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrajectoryAccuracy {
    /// Alignment of the estimate with the ground truth.
    pub alignment: TrajectoryAlignment,
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
    /// Heading error gained per revolution in degrees, negative if the estimate lags behind the rotation; `None` if the
    /// heading changes by less than half a revolution, or against positions of an antenna.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading_drift_deg_per_turn: Option<f64>,
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
    /// Number of sub-trajectories of this length.
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
        Some(Self {
            rpe: relative.collect(),
            heading_drift_deg_per_turn: heading_drift_rad(pairs).map(f64::to_degrees),
            ..Self::absolute(&errors_m, length_m)
        })
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
            heading_drift_deg_per_turn: None,
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

/// Pairs of poses, their alignment and its errors.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrajectoryEvaluation {
    /// Estimated and ground-truth poses with equal stamps, in seconds since the log began.
    #[serde(skip)]
    pub pairs: Vec<(StampedPose, StampedPose)>,
    /// `true_from_estimate`, a rotation about the vertical and a translation; `None` with too few pairs.
    #[serde(skip)]
    pub alignment: Option<RigidTransform>,
    /// Errors after this alignment.
    pub accuracy: Option<TrajectoryAccuracy>,
}

impl TrajectoryEvaluation {
    /// Distance between the aligned pose and the ground truth of a pair in metres, `None` without an alignment.
    pub fn error_m(&self, pair: usize) -> Option<f64> {
        let (estimate, actual) = self.pairs.get(pair)?;
        Some((self.alignment?.transform(&estimate.pose.translation_m) - actual.pose.translation_m).norm())
    }
}

/// Evaluates a trajectory against ground truth as a run is evaluated: ground truth interpolated at the stamps of the
/// trajectory, aligned by yaw and position.
pub fn evaluate_trajectory(estimate: &[PoseSample], ground_truth: &PoseTrack) -> TrajectoryEvaluation {
    let pair = |sample: &PoseSample| {
        let stamp_s = seconds_from_ns(sample.stamp_ns);
        let actual = ground_truth.at(sample.stamp_ns)?;
        Some((StampedPose { stamp_s, pose: sample.world_from_imu }, StampedPose { stamp_s, pose: actual }))
    };
    let pairs: Vec<_> = estimate.iter().filter_map(pair).collect();
    let alignment = align(&pairs, TrajectoryAlignment::YawPosition).map(|transform| transform.rigid);
    TrajectoryEvaluation { alignment, accuracy: TrajectoryAccuracy::of(&pairs), pairs }
}
