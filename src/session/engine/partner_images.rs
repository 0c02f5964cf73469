//! Images of the other camera of a stereo pair.

use super::frame_camera::TOGETHER_NS;
use crate::flight_log::{FrameStream, SensorFrame};

pub(super) struct PartnerImages {
    stream: FrameStream,
    /// Newest image that was read.
    next: Option<SensorFrame>,
}

impl PartnerImages {
    pub(super) fn new(stream: FrameStream) -> Self {
        Self { stream, next: None }
    }

    /// Image of the same moment as an image of the first camera, `None` without one; the images are asked for in order of
    /// time.
    pub(super) fn of_moment(&mut self, image: &SensorFrame) -> Option<&SensorFrame> {
        let at_ns = stamp_ns(image)?;
        let is_earlier = |next: &SensorFrame| stamp_ns(next).is_none_or(|stamp_ns| stamp_ns < at_ns - TOGETHER_NS);
        while self.next.as_ref().is_none_or(is_earlier) {
            self.next = Some(self.stream.next_frame()?);
        }
        self.next.as_ref().filter(|next| stamp_ns(next).is_some_and(|stamp_ns| stamp_ns <= at_ns + TOGETHER_NS))
    }
}

/// Stamp of an image on the IMU's clock, at its last IMU sample.
fn stamp_ns(frame: &SensorFrame) -> Option<i64> {
    frame.imu.last().map(|last| last.stamp_ns)
}
