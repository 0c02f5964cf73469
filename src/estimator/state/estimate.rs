//! Values of all unknowns of a window.

use super::calibrations::Calibrations;
use super::frame_state::FrameState;
use crate::optimization::Landmark;

/// Values of all unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    /// States by slot.
    pub(crate) frames: Vec<FrameState>,
    /// The static calibration.
    pub(crate) calibration: Calibrations,
    /// Landmarks by camera, in the order of its tracks.
    pub(crate) landmarks: Vec<Vec<Landmark>>,
}
