//! Trajectory from the bundle adjustment of the whole flight.

use nalgebra::Vector3;

use super::frame_sets::{FrameSet, ImuBuffer};
use crate::estimator::{NavigationState, PoseCovariance};
use crate::geometry::RigidTransform;
use crate::sensors::ImuNoise;

/// Time between poses in nanoseconds: interpolation between them has an error of at most 0.13 mm at 10 m/s².
const STEP_NS: i64 = 10_000_000;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchPose {
    /// Time in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    /// Pose of the IMU. Position and yaw of the first one are taken from the sliding-window estimator.
    pub world_from_imu: RigidTransform,
    /// Covariance relative to position and yaw of the first pose; `None` for poses that are not adjusted, or if not
    /// requested ([`CalibrationOptions::pose_covariances`](super::CalibrationOptions::pose_covariances)).
    pub covariance: Option<PoseCovariance>,
}

/// Adjusted states with their covariances, and between them poses predicted by the IMU samples since the last one.
pub(super) fn batch_trajectory(
    imu: &ImuBuffer,
    noise: ImuNoise,
    gravity_in_world: &Vector3<f64>,
    frame_sets: &[FrameSet],
    states: &[NavigationState],
    covariances: &[PoseCovariance],
) -> Vec<BatchPose> {
    let mut poses = Vec::new();
    for (place, (frame_set, state)) in frame_sets.iter().zip(states).enumerate() {
        let from_ns = frame_set.stamp_ns;
        poses.push(BatchPose {
            stamp_ns: from_ns,
            world_from_imu: state.world_from_imu,
            covariance: covariances.get(place).copied(),
        });
        let Some(next) = frame_sets.get(place + 1) else { break };
        let between = (1..).map(|step| from_ns + step * STEP_NS).take_while(|stamp_ns| *stamp_ns < next.stamp_ns);
        poses.extend(between.map(|stamp_ns| {
            let motion = imu.integrated(noise, state.bias, from_ns, stamp_ns);
            let world_from_imu = motion.predict(state, gravity_in_world).world_from_imu;
            BatchPose { stamp_ns, world_from_imu, covariance: None }
        }));
    }
    poses
}
