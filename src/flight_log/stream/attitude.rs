//! Conversion of the gimbal's attitude to samples of all joints.

use std::sync::Arc;

use nalgebra::UnitQuaternion;

use super::super::log::relative_ns;
use super::super::messages::{self, AttitudeLayout};
use super::super::{FlightLog, LogError, LogWarning, Magnitude, WarningKind};
use super::ordered::{Decoder, Lookup, MessageSource, OrderedSamples};
use super::read_context::{ReadContext, Refusal};
use crate::files::FileError;
use crate::flight_log::joints::attitude;
use crate::flight_log::joints::attitude::{MAX_VEHICLE_GAP_NS, TransformMerge, TransformPath, rotation_between};
use crate::flight_log::stamps::clock::StampClock;
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::gimbal::{InverseChain, InverseSolution};
use crate::sensors::{AttitudeMessage, AttitudeSource, AttitudeValue, GimbalRig, JointSample};

/// Smallest reported rotation that the joints cannot reach: noise and inaccurate chains stay below it.
const UNREACHABLE_RAD: f64 = 0.035;
/// Stretches of reported samples that are closer together than this are merged.
const STRETCH_NS: i64 = 1_000_000_000;
/// Reading of the vehicle's attitude starts this much earlier than reading of the gimbal's attitude.
const VEHICLE_MARGIN_NS: i64 = 1_200_000_000;
/// Times before the wanted start at which reading is tried, to find a sample that does not depend on earlier ones;
/// after these it starts at the beginning of the log.
const EARLIER_NS: [i64; 4] = [0, 4_000_000_000, 16_000_000_000, 64_000_000_000];

/// Samples of all joints in time order, computed by inverting the rig's chain.
///
/// A sample depends on the one before it near a singularity, and where the limits admit two solutions. Reading starts
/// with a sample that depends on none, or with the log, so that the samples do not depend on the start of reading.
pub(super) struct AttitudeJoints {
    gimbal: GimbalReadings,
    vehicle: Option<Lookup<UnitQuaternion<f64>>>,
    source: AttitudeSource,
    inverse: InverseChain,
    timeshift_ns: i64,
    previous_rad: Option<Vec<f64>>,
    unreachable: Stretch,
    without_vehicle: Stretch,
    topic: String,
    /// Topics and warnings that belong to the start of the log.
    warnings: Vec<(String, String)>,
}

/// Readings of the gimbal in time order.
enum GimbalReadings {
    Messages(OrderedSamples<AttitudeValue>),
    Transforms { samples: OrderedSamples<Vec<MovedTransform>>, merge: TransformMerge, ended: bool },
}

/// Reading of one of the transforms of a path.
type MovedTransform = (usize, i64, UnitQuaternion<f64>);

/// Consecutive samples with the same problem.
#[derive(Debug, Default)]
struct Stretch {
    /// First and last stamp, and the largest value.
    open: Option<(i64, i64, f64)>,
}

impl AttitudeJoints {
    pub(super) fn new(
        log: &Arc<FlightLog>,
        gimbal: &GimbalRig,
        source: &AttitudeSource,
        topic: &str,
        from_ns: i64,
    ) -> Result<Self, LogError> {
        for earlier_ns in EARLIER_NS {
            let start_ns = from_ns.saturating_sub(earlier_ns);
            let joints = Self::from(log, gimbal, source, topic, start_ns)?;
            let decided = start_ns <= 0 || {
                let mut first = Self::from(log, gimbal, source, topic, start_ns)?;
                let mut context = ReadContext::new(Arc::clone(log));
                first.next_solution(&mut context).is_none_or(|(_, solution)| solution.decided)
            };
            if decided {
                return Ok(joints);
            }
        }
        Self::from(log, gimbal, source, topic, i64::MIN / 4)
    }

