//! Values of all unknowns of a window.

use super::calibrations::Calibrations;
use super::frame_state::FrameState;
use crate::optimization::Landmark;

#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    /// State of each frame by slot.
    pub(crate) frames: Vec<FrameState>,
    pub(crate) calibration: Calibrations,
    /// Landmarks by camera, in the order of the camera's tracks.
    pub(crate) landmarks: Vec<Vec<Landmark>>,
}
