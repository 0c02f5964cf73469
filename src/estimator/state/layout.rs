//! Column layout of the window.

use std::ops::Range;

use super::columns::{ColumnBlock, ColumnId, FrameId};
use crate::gimbal::ParameterId;

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

    /// Columns in the order of reports: calibration, joints, poses, velocities and biases, IMU on the gimbal.
    pub(crate) fn report_order(&self) -> Vec<usize> {
        let slots = || 0..self.frames;
        let mut order: Vec<usize> = self.calibration().collect();
        order.extend(slots().flat_map(|slot| self.joints(slot).start..self.joint_motion(slot).end));
        order.extend(slots().flat_map(|slot| self.pose(slot)));
        order.extend(slots().flat_map(|slot| self.velocity_bias(slot)));
        order.extend(slots().flat_map(|slot| self.gimbal_imu(slot)));
        order
    }

    /// Blocks of these columns; `frames` are by slot, and `parameters` by calibration column.
    pub(crate) fn blocks(&self, parameters: &[ParameterId], frames: &[FrameId]) -> Vec<ColumnBlock> {
        let of_frames = |id: fn(FrameId) -> ColumnId, len: usize| frames.iter().map(move |frame| (id(*frame), len));
        let parameters = if self.calibration > 0 { parameters } else { &[] };
        let all = (parameters.iter().map(|parameter| (ColumnId::Calibration(*parameter), 1)))
            .chain(of_frames(ColumnId::Joints, self.joint_block()))
            .chain(of_frames(ColumnId::Pose, POSE))
            .chain(of_frames(ColumnId::VelocityBias, VELOCITY_BIAS))
            .chain(of_frames(ColumnId::GimbalImu, self.gimbal_imu));
        let mut start = 0;
        all.filter(|(_, len)| *len > 0)
            .map(|(id, len)| {
                start += len;
                ColumnBlock { id, start: start - len, len }
            })
            .collect()
    }

    pub(crate) fn total(&self) -> usize {
        self.frames * self.frame_len() + self.calibration
    }
}