    fn from(
        log: &FlightLog,
        gimbal: &GimbalRig,
        source: &AttitudeSource,
        topic: &str,
        from_ns: i64,
    ) -> Result<Self, LogError> {
        let info = log.require_topic(attitude::topic_field(gimbal), topic, attitude::gimbal_kinds(gimbal))?;
        let layout = log.attitude_layout(attitude::topic_field(gimbal), info)?;
        let mut warnings = Vec::new();
        let readings = if let AttitudeMessage::Transforms { parent, child } = &source.message {
            let path = TransformPath::find(log, topic, parent, child)?;
            let decoder = transform_decoder(path.clone(), log.epoch_ns(), StampClock::of_rig(gimbal.use_log_time));
            let samples = OrderedSamples::new(log, topic, from_ns, false, decoder).with_equal_stamps();
            GimbalReadings::Transforms { samples, merge: TransformMerge::new(path), ended: false }
        } else {
            let clock = match StampClock::of_rig(gimbal.use_log_time) {
                StampClock::Stamps => StampClock::of(log, topic, layout.kind)?,
                given => given,
            };
            warnings.extend(clock.warning(topic).map(|warning| (topic.to_owned(), warning)));
            GimbalReadings::Messages(OrderedSamples::new(log, topic, from_ns, false, value_decoder(layout, clock)))
        };
        let vehicle = match attitude::vehicle_topic(log, source)? {
            None => None,
            Some((vehicle, layout)) => {
                let clock = StampClock::of(log, vehicle, layout.kind)?;
                warnings.extend(clock.warning(vehicle).map(|warning| (vehicle.to_owned(), warning)));
                let decoder = vehicle_decoder(source.clone(), layout, clock);
                // The gimbal's stamps may be shifted back relative to these, and its messages recorded later.
                let shift_ns = ns_from_seconds(gimbal.timeshift_gimbal_imu_s).min(0);
                let from_ns = from_ns.saturating_add(shift_ns).saturating_sub(VEHICLE_MARGIN_NS);
                Some(Lookup::new(OrderedSamples::new(log, vehicle, from_ns, false, decoder)))
            }
        };
        let inverse = gimbal.inverse_chain().ok_or_else(|| FileError::Rig {
            field: "gimbal.links".to_owned(),
            problem: format!("{} links, expected one to three with gimbal.source", gimbal.joints.len()),
            path: log.path().to_owned(),
        })?;
        Ok(Self {
            gimbal: readings,
            vehicle,
            source: source.clone(),
            inverse,
            timeshift_ns: ns_from_seconds(gimbal.timeshift_gimbal_imu_s),
            previous_rad: None,
            unreachable: Stretch::default(),
            without_vehicle: Stretch::default(),
            topic: topic.to_owned(),
            warnings,
        })
    }

    /// Next sample, `None` at the end of the log.
    pub(super) fn next(&mut self, context: &mut ReadContext) -> Option<JointSample> {
        for (topic, warning) in self.warnings.drain(..) {
            context.warn(WarningKind::Stamps, &topic, 0, warning);
        }
        let Some((stamp_ns, solution)) = self.next_solution(context) else {
            self.report_unreachable(context, i64::MAX);
            self.report_without_vehicle(context, i64::MAX);
            return None;
        };
        self.report_unreachable(context, stamp_ns);
        self.report_without_vehicle(context, stamp_ns);
        if solution.unreachable_rad > UNREACHABLE_RAD {
            self.unreachable.add(stamp_ns, solution.unreachable_rad);
        }
        Some(JointSample { stamp_ns, angles_rad: solution.joint_angles_rad })
    }

    fn next_solution(&mut self, context: &mut ReadContext) -> Option<(i64, InverseSolution)> {
        loop {
            let (recorded_ns, value) = self.gimbal.next(context)?;
            let stamp_ns = recorded_ns.saturating_add(self.timeshift_ns);
            let attitude = self.vehicle.as_mut().and_then(|vehicle| {
                let [before, after] = vehicle.around(context, stamp_ns);
                rotation_between(before, after, stamp_ns, MAX_VEHICLE_GAP_NS)
            });
            let Some(imu_from_camera) = self.source.imu_from_camera(&value, attitude.as_ref()) else {
                self.without_vehicle.add(stamp_ns, 0.0);
                continue;
            };
            let solution = self.inverse.solve(&imu_from_camera, self.previous_rad.as_deref());
            self.previous_rad = Some(solution.joint_angles_rad.clone());
            return Some((stamp_ns, solution));
        }
    }

    fn report_unreachable(&mut self, context: &mut ReadContext, now_ns: i64) {
        let Some((first_ns, last_ns, largest_rad)) = self.unreachable.ended_before(now_ns) else { return };
        let message = format!(
            "{}: up to {:.1}° of the attitude from {:.3} s to {:.3} s cannot be reached by the \
             joints within their limits; the nearest joint angles are used (check gimbal.source, links and limits)",
            self.topic,
            largest_rad.to_degrees(),
            seconds_from_ns(first_ns),
            seconds_from_ns(last_ns)
        );
        let warning = LogWarning::new(WarningKind::UnreachableAttitude, &self.topic, first_ns, message);
        context.warnings.push(warning.until(last_ns).with_magnitude(Magnitude::Radians(largest_rad)));
    }

