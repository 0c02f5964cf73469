//! The unknowns of the window (Eq. 7): where each has its columns, the static calibration, and the camera poses that follow.
//!
//! Values, their steps and their first estimates; no measurement and no solver.

pub(crate) mod calibration;
pub(crate) mod calibrations;
pub(crate) mod camera_pose;
pub(crate) mod frame_state;
pub(crate) mod layout;
pub(crate) mod navigation;
