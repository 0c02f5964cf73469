//! A trajectory of another program: its poses, aligned with the ground truth and evaluated like a run.

use std::sync::atomic::Ordering;

use nalgebra::UnitQuaternion;
use serde::{Serialize, Serializer};

use super::antenna_record::PositionTruth;
use super::run::{NEXT_ID, RunRecord};
use super::trajectory_accuracy::{MAX_POSITION_AGE_NS, TrajectoryEvaluation, evaluate_trajectory};
use crate::geometry::{RigidTransform, seconds_from_ns, vertical_angle};
use crate::sensors::PoseTrack;
use crate::session::accuracy::path_length_m;

/// Trajectory of another program, as in `summary.json`. It has poses only: no calibration, features or residuals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrajectoryLane {
    pub label: String,
    /// The file or topic from which it was read.
    pub source: String,
    /// Poses `world_from_imu` in the trajectory's own world, in time order.
    #[serde(rename = "poses", serialize_with = "pose_count")]
    pub track: PoseTrack,
    /// Path length in metres: of the ground truth at the trajectory's stamps if there is ground truth, else of the
    /// trajectory.
    pub length_m: f64,
    /// Errors against the ground truth.
    #[serde(flatten)]
    pub evaluation: TrajectoryEvaluation,
    /// Reason why there is no accuracy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy_missing: Option<String>,
    /// Unique among runs and trajectories of the process.
    #[serde(skip)]
    pub id: u64,
}

fn pose_count<S: Serializer>(track: &PoseTrack, serializer: S) -> Result<S::Ok, S::Error> {
    track.samples().len().serialize(serializer)
}

impl TrajectoryLane {
    /// A lane of poses within the time of the session, evaluated against the ground truth of the log if there is one.
    pub fn new(label: String, source: String, track: PoseTrack, ground_truth: Option<&PoseTrack>) -> Self {
        let evaluation = ground_truth.map(|actual| evaluate_trajectory(track.samples(), actual)).unwrap_or_default();
        Self::evaluated(label, source, track, evaluation, ground_truth.is_some())
    }

    /// A lane evaluated against antenna positions.
    pub fn against_positions(label: String, source: String, track: PoseTrack, truth: &PositionTruth) -> Self {
        match truth.evaluate(&track) {
            Ok(evaluation) => Self::evaluated(label, source, track, evaluation, true),
            Err(problem) => {
                let lane = Self::evaluated(label, source, track, TrajectoryEvaluation::default(), true);
                Self { accuracy_missing: Some(problem.to_string()), ..lane }
            }
        }
    }

    fn evaluated(
        label: String,
        source: String,
        track: PoseTrack,
        evaluation: TrajectoryEvaluation,
        has_ground_truth: bool,
    ) -> Self {
        let accuracy_missing = match (&evaluation.accuracy, has_ground_truth, evaluation.pairs.is_empty()) {
            (Some(_), _, _) => None,
            (None, false, _) => Some("no ground truth in the log".to_owned()),
            (None, true, true) => Some("no ground truth at its stamps".to_owned()),
            (None, true, false) => Some("too few poses with ground truth to align".to_owned()),
        };
        let length_m = if evaluation.pairs.is_empty() {
            path_length_m(track.samples().iter().map(|sample| &sample.world_from_imu.translation_m))
        } else {
            path_length_m(evaluation.pairs.iter().map(|(_, actual)| &actual.pose.translation_m))
        };
        let id = NEXT_ID.fetch_add(1, Ordering::Relaxed);
        Self { label, source, track, length_m, evaluation, accuracy_missing, id }
    }

    /// Transform from the trajectory's world to the world of the scene: the alignment with the ground truth; without
    /// one, the alignment with a run at the first common frame.
    pub fn world_from_own(&self, run: Option<&RunRecord>) -> RigidTransform {
        let onto_run = || {
            let run = run.filter(|run| run.alignment.is_none())?;
            run.steps.iter().find_map(|step| {
                let newest = step.report.newest()?;
                Some(yaw_and_position(&newest.world_from_imu, &self.track.at(newest.stamp_ns)?))
            })
        };
        self.evaluation.alignment.or_else(onto_run).unwrap_or_default()
    }

