//! Samples of an IMU, gyroscope and accelerometer each with its own stamps.

use nalgebra::Vector3;

use crate::flight_log::container::DecodedBlock;
use crate::flight_log::imu_filter::{Unmeasured, has_forces};
use crate::flight_log::log::relative_ns;
use crate::flight_log::stamp_clock::StampClock;
use crate::flight_log::{FlightLog, messages, messages::MessageKind};
use crate::log_check::imu::stationary::Stamped;
use crate::sensors::Rig;

/// Samples that are measurements, ordered by stamp.
#[derive(Clone, Debug, Default)]
pub(super) struct ImuSeries {
    pub(super) topic: String,
    pub(super) rates: Vec<Stamped>,
    pub(super) forces: Vec<Stamped>,
}

impl ImuSeries {
    /// Reads the IMU of the rig, or the first one of the log; `None` without any.
    pub(super) fn of(log: &FlightLog, rig: Option<&Rig>) -> Option<Self> {
        let topics = log.topics_of(&[MessageKind::Imu]);
        let named = rig.map(|rig| rig.imu.topic.clone()).filter(|topic| topics.contains(topic));
        let topic = named.or_else(|| topics.first().cloned())?;
        let apart = rig.and_then(|rig| rig.imu.accelerometer_topic.clone()).filter(|topic| topics.contains(topic));
        let force_topic = apart.unwrap_or_else(|| topic.clone());
        let clock = StampClock::of_rig(rig.is_some_and(|rig| rig.imu.use_log_time));
        let has_forces = has_forces(log, &force_topic);
        let mut series = Self { topic, ..Self::default() };
        for block in &log.index().blocks {
            let decoded = DecodedBlock::decode(log.file(), block);
            for message in &decoded.messages {
                let Some(channel) = log.index().channels.get(&message.channel_id) else { continue };
                let (rate, force) = (channel.topic == series.topic, channel.topic == force_topic);
                if !rate && !force {
                    continue;
                }
                let Ok(imu) = messages::read_imu(decoded.bytes(&message.data)) else { continue };
                let stamp_ns = relative_ns(clock.stamp_ns(imu.stamp_ns, message.log_time_ns), log.epoch_ns());
                let (of_rate, of_force) = (&imu.angular_velocity_rad_per_s, &imu.specific_force_m_per_s2);
                let zero = has_forces.then_some(Unmeasured::ZeroForce);
                if (rate && force && Unmeasured::of(of_rate, of_force, has_forces).is_some())
                    || (force && Unmeasured::of_vector(of_force, zero).is_some())
                {
                    continue;
                }
                if rate {
                    series.rates.push((stamp_ns, imu.angular_velocity_rad_per_s));
                }
                if force {
                    series.forces.push((stamp_ns, imu.specific_force_m_per_s2));
                }
            }
        }
        series.order();
        Some(series)
    }

    /// Sorts the samples by stamp; samples that are not finite or repeat a stamp are removed.
    pub(super) fn order(&mut self) {
        for samples in [&mut self.rates, &mut self.forces] {
            let finite = |vector: &Vector3<f64>| vector.iter().all(|value| value.is_finite());
            samples.retain(|(_, vector)| finite(vector));
            samples.sort_by_key(|(stamp_ns, _)| *stamp_ns);
            samples.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
        }
    }
}
