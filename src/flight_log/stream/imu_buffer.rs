//! IMU samples around the stamps of images, cut at these stamps.

use std::collections::VecDeque;

use crate::sensors::ImuSample;

/// Duration of the IMU samples before the first frame.
pub(super) const FIRST_FRAME_IMU_NS: i64 = 2_000_000_000;

/// Samples not before the previous frame, and the first one after the frame.
#[derive(Debug, Default)]
pub(super) struct FrameImuBuffer {
    pub(super) samples: VecDeque<ImuSample>,
    /// Sample interpolated at the previous frame's end.
    pub(super) previous_end: Option<ImuSample>,
}

impl FrameImuBuffer {
    /// True if the samples reach a stamp.
    pub(super) fn reaches(&self, stamp_ns: i64) -> bool {
        self.samples.back().is_some_and(|last| last.stamp_ns >= stamp_ns)
    }

    /// Drops samples that no later frame needs, except the last one before the stamp.
    pub(super) fn forget_before(&mut self, stamp_ns: i64) {
        while self.samples.get(1).is_some_and(|second| second.stamp_ns <= stamp_ns) {
            self.samples.pop_front();
        }
    }

    /// Removes and returns the samples from the previous frame's end to `end_ns`, both ends interpolated.
    pub(super) fn take(&mut self, end_ns: i64) -> Vec<ImuSample> {
        let start_ns = self.previous_end.map_or(end_ns - FIRST_FRAME_IMU_NS, |previous| previous.stamp_ns);
        let mut imu: Vec<ImuSample> = self.previous_end.into_iter().collect();
        let includes_start = imu.is_empty();
        let inside =
            |stamp_ns: i64| (stamp_ns > start_ns || (includes_start && stamp_ns == start_ns)) && stamp_ns < end_ns;
        imu.extend(self.samples.iter().filter(|sample| inside(sample.stamp_ns)));
        let after = self.samples.iter().position(|sample| sample.stamp_ns >= end_ns);
        if let Some(after) = after {
            let end = match after.checked_sub(1).and_then(|before| self.samples.get(before)) {
                Some(before) => interpolated(before, &self.samples[after], end_ns),
                None => self.samples[after],
            };
            imu.push(end);
            self.previous_end = Some(end);
        }
        self.forget_before(end_ns);
        imu
    }
}

fn fraction_at(from_ns: i64, to_ns: i64, stamp_ns: i64) -> f64 {
    if to_ns > from_ns { (stamp_ns - from_ns) as f64 / (to_ns - from_ns) as f64 } else { 0.0 }
}

fn interpolated(from: &ImuSample, to: &ImuSample, stamp_ns: i64) -> ImuSample {
    let fraction = fraction_at(from.stamp_ns, to.stamp_ns, stamp_ns);
    if fraction >= 1.0 {
        return ImuSample { stamp_ns, ..*to };
    }
    ImuSample {
        stamp_ns,
        angular_velocity_rad_per_s: from.angular_velocity_rad_per_s.lerp(&to.angular_velocity_rad_per_s, fraction),
        specific_force_m_per_s2: from.specific_force_m_per_s2.lerp(&to.specific_force_m_per_s2, fraction),
    }
}
