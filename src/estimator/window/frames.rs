//! The frames of the window.

use super::standstill::Rest;
use crate::estimator::factors::preintegration::Preintegration;
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::Layout;
use crate::estimator::state::navigation::Matrix15;
use crate::sensors::JointAngles;

/// One frame of the window.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// Number of the image in its camera's stream.
    pub(crate) index: usize,
    /// Its stamp since the log began.
    pub(crate) stamp_ns: i64,
    /// Current estimate.
    pub(crate) state: FrameState,
    /// Where the marginalization prior was linearized, for frames that it holds.
    pub(crate) first_estimate: Option<FrameState>,
    /// What the encoders say.
    pub(crate) encoder: Option<JointAngles>,
    /// Whether the vehicle stands still there.
    pub(crate) rest: Option<Rest>,
    /// Whether it is a keyframe.
    pub(crate) keyframe: bool,
    /// Inertial samples from the frame before it in the window.
    pub(crate) motion: Preintegration,
    /// Square-root information of `motion`, `None` when it is empty.
    pub(crate) motion_information: Option<Matrix15>,
}

impl Frame {
    /// The state at which derivatives are taken: the first estimate while `current` is within `reach_rad` of it, in attitude
    /// and joint angles.
    pub(crate) fn linearization_point<'a>(&'a self, current: &'a FrameState, reach_rad: f64) -> &'a FrameState {
        self.first_estimate.as_ref().filter(|first| current.turn_from_rad(first) <= reach_rad).unwrap_or(current)
    }
}

/// The layout of a window of these frames.
pub(crate) fn layout(frames: &[Frame], calibration: usize) -> Layout {
    let joints = frames.first().map_or(0, |frame| frame.state.joints_rad.len());
    Layout { frames: frames.len(), joints, calibration }
}