    /// Distance between the aligned pose and the ground truth in metres, at the last pose with ground truth at or
    /// before a stamp; `None` without one within 0.5 s.
    pub fn error_m(&self, stamp_ns: i64) -> Option<f64> {
        let now_s = seconds_from_ns(stamp_ns);
        // Stamps in seconds are rounded in the same way as the stamps of the pairs.
        let index = self.evaluation.pairs.partition_point(|(estimate, _)| estimate.stamp_s <= now_s).checked_sub(1)?;
        let recent = now_s - self.evaluation.pairs[index].0.stamp_s <= seconds_from_ns(MAX_POSITION_AGE_NS);
        self.evaluation.error_m(index).filter(|_| recent)
    }
}

/// Rotation about the vertical and translation that align pose `from` with pose `onto`; the identity for equal poses.
pub(super) fn yaw_and_position(onto: &RigidTransform, from: &RigidTransform) -> RigidTransform {
    if onto == from {
        return RigidTransform::default();
    }
    let rotation = onto.rotation * from.rotation.inverse();
    let yaw = vertical_angle(&rotation);
    let rotation = UnitQuaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), yaw);
    RigidTransform::new(rotation, onto.translation_m - rotation * from.translation_m)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::sensors::PoseSample;

    /// A climbing turn of 20 s at 20 Hz.
    fn flight() -> Vec<PoseSample> {
        (0..400_i64)
            .map(|frame| {
                let time_s = frame as f64 * 0.05;
                let position_m = Vector3::new(5.0 * (0.4 * time_s).cos(), 5.0 * (0.4 * time_s).sin(), 0.3 * time_s);
                let rotation = UnitQuaternion::from_euler_angles(0.1, -0.05, 0.4 * time_s);
                let world_from_imu = RigidTransform::new(rotation, position_m);
                PoseSample { stamp_ns: frame * 50_000_000, world_from_imu }
            })
            .collect()
    }

    #[test]
    fn another_world_is_no_error_and_noise_is() {
        let actual = PoseTrack::new(flight());
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.2);
        let other_world = RigidTransform::new(yaw, Vector3::new(10.0, -3.0, 2.0));
        let moved = |error_m: f64| {
            let samples = flight().into_iter().enumerate().map(|(frame, sample)| {
                let error = Vector3::new(0.0, 0.0, if frame % 2 == 0 { error_m } else { -error_m });
                let pose =
                    RigidTransform::new(sample.world_from_imu.rotation, sample.world_from_imu.translation_m + error);
                PoseSample { world_from_imu: other_world * pose, ..sample }
            });
            PoseTrack::new(samples.collect())
        };
        let lane = TrajectoryLane::new("vins".into(), "vins.tum".into(), moved(0.0), Some(&actual));
        assert!(lane.evaluation.accuracy.as_ref().unwrap().ate_max_m < 1e-9);
        assert!((lane.world_from_own(None) * other_world).minus(&RigidTransform::identity()).norm() < 1e-9);
        assert!((lane.length_m - lane.evaluation.accuracy.unwrap().length_m).abs() < 1e-12);

        let lane = TrajectoryLane::new("vins".into(), "vins.tum".into(), moved(0.02), Some(&actual));
        let rmse_m = lane.evaluation.accuracy.as_ref().unwrap().ate_rmse_m;
        assert!((rmse_m - 0.02).abs() < 1e-6, "{rmse_m}");
        assert!((lane.error_m(7_020_000_000).unwrap() - 0.02).abs() < 1e-4);
        assert!(lane.error_m(-1).is_none() && lane.error_m(30_000_000_000).is_none());
        assert_eq!(lane.accuracy_missing, None);
    }

    #[test]
    fn missing_ground_truth_has_a_reason() {
        let reason = |samples: Vec<PoseSample>, actual: Option<&PoseTrack>| {
            TrajectoryLane::new("a".into(), "a".into(), PoseTrack::new(samples), actual).accuracy_missing.unwrap()
        };
        assert_eq!(reason(flight(), None), "no ground truth in the log");
        let later = PoseTrack::new(
            flight()
                .iter()
                .map(|sample| PoseSample { stamp_ns: sample.stamp_ns + 60_000_000_000, ..*sample })
                .collect(),
        );
        assert_eq!(reason(flight(), Some(&later)), "no ground truth at its stamps");
        let actual = PoseTrack::new(flight());
        assert_eq!(reason(flight()[..2].to_vec(), Some(&actual)), "too few poses with ground truth to align");
    }
}
