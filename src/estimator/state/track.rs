//! Tracks of features through the frames of the window.

use nalgebra::Vector2;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrackObservation {
    pub(crate) slot: usize,
    pub(crate) uv_px: Vector2<f64>,
}

/// Observations of one feature in the solve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    /// By ascending slot; the anchor's comes first.
    pub(crate) observations: Vec<TrackObservation>,
}
