//! Column layout of the window.

use std::ops::Range;

/// Length of a pose block, `[φ, p]`.
pub(crate) const POSE: usize = 6;
/// Length of a velocity-bias block, `[v, b_g, b_a]`.
pub(crate) const VELOCITY_BIAS: usize = 9;
/// Length of `[v, b_g]`, the part of the velocity-bias block that affects the pose at times other than the stamp.
pub(crate) const ROW_MOTION: usize = 6;

/// Columns of the window: frame by frame `[pose 6 | joint angles N | joint motion | velocity and biases 9 |
/// IMU on the gimbal]`, then the static calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) frames: usize,
    pub(crate) joints: usize,
    /// Number of joint rates and joint accelerations, on which rows of a rolling shutter depend: 2 N, or zero.
    pub(crate) joint_motion: usize,
    /// True if camera poses are evaluated at other times than the stamp, so that they depend on velocity and gyroscope
    /// bias.
    pub(crate) moving_rows: bool,
    /// Number of unknowns of an IMU on the gimbal, `[v, b_g, b_a]`: 9, or zero without one.
    pub(crate) gimbal_imu: usize,
    /// Number of free calibration parameters.
    pub(crate) calibration: usize,
}

impl Layout {
    pub(crate) fn frame_len(&self) -> usize {
        POSE + self.joint_block() + VELOCITY_BIAS + self.gimbal_imu
    }

    pub(crate) fn frame(&self, slot: usize) -> Range<usize> {
        slot * self.frame_len()..(slot + 1) * self.frame_len()
    }

    pub(crate) fn joint_block(&self) -> usize {
        self.joints + self.joint_motion
    }

    /// Columns of pose and joints, on which the camera pose depends; with moving rows also velocity and gyroscope bias.
    pub(crate) fn camera(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len();
        let rows = if self.moving_rows { ROW_MOTION } else { 0 };
        start..start + POSE + self.joint_block() + rows
    }

    pub(crate) fn pose(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len();
        start..start + POSE
    }

    pub(crate) fn joints(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len() + POSE;
        start..start + self.joints
    }

    pub(crate) fn joint_motion(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len() + POSE + self.joints;
        start..start + self.joint_motion
    }

    pub(crate) fn velocity_bias(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len() + POSE + self.joint_block();
        start..start + VELOCITY_BIAS
    }

    /// Columns `[v, b_g, b_a]` of the IMU on the gimbal; empty without one.
    pub(crate) fn gimbal_imu(&self, slot: usize) -> Range<usize> {
        let end = (slot + 1) * self.frame_len();
        end - self.gimbal_imu..end
    }

    pub(crate) fn calibration(&self) -> Range<usize> {
        let start = self.frames * self.frame_len();
        start..start + self.calibration
    }

    /// Elimination order of the columns: velocities and biases from the newest frame back, which are
    /// coupled only with their neighbours, then poses and joints, then the calibration.
    pub(crate) fn elimination_order(&self) -> Vec<usize> {
        let velocities =
            (0..self.frames).rev().flat_map(|slot| self.velocity_bias(slot).start..self.gimbal_imu(slot).end);
        let poses = (0..self.frames).flat_map(|slot| self.pose(slot).start..self.joint_motion(slot).end);
        velocities.chain(poses).chain(self.calibration()).collect()
    }

    pub(crate) fn total(&self) -> usize {
        self.frames * self.frame_len() + self.calibration
    }
}
