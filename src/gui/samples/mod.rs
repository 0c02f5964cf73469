//! Recordings for the tests of panels and screenshots.

mod calibration;
mod images;
mod recording;
mod simulated;
mod yard;

pub(crate) use self::recording::{FRAME_PERIOD_NS, sample_images, sample_recording, sample_recording_of};
pub(crate) use self::simulated::simulated_recording;
pub(crate) use self::yard::{FIRST_TRACKED_FRAME, chain_pose, given_chain, true_chain};
