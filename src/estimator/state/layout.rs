//! Column layout of the window.

use std::ops::Range;

/// Length of a pose's block, `[φ, p]`.
pub(crate) const POSE: usize = 6;
/// Length of a velocity-bias block, `[v, b_g, b_a]`.
pub(crate) const VELOCITY_BIAS: usize = 9;

/// Columns of the window: frame by frame `[pose 6 | joints N | velocity and biases 9]`, then the static calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// Number of frames.
    pub(crate) frames: usize,
    /// Number of joints.
    pub(crate) joints: usize,
    /// Number of free calibration parameters.
    pub(crate) calibration: usize,
}

impl Layout {
    pub(crate) fn frame_len(&self) -> usize {
        POSE + self.joints + VELOCITY_BIAS
    }

    pub(crate) fn frame(&self, slot: usize) -> Range<usize> {
        slot * self.frame_len()..(slot + 1) * self.frame_len()
    }

    /// Pose and joints, which move the camera.
    pub(crate) fn camera(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len();
        start..start + POSE + self.joints
    }

    pub(crate) fn pose(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len();
        start..start + POSE
    }

    pub(crate) fn joints(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len() + POSE;
        start..start + self.joints
    }

    pub(crate) fn velocity_bias(&self, slot: usize) -> Range<usize> {
        let start = slot * self.frame_len() + POSE + self.joints;
        start..start + VELOCITY_BIAS
    }

    pub(crate) fn calibration(&self) -> Range<usize> {
        let start = self.frames * self.frame_len();
        start..start + self.calibration
    }

    pub(crate) fn total(&self) -> usize {
        self.frames * self.frame_len() + self.calibration
    }
}
