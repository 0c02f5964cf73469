//! Recordings for the tests of panels and screenshots.

mod flight;
mod images;

pub(crate) use self::flight::{
    FRAME_PERIOD_NS, SAMPLE_FRAMES, first_tracked_frame, rigid_recording, sample_recording, sample_recording_of,
    sensor_recording,
};
pub(crate) use self::images::sample_images;
