//! IMU of a log: one topic, or separate topics of gyroscope and accelerometer.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::super::log::relative_ns;
use super::super::messages::{ImuMessage, MessageKind};
use super::super::{FlightLog, LogError, messages};
use super::ordered::{Decoder, MessageSource, OrderedSamples};
use super::read_context::{Drops, ReadContext, Refusal};
use crate::flight_log::imu::filter::{FilteredSample, ImuFilter, Unmeasured, has_forces};
use crate::flight_log::imu::merge::ImuMerge;
use crate::flight_log::stamps::clock::StampClock;
use crate::sensors::{ImuIntrinsics, ImuRig, ImuSample};

/// IMU samples in the order of their stamps, corrected by the rig's scale and misalignment.
pub(super) struct ImuStream {
    source: ImuSource,
    intrinsics: ImuIntrinsics,
}

/// Samples before the correction by the rig.
enum ImuSource {
    /// All six values in each message.
    Together(Box<Measured<ImuSample>>),
    /// Angular velocities and specific forces on separate topics.
    Apart(Box<SeparateSensors>),
}

/// Two topics, merged at the gyroscope's stamps.
struct SeparateSensors {
    gyroscope: Measured<(i64, Vector3<f64>)>,
    accelerometer: OrderedSamples<Vector3<f64>>,
    merge: ImuMerge,
}

/// Samples of a topic without those that no sensor measured.
struct Measured<T> {
    samples: OrderedSamples<T>,
    filter: ImuFilter<T>,
    drops: Drops,
    ended: bool,
}

impl ImuStream {
    /// Reads from a stamp on.
    pub(super) fn new(log: &FlightLog, rig: &ImuRig, from_ns: i64) -> Result<Self, LogError> {
        Self::of_key(log, "imu0", rig, from_ns)
    }

    /// [`Self::new`] for the IMU with a key of the rig.
    pub(super) fn of_key(log: &FlightLog, key: &str, rig: &ImuRig, from_ns: i64) -> Result<Self, LogError> {
        log.require_topic(&format!("{key}.rostopic"), &rig.topic, &[MessageKind::Imu])?;
        let clock = StampClock::of_rig(rig.use_log_time);
        let Some(accelerometer) = &rig.accelerometer_topic else {
            let decoder = sample_decoder(log.epoch_ns(), clock, has_forces(log, &rig.topic));
            let samples = Measured::new(log, &rig.topic, from_ns, decoder);
            return Ok(Self { source: ImuSource::Together(Box::new(samples)), intrinsics: rig.intrinsics });
        };
        log.require_topic(&format!("{key}.accelerometer_rostopic"), accelerometer, &[MessageKind::Imu])?;
        let epoch_ns = log.epoch_ns();
        let mut rate = vector_decoder("angular velocity", |imu| imu.angular_velocity_rad_per_s, clock, None);
        let stamped: Decoder<(i64, Vector3<f64>)> =
            Box::new(move |source| rate(source).map(|(at_ns, rate)| (at_ns, (relative_ns(at_ns, epoch_ns), rate))));
        let zero = has_forces(log, accelerometer).then_some(Unmeasured::ZeroForce);
        let force = vector_decoder("specific force", |imu| imu.specific_force_m_per_s2, clock, zero);
        let sensors = SeparateSensors {
            gyroscope: Measured::new(log, &rig.topic, from_ns, stamped),
            accelerometer: OrderedSamples::new(log, accelerometer, from_ns, false, force),
            merge: ImuMerge::default(),
        };
        Ok(Self { source: ImuSource::Apart(Box::new(sensors)), intrinsics: rig.intrinsics })
    }

    /// Reports the last dropped messages.
    pub(super) fn finish(&mut self, context: &mut ReadContext) {
        match &mut self.source {
            ImuSource::Together(samples) => samples.finish(context),
            ImuSource::Apart(sensors) => {
                sensors.gyroscope.finish(context);
                sensors.accelerometer.finish(context);
            }
        }
    }

    /// Next sample, `None` at the end of the log.
    pub(super) fn next(&mut self, context: &mut ReadContext) -> Option<ImuSample> {
        let measured = match &mut self.source {
            ImuSource::Together(samples) => samples.next(context),
            ImuSource::Apart(sensors) => sensors.next(context),
        };
        measured.map(|sample| self.intrinsics.correct(&sample))
    }
}

