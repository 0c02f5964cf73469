//! The zero-velocity update (ZUPT): what a stationary vehicle says about the unknowns of a frame.
//!
//! It is soft, as soft as its detection is sharp: the position is the one of the frame before and the velocity is zero, up to
//! the motion that the images could not have shown at the distance of the scene.

use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::Layout;

/// A frame at which the vehicle is stationary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stationary {
    /// Since when the vehicle has not moved.
    pub(crate) since_ns: i64,
    /// Standard deviation of the position against the frame before, per axis: motion that the images could not have shown.
    pub(crate) position_sigma_m: f64,
    /// Standard deviation of the velocity, per axis.
    pub(crate) velocity_sigma_m_per_s: f64,
}

/// One scalar residual of the zero-velocity update, whitened: an unknown, or its difference from the one of the frame before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ZeroVelocityTerm {
    /// Column with derivative `slope`.
    pub(crate) column: usize,
    /// Column with derivative `-slope`.
    pub(crate) against: Option<usize>,
    /// Residual over its standard deviation.
    pub(crate) residual: f64,
    /// One over the standard deviation.
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

    /// `(p_j − p_i) / σ_p` of the frame `j` at `slot` against the one before it, world frame, one term per axis.
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
