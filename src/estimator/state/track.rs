//! Tracks of features through the frames of the window.

use nalgebra::Vector2;

/// An observation of a feature: slot of the frame and pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrackObservation {
    /// Slot of the frame in the window.
    pub(crate) slot: usize,
    /// Measured pixel.
    pub(crate) uv_px: Vector2<f64>,
}

/// Observations of one feature in the solve, the anchor's first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    /// In the order of the slots.
    pub(crate) observations: Vec<TrackObservation>,
}