impl<T: FilteredSample> Measured<T> {
    fn new(log: &FlightLog, topic: &str, from_ns: i64, decoder: Decoder<T>) -> Self {
        Self {
            samples: OrderedSamples::new(log, topic, from_ns, false, decoder),
            filter: ImuFilter::default(),
            drops: Drops::new(topic),
            ended: false,
        }
    }

    fn next(&mut self, context: &mut ReadContext) -> Option<T> {
        loop {
            match self.filter.pop() {
                Some((sample, None)) => {
                    self.drops.end(context);
                    return Some(sample);
                }
                Some((sample, Some(reason))) => {
                    let refusal = Refusal { reason: reason.reason(), detail: String::new() };
                    self.drops.add(context, sample.stamp_ns(), refusal);
                }
                None if self.ended => return None,
                None => self.push_next(context),
            }
        }
    }

    fn push_next(&mut self, context: &mut ReadContext) {
        if let Some((_, sample)) = self.samples.next(context) {
            self.filter.push(sample);
        } else {
            self.ended = true;
            self.filter.finish();
        }
    }

    fn finish(&mut self, context: &mut ReadContext) {
        self.drops.end(context);
        self.samples.finish(context);
    }
}

impl SeparateSensors {
    fn next(&mut self, context: &mut ReadContext) -> Option<ImuSample> {
        loop {
            if let Some(sample) = self.merge.pop() {
                return Some(sample);
            }
            if self.merge.needs_gyroscope() {
                let (stamp_ns, angular_velocity_rad_per_s) = self.gyroscope.next(context)?;
                self.merge.push_gyroscope(stamp_ns, angular_velocity_rad_per_s);
            } else {
                let (stamp_ns, specific_force_m_per_s2) = self.accelerometer.next(context)?;
                self.merge.push_accelerometer(stamp_ns, specific_force_m_per_s2);
            }
        }
    }
}

/// Decodes samples with all six values; `has_forces` is false for a topic without specific forces.
fn sample_decoder(epoch_ns: i64, clock: StampClock, has_forces: bool) -> Decoder<ImuSample> {
    Box::new(move |source: MessageSource<'_>| {
        let imu = messages::read_imu(source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let (rate, force) = (imu.angular_velocity_rad_per_s, imu.specific_force_m_per_s2);
        if let Some(reason) = Unmeasured::of(&rate, &force, has_forces) {
            let detail = format!("angular velocity {:?}, specific force {:?}", rate.as_slice(), force.as_slice());
            return Err(refusal(reason, detail));
        }
        let absolute_ns = clock.stamp_ns(imu.stamp_ns, source.position.log_time_ns);
        let stamp_ns = relative_ns(absolute_ns, epoch_ns);
        Ok((
            absolute_ns,
            ImuSample { stamp_ns, angular_velocity_rad_per_s: rate, specific_force_m_per_s2: force, unmeasured_s: 0.0 },
        ))
    })
}

/// Decodes one of the two vectors; drivers leave the other one unset. `zero` is the reason that a zero is dropped.
fn vector_decoder(
    name: &'static str,
    value: fn(&ImuMessage) -> Vector3<f64>,
    clock: StampClock,
    zero: Option<Unmeasured>,
) -> Decoder<Vector3<f64>> {
    Box::new(move |source: MessageSource<'_>| {
        let imu = messages::read_imu(source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let vector = value(&imu);
        match Unmeasured::of_vector(&vector, zero) {
            Some(reason) => Err(refusal(reason, format!("{name} {:?}", vector.as_slice()))),
            None => Ok((clock.stamp_ns(imu.stamp_ns, source.position.log_time_ns), vector)),
        }
    })
}

/// Refusal of a message; the values are given where the reason does not.
fn refusal(reason: Unmeasured, values: String) -> Refusal {
    let detail = if reason == Unmeasured::NotFinite { values } else { String::new() };
    Refusal { reason: reason.reason(), detail }
}

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
                Some(before) => before.interpolated(&self.samples[after], end_ns),
                None => self.samples[after],
            };
            imu.push(end);
            self.previous_end = Some(end);
        }
        self.forget_before(end_ns);
        imu
    }
}
