//! Zero-velocity update (ZUPT) of a stationary vehicle.
//!
//! It is soft: position equal to that of the previous frame and zero velocity, up to the motion that the images
//! cannot resolve at the distance of the scene.

use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::Layout;

/// Zero-velocity update of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stationary {
    /// Start of the stationary phase.
    pub(crate) since_ns: i64,
    /// Standard deviation of the position relative to the previous frame, per axis: the resolution of the images.
    pub(crate) position_sigma_m: f64,
    /// Standard deviation of the velocity, per axis.
    pub(crate) velocity_sigma_m_per_s: f64,
}

/// One whitened scalar residual of the zero-velocity update: an unknown, or its difference from that of the
/// previous frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ZeroVelocityTerm {
    /// Column whose derivative is `slope`.
    pub(crate) column: usize,
    /// Column whose derivative is `-slope`, `None` without one.
    pub(crate) against: Option<usize>,
    /// Residual over its standard deviation.
    pub(crate) residual: f64,
    pub(crate) slope: f64,
}

impl Stationary {
    /// `v / σ_v` of the frame at `slot`, world frame, one term per axis.
    pub(crate) fn velocity_terms(&self, layout: Layout, slot: usize, state: &FrameState) -> [ZeroVelocityTerm; 3] {
        let slope = 1.0 / self.velocity_sigma_m_per_s;
        let velocity = state.navigation.velocity_m_per_s;
        let column = layout.velocity_bias(slot).start;
        [0, 1, 2].map(|axis| ZeroVelocityTerm {
            column: column + axis,
            against: None,
            residual: velocity[axis] * slope,
            slope,
        })
    }

    /// `(p_j − p_i) / σ_p` of the frame `j` at `slot` and the previous frame `i`, world frame, one term per axis.
    pub(crate) fn position_terms(&self, layout: Layout, slot: usize, states: &[FrameState]) -> [ZeroVelocityTerm; 3] {
        let slope = 1.0 / self.position_sigma_m;
        let position = |slot: usize| states[slot].navigation.world_from_imu.translation_m;
        let moved = position(slot) - position(slot - 1);
        let column = |slot: usize, axis: usize| layout.pose(slot).start + 3 + axis;
        [0, 1, 2].map(|axis| ZeroVelocityTerm {
            column: column(slot, axis),
            against: Some(column(slot - 1, axis)),
            residual: moved[axis] * slope,
            slope,
        })
    }
}