    fn report_without_vehicle(&mut self, context: &mut ReadContext, now_ns: i64) {
        let Some((first_ns, last_ns, _)) = self.without_vehicle.ended_before(now_ns) else { return };
        // The topics of a log seldom begin and end together.
        if last_ns.saturating_sub(first_ns.max(0)) < MAX_VEHICLE_GAP_NS {
            return;
        }
        let message = format!(
            "{}: attitudes from {:.3} s to {:.3} s are not used: {} has none within {:.1} s, or no heading",
            self.topic,
            seconds_from_ns(first_ns),
            seconds_from_ns(last_ns),
            self.source.vehicle_topic.as_deref().unwrap_or("the vehicle"),
            seconds_from_ns(MAX_VEHICLE_GAP_NS)
        );
        let length = Magnitude::Seconds(seconds_from_ns(last_ns - first_ns));
        let warning = LogWarning::new(WarningKind::NoVehicleAttitude, &self.topic, first_ns, message);
        context.warnings.push(warning.until(last_ns).with_magnitude(length));
    }
}

impl Stretch {
    fn add(&mut self, stamp_ns: i64, value: f64) {
        let (first_ns, _, largest) = self.open.unwrap_or((stamp_ns, stamp_ns, value));
        self.open = Some((first_ns, stamp_ns, largest.max(value)));
    }

    /// Returns the stretch if it ended long enough before a stamp.
    fn ended_before(&mut self, now_ns: i64) -> Option<(i64, i64, f64)> {
        self.open.take_if(|(_, last_ns, _)| now_ns.saturating_sub(*last_ns) > STRETCH_NS)
    }
}

impl GimbalReadings {
    fn next(&mut self, context: &mut ReadContext) -> Option<(i64, AttitudeValue)> {
        let (samples, merge, ended) = match self {
            Self::Messages(samples) => return samples.next(context),
            Self::Transforms { samples, merge, ended } => (samples, merge, ended),
        };
        loop {
            if let Some((stamp_ns, rotation)) = merge.pop() {
                return Some((stamp_ns, AttitudeValue::Rotation(rotation)));
            }
            if *ended {
                return None;
            }
            if let Some((_, moved)) = samples.next(context) {
                for (transform, stamp_ns, rotation) in moved {
                    merge.push(transform, stamp_ns, rotation);
                }
            } else {
                *ended = true;
                merge.finish();
            }
        }
    }
}

fn value_decoder(layout: AttitudeLayout, clock: StampClock) -> Decoder<AttitudeValue> {
    Box::new(move |source: MessageSource<'_>| {
        let message =
            messages::read_gimbal_attitude(layout, source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let refusal = || Refusal { reason: "not an attitude", detail: "not finite, or a zero quaternion".into() };
        let value = message.content.ok_or_else(refusal)?;
        Ok((clock.stamp_ns(message.stamp_ns, source.position.log_time_ns), value))
    })
}

fn vehicle_decoder(rig: AttitudeSource, layout: AttitudeLayout, clock: StampClock) -> Decoder<UnitQuaternion<f64>> {
    Box::new(move |source: MessageSource<'_>| {
        let (stamp_ns, rotation) = attitude::read_vehicle(&rig, layout, source.data)
            .map_err(|detail| Refusal { reason: "it is no attitude of the vehicle", detail })?;
        Ok((clock.stamp_ns(stamp_ns, source.position.log_time_ns), rotation))
    })
}

/// Reads the transforms of the path from a message; messages without one are skipped.
fn transform_decoder(path: TransformPath, epoch_ns: i64, clock: StampClock) -> Decoder<Vec<MovedTransform>> {
    Box::new(move |source: MessageSource<'_>| {
        let entries = messages::read_transforms(source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let mut moved = Vec::new();
        let mut first_ns = None;
        for entry in entries {
            let Some(transform) = path.moving(entry.child) else { continue };
            let rotation = entry.rotation.ok_or_else(|| Refusal {
                reason: "not a rotation",
                detail: "not finite, or a zero quaternion".into(),
            })?;
            let stamp_ns = clock.stamp_ns(entry.stamp_ns, source.position.log_time_ns);
            first_ns.get_or_insert(stamp_ns);
            moved.push((transform, relative_ns(stamp_ns, epoch_ns), rotation));
        }
        let first_ns = first_ns.ok_or_else(Refusal::unneeded)?;
        Ok((first_ns, moved))
    })
}
