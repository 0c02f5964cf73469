//! Unknowns of a window with sensor columns.

use nalgebra::Vector3;

use super::values::SensorValues;
use crate::estimator::{NavigationState, PoseKnowledge};
use crate::gimbal::{Chain, ParameterId};

/// Trajectory, joints, landmarks and calibration.
#[derive(Clone, Debug)]
pub(super) struct SensorState {
    pub(super) frames: Vec<SensorFrameState>,
    /// Positions in the world, in metres.
    pub(super) landmarks: Vec<Vector3<f64>>,
    pub(super) chain: Chain,
    pub(super) sensors: SensorValues,
}

#[derive(Clone, Debug)]
pub(super) struct SensorFrameState {
    pub(super) navigation: NavigationState,
    pub(super) joints_rad: Vec<f64>,
    /// Unknowns only without encoders; measured by the encoders otherwise.
    pub(super) joint_rates_rad_per_s: Vec<f64>,
}

/// Columns of a window: calibration, then joints, poses, and velocities with biases of all frames. Landmarks have none:
/// they are projected out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    pub(super) chain: usize,
    /// Sensor columns: index among all sensor columns, and parameter.
    pub(super) sensors: Vec<(usize, ParameterId)>,
    pub(super) frames: usize,
    /// Joint angles of a frame and their rates.
    pub(super) joints: usize,
    /// 6, or 0 with known poses.
    pub(super) pose: usize,
    /// Velocity and biases: 9, 3 with known biases, or 0 with known poses.
    pub(super) velocity_bias: usize,
}

impl Columns {
    /// Numbers of columns of a frame's pose, and of its velocity with biases.
    pub(super) fn of_poses(poses: &PoseKnowledge) -> (usize, usize) {
        match poses {
            PoseKnowledge::Known => (0, 0),
            PoseKnowledge::Imu { biases_known: true, .. } => (6, 3),
            PoseKnowledge::Imu { biases_known: false, .. } => (6, 9),
        }
    }

    pub(super) fn calibration(&self) -> usize {
        self.chain + self.sensors.len()
    }

    pub(super) fn joints_at(&self, frame: usize) -> usize {
        self.calibration() + frame * self.joints
    }

    pub(super) fn pose_at(&self, frame: usize) -> usize {
        self.calibration() + self.frames * self.joints + frame * self.pose
    }

    pub(super) fn velocity_bias_at(&self, frame: usize) -> usize {
        self.calibration() + self.frames * (self.joints + self.pose) + frame * self.velocity_bias
    }

    pub(super) fn count(&self) -> usize {
        self.velocity_bias_at(self.frames)
    }
}
