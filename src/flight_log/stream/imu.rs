//! IMU of a log: one topic, or separate topics of gyroscope and accelerometer.

use nalgebra::Vector3;

use super::super::imu_merge::ImuMerge;
use super::super::log::relative_ns;
use super::super::messages::{self, ImuMessage, MessageKind};
use super::super::{FlightLog, LogError};
use super::ordered::{Decoder, MessageSource, OrderedSamples, ReadContext, Refusal};
use crate::sensors::{ImuIntrinsics, ImuRig, ImuSample};

/// IMU samples in the order of their stamps, corrected by the rig's scale and misalignment.
pub(super) struct ImuStream {
    source: ImuSource,
    intrinsics: ImuIntrinsics,
}

/// Uncorrected samples.
enum ImuSource {
    /// All six values in each message.
    Together(Box<OrderedSamples<ImuSample>>),
    /// Angular velocities and specific forces on separate topics.
    Apart(Box<SeparateSensors>),
}

/// Two topics, merged at the gyroscope's stamps.
pub(super) struct SeparateSensors {
    gyroscope: OrderedSamples<Vector3<f64>>,
    accelerometer: OrderedSamples<Vector3<f64>>,
    merge: ImuMerge,
}

impl ImuStream {
    /// Reads from a stamp on.
    pub(super) fn new(log: &FlightLog, rig: &ImuRig, from_ns: i64) -> Result<Self, LogError> {
        log.require_topic("imu0.rostopic", &rig.topic, &[MessageKind::Imu])?;
        let Some(accelerometer) = &rig.accelerometer_topic else {
            let decoder = sample_decoder(log.epoch_ns());
            let samples = OrderedSamples::new(log, &rig.topic, from_ns, false, decoder);
            return Ok(Self { source: ImuSource::Together(Box::new(samples)), intrinsics: rig.intrinsics });
        };
        log.require_topic("imu0.accelerometer_rostopic", accelerometer, &[MessageKind::Imu])?;
        let gyroscope = vector_decoder("angular velocity", |imu| imu.angular_velocity_rad_per_s);
        let of_accelerometer = vector_decoder("specific force", |imu| imu.specific_force_m_per_s2);
        let sensors = SeparateSensors {
            gyroscope: OrderedSamples::new(log, &rig.topic, from_ns, false, gyroscope),
            accelerometer: OrderedSamples::new(log, accelerometer, from_ns, false, of_accelerometer),
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
            ImuSource::Together(samples) => samples.next(context).map(|(_, sample)| sample),
            ImuSource::Apart(sensors) => sensors.next(context),
        };
        measured.map(|sample| self.intrinsics.correct(&sample))
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

/// Decodes samples with all six values.
fn sample_decoder(epoch_ns: i64) -> Decoder<ImuSample> {
    Box::new(move |source: MessageSource<'_>| {
        let imu = messages::read_imu(source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let (rate, force) = (imu.angular_velocity_rad_per_s, imu.specific_force_m_per_s2);
        if !rate.iter().chain(&force).all(|number| number.is_finite()) {
            let detail = format!("angular velocity {:?}, specific force {:?}", rate.as_slice(), force.as_slice());
            return Err(Refusal { reason: "values are not finite", detail });
        }
        let stamp_ns = relative_ns(imu.stamp_ns, epoch_ns);
        Ok((imu.stamp_ns, ImuSample { stamp_ns, angular_velocity_rad_per_s: rate, specific_force_m_per_s2: force }))
    })
}

/// Decodes one of the two vectors; drivers leave the other one unset.
fn vector_decoder(name: &'static str, value: fn(&ImuMessage) -> Vector3<f64>) -> Decoder<Vector3<f64>> {
    Box::new(move |source: MessageSource<'_>| {
        let imu = messages::read_imu(source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let vector = value(&imu);
        if !vector.iter().all(|number| number.is_finite()) {
            let detail = format!("{name} {:?}", vector.as_slice());
            return Err(Refusal { reason: "values are not finite", detail });
        }
        Ok((imu.stamp_ns, vector))
    })
}
