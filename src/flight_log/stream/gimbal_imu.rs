//! Samples of the IMU on the gimbal between the images of a camera.

use super::super::{FlightLog, LogError, WarningKind};
use super::gaps::GapWatch;
use super::imu::{FrameImuBuffer, ImuStream};
use super::read_context::ReadContext;
use crate::geometry::ns_from_seconds;
use crate::sensors::{GimbalImuRig, ImuSample};

/// Longest interval between two samples that is integrated, in nanoseconds: within it, a gimbal may rotate by 10° and
/// stop again.
const LONGEST_INTERVAL_NS: i64 = 100_000_000;

/// Reads the IMU on the gimbal, with its stamps on the clock of the vehicle's IMU.
pub(super) struct GimbalImuStream {
    stream: ImuStream,
    buffer: FrameImuBuffer,
    gaps: GapWatch,
    shift_ns: i64,
    ended: bool,
}

impl GimbalImuStream {
    pub(super) fn new(log: &FlightLog, rig: &GimbalImuRig, from_ns: i64) -> Result<Self, LogError> {
        let shift_ns = ns_from_seconds(rig.timeshift_s);
        Ok(Self {
            stream: ImuStream::of_key(log, "imu1", &rig.sensor, from_ns.saturating_sub(shift_ns.abs()))?,
            buffer: FrameImuBuffer::default(),
            gaps: GapWatch::new(WarningKind::ImuGap, &rig.sensor.topic, rig.sensor.rate_hz),
            shift_ns,
            ended: false,
        })
    }

    /// Samples from the previous frame's stamp to this one's, both ends included and interpolated; empty if the topic
    /// has not begun or has ended, or where it has a gap.
    pub(super) fn take(&mut self, context: &mut ReadContext, stamp_ns: i64) -> Vec<ImuSample> {
        self.read_until(context, stamp_ns);
        let begins = self.buffer.previous_end.or_else(|| self.buffer.samples.front().copied());
        if !self.buffer.reaches(stamp_ns) || begins.is_none_or(|first| first.stamp_ns > stamp_ns) {
            self.buffer.previous_end = None;
            self.buffer.samples.retain(|sample| sample.stamp_ns >= stamp_ns);
            return Vec::new();
        }
        let samples = self.buffer.take(stamp_ns);
        let whole = samples.windows(2).all(|pair| pair[1].stamp_ns - pair[0].stamp_ns <= LONGEST_INTERVAL_NS);
        if whole { samples } else { Vec::new() }
    }

    /// Drops samples before a stamp, for images that are skipped.
    pub(super) fn forget_before(&mut self, context: &mut ReadContext, stamp_ns: i64) {
        self.read_until(context, stamp_ns);
        self.buffer.forget_before(stamp_ns);
    }

    /// Reports the last dropped messages and gaps.
    pub(super) fn finish(&mut self, context: &mut ReadContext) {
        self.stream.finish(context);
        self.gaps.finish(context);
    }

    fn read_until(&mut self, context: &mut ReadContext, stamp_ns: i64) {
        while !self.ended && !self.buffer.reaches(stamp_ns) {
            let Some(mut sample) = self.stream.next(context) else {
                self.ended = true;
                return;
            };
            self.gaps.push(context, sample.stamp_ns);
            sample.stamp_ns += self.shift_ns;
            self.buffer.samples.push_back(sample);
        }
    }
}
