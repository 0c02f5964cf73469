//! Values of all messages of the topics that the checks use, read in one pass over the log.

pub(super) mod attitude;
pub(super) mod gradient_sums;
pub(super) mod held;
pub(super) mod image_content;
mod imu_samples;
pub(super) mod topic_survey;

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::Vector3;

use self::attitude::{AttitudeSurvey, SolvedAttitude};
use self::gradient_sums::{GradientSums, ImageMeasure, measure};
use self::image_content::{ContentSurvey, is_grouped};
use self::imu_samples::{UnmeasuredStamps, measured};
use self::topic_survey::{Times, TopicSurvey};
use super::statistics::white_sigma;
use crate::files::rig::read::MAX_LIMIT_RAD;
use crate::flight_log::container::DecodedBlock;
use crate::flight_log::grey_levels::GreyLevels;
use crate::flight_log::images::decoding::decode_image;
use crate::flight_log::images::grey_sampling::grey_levels_of_topic;
use crate::flight_log::joints::{JointMerge, JointReading};
use crate::flight_log::log::relative_ns;
use crate::flight_log::messages::frame_and_checksum;
use crate::flight_log::stream::angle_fit::{self, FittedAngle};
use crate::flight_log::{FlightLog, messages, messages::MessageKind};
use crate::geometry::{ns_from_seconds, seconds_from_ns, wrap_angle};
use crate::sensors::{AttitudeSource, GimbalRig, ImuRig, ImuSample, Joint, JointSample, Rig};

/// Maximum number of listed joint names; messages may name more.
const JOINT_NAMES: usize = 64;

/// Number of decoded images per camera, distributed evenly over the log.
const IMAGES_PER_CAMERA: u64 = 60;

/// Half length of the interval of encoder readings to which a parabola is fitted; over longer intervals a stabilized
/// joint does not follow one.
const HALF_BATCH_NS: i64 = 25_000_000;
/// Joint readings farther apart are not interpolated.
const MAX_GAP_NS: i64 = 200_000_000;

/// Lower bound of an encoder's standard deviation.
const MIN_SIGMA_RAD: f64 = 1e-5;

#[derive(Clone, Debug)]
pub(crate) struct SampledImage {
    pub(crate) stamp_ns: i64,
    pub(crate) measure: ImageMeasure,
}

/// Place of a message in its topic.
#[derive(Clone, Copy, Debug)]
struct Place {
    number: u64,
    /// True for images whose sharpness, exposure and texture are measured.
    is_sampled: bool,
    /// True for images whose content is measured.
    is_grouped: bool,
}

/// Data from one pass through the log.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    /// Topics that are read, by name.
    pub(crate) topics: BTreeMap<String, TopicSurvey>,
    /// Topic of the IMU: the rig's, or the first one.
    pub(crate) imu_topic: Option<String>,
    /// All topics of the IMU's type.
    pub(crate) imu_topics: Vec<String>,
    /// Samples of the IMU in the order of their stamps, without those that are no measurement.
    pub(crate) imu: Vec<ImuSample>,
    /// Topic of a separate accelerometer, if the log has it.
    pub(crate) accelerometer_topic: Option<String>,
    /// Stamps and specific forces of that topic in the order of the stamps, without those that are no measurement.
    pub(crate) accelerometer: Vec<(i64, Vector3<f64>)>,
    /// Samples of the IMU on the gimbal in the order of their stamps, without those that are no measurement; empty
    /// without one.
    pub(crate) gimbal_imu: Vec<ImuSample>,
    /// Stamps and specific forces of its separate accelerometer.
    gimbal_accelerometer: Vec<(i64, Vector3<f64>)>,
    /// Messages of the IMU that are no measurement.
    pub(crate) unmeasured: UnmeasuredStamps,
    /// Messages of the encoders in the order of log times.
    pub(crate) joints: Vec<JointReading>,
    /// Angles of all joints at common stamps, ordered by stamp, from the finite readings.
    pub(crate) joint_samples: Vec<JointSample>,
    /// Attitudes from which the joint angles are computed; `None` unless the rig names them.
    pub(crate) attitude: Option<AttitudeSurvey>,
    /// Reason that `attitude` is `None` although the rig names one.
    pub(crate) attitude_problem: Option<String>,
    /// Joint angles of `attitude`.
    pub(crate) solved: Vec<SolvedAttitude>,
    /// Variance of a reading of each joint: the rig's variance, or the variance of its white noise if it is larger.
    encoder_variances_rad2: Vec<f64>,
    /// True for joints whose readings are angles in radians, which repeat after a revolution.
    wraps: Vec<bool>,
    /// Names in the joint messages.
    pub(crate) joint_names: Vec<String>,
    /// Images by camera key.
    pub(crate) images: BTreeMap<String, Vec<SampledImage>>,
    /// Conversion of grey values of 16 bits by camera key.
    pub(crate) grey_levels: BTreeMap<String, Arc<GreyLevels>>,
    /// Sums of the gradients of those images by camera key.
    pub(crate) gradients: BTreeMap<String, GradientSums>,
    /// Measures of the content of some images by camera key.
    pub(crate) content: BTreeMap<String, ContentSurvey>,
    /// Position and damage of each damaged chunk.
    pub(crate) damages: Vec<String>,
}

impl Survey {
    /// Reads the entire log once.
    pub(crate) fn of(log: &FlightLog, rig: Option<&Rig>) -> Self {
        let mut survey = Self::default();
        let imu_topics = log.topics_of(&[MessageKind::Imu]);
        let named = rig.map(|rig| rig.imu.topic.clone()).filter(|topic| imu_topics.contains(topic));
        survey.imu_topic = named.or_else(|| imu_topics.first().cloned());
        survey.imu_topics = imu_topics;
        if let Some(gimbal) = rig.and_then(|rig| rig.gimbal.as_ref()) {
            match AttitudeSurvey::new(log, gimbal) {
                Ok(attitude) => survey.attitude = attitude,
                Err(error) => survey.attitude_problem = Some(error.to_string()),
            }
        }
        let mut counts: BTreeMap<String, u64> = BTreeMap::new();
        let mut keyframes_due: BTreeMap<String, u64> = BTreeMap::new();
        let index = log.index();
        for block in &index.blocks {
            let decoded = DecodedBlock::decode(log.file(), block);
            // The damage of a scanned log was reported when it was opened.
            let reported = !index.from_summary || block.bytes.end > log.file().len();
            if let Some(damage) = decoded.damage.as_ref().filter(|_| !reported) {
                let (first, last) = block.log_time_ns;
                survey.damages.push(format!(
                    "chunk at byte {}, from second {:.3} to {:.3}: {damage}",
                    block.bytes.start,
                    seconds_from_ns(log.since_start(first)),
                    seconds_from_ns(log.since_start(last))
                ));
            }
            for message in &decoded.messages {
                let Some(channel) = index.channels.get(&message.channel_id) else { continue };
                let Some(info) = log.topic(&channel.topic) else { continue };
                let Some(kind) = info.kind else { continue };
                let number = counts.entry(info.topic.clone()).or_default();
                let stride = info.count.div_ceil(IMAGES_PER_CAMERA).max(1);
                let data = decoded.bytes(&message.data);
                // Of a video, only keyframes are sampled: other frames depend on previous ones.
                let is_sampled = if kind.is_video() {
                    let due = keyframes_due.entry(info.topic.clone()).or_default();
                    let sampled = *number >= *due
                        && messages::read_video_packet(kind, data).is_ok_and(|packet| packet.is_keyframe());
                    *due = if sampled { *number + stride } else { *due };
                    sampled
                } else {
                    number.is_multiple_of(stride)
                };
                let is_grouped = if kind.is_video() { is_sampled } else { is_grouped(*number, info.count) };
                let place = Place { number: *number, is_sampled, is_grouped };
                *number += 1;
                survey.take(log, rig, &info.topic, kind, log.since_start(message.log_time_ns), data, place);
            }
        }
        for topic in survey.topics.values_mut() {
            topic.times.sort_by_key(|times| times.log_time_ns);
        }
        if let Some(gimbal) = rig.and_then(|rig| rig.gimbal.as_ref()) {
            survey.set_joints(gimbal);
        }
        let Self { imu, accelerometer, gimbal_imu, gimbal_accelerometer, unmeasured, .. } = &mut survey;
        *gimbal_imu = measured(std::mem::take(gimbal_imu), gimbal_accelerometer, &mut UnmeasuredStamps::default());
        *imu = measured(std::mem::take(imu), accelerometer, unmeasured);
        survey
    }

    /// All joint angles in radians at a time, by a fit to the readings around it; `None` without readings on both
    /// sides.
    pub(crate) fn joint_angles_at(&self, stamp_ns: i64) -> Option<Vec<f64>> {
        Some(self.fitted_angles_at(stamp_ns)?.iter().map(|fitted| fitted.angle_rad).collect())
    }

    /// [`Self::joint_angles_at`] with the variances of the angles.
    pub(crate) fn fitted_angles_at(&self, stamp_ns: i64) -> Option<Vec<FittedAngle>> {
        let before = |time_ns: i64| self.joint_samples.partition_point(|sample| sample.stamp_ns < time_ns);
        let after = before(stamp_ns);
        let start = before(stamp_ns - HALF_BATCH_NS).min(after.checked_sub(1)?);
        let end = before(stamp_ns + HALF_BATCH_NS).max(after + 1);
        let batch = self.joint_samples.get(start..end)?;
        if batch.last()?.stamp_ns - batch.first()?.stamp_ns > MAX_GAP_NS {
            return None;
        }
        let around = &self.joint_samples.get(after)?.angles_rad;
        let angle = |joint: usize| {
            let reading = |sample: &JointSample| {
                let change = sample.angles_rad[joint] - around[joint];
                let change = if self.wraps[joint] { wrap_angle(change) } else { change };
                (seconds_from_ns(sample.stamp_ns - stamp_ns), around[joint] + change)
            };
            let readings: Vec<_> = batch.iter().map(reading).collect();
            angle_fit::fit(&readings, self.encoder_variances_rad2[joint])
        };
        (0..around.len()).map(angle).collect()
    }

    /// Variance of the white noise of each joint's readings, or of their rounding if it is larger, as a ratio of the variance
    /// with which [`Self::fitted_angles_at`] fits them: angles that are computed from attitudes have less noise than the rig
    /// says.
    pub(crate) fn joint_noise_ratios(&self) -> Vec<f64> {
        let ratio = |(joint, variance_rad2): (usize, &f64)| {
            let angles: Vec<f64> = self.joint_samples.iter().map(|sample| sample.angles_rad[joint]).collect();
            let steps = angles.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0);
            let smallest_rad = steps.fold(TAU, f64::min);
            let measured_rad2 = white_sigma(&angles, self.wraps[joint]).powi(2).max(smallest_rad.powi(2) / 12.0);
            (measured_rad2 / variance_rad2).min(1.0)
        };
        self.encoder_variances_rad2.iter().enumerate().map(ratio).collect()
    }

    /// Sets the joint angles of all joints from encoders or attitudes, in IMU time.
    fn set_joints(&mut self, gimbal: &GimbalRig) {
        if let Some(attitude) = &mut self.attitude {
            attitude.finish();
            self.solved = attitude.solve(gimbal);
            self.joints = self.solved.iter().map(|solved| solved.reading.clone()).collect();
        } else {
            let shift_ns = ns_from_seconds(gimbal.timeshift_gimbal_imu_s);
            for reading in &mut self.joints {
                reading.stamp_ns = reading.stamp_ns.saturating_add(shift_ns);
            }
        }
        self.set_joint_samples(gimbal, merged(&self.joints));
    }

    fn set_joint_samples(&mut self, gimbal: &GimbalRig, samples: Vec<JointSample>) {
        let given_rad = gimbal.encoder_sigma_rad.unwrap_or(0.0).max(MIN_SIGMA_RAD);
        let wraps = |joint: usize| samples.iter().all(|sample| is_in_radians(sample.angles_rad[joint]));
        self.wraps = (0..gimbal.joints.len()).map(wraps).collect();
        let variance = |joint: usize| {
            let angles: Vec<f64> = samples.iter().map(|sample| sample.angles_rad[joint]).collect();
            white_sigma(&angles, self.wraps[joint]).max(given_rad).powi(2)
        };
        self.encoder_variances_rad2 = (0..gimbal.joints.len()).map(variance).collect();
        self.joint_samples = samples;
    }

    /// Recomputes the joint angles with another interpretation of the gimbal's attitude than the rig's.
    pub(crate) fn use_source(&mut self, rig: &Rig, source: AttitudeSource, timeshift_s: f64) {
        if let (Some(attitude), Some(gimbal)) = (&self.attitude, &rig.gimbal) {
            let gimbal = GimbalRig { attitude: Some(source), timeshift_gimbal_imu_s: timeshift_s, ..gimbal.clone() };
            self.solved = attitude.solve(&gimbal);
            self.joints = self.solved.iter().map(|solved| solved.reading.clone()).collect();
            self.set_joint_samples(&gimbal, merged(&self.joints));
        }
    }

    #[expect(clippy::too_many_arguments, reason = "the fields of one message")]
    fn take(
        &mut self,
        log: &FlightLog,
        rig: Option<&Rig>,
        topic: &str,
        kind: MessageKind,
        log_time_ns: i64,
        data: &[u8],
        place: Place,
    ) {
        let entry = self
            .topics
            .entry(topic.to_owned())
            .or_insert_with(|| TopicSurvey { topic: topic.to_owned(), ..TopicSurvey::default() });
        let log_times = rig.is_some_and(|rig| rig.uses_log_time(topic))
            || self.attitude.as_ref().is_some_and(|attitude| attitude.counts_log_times(topic));
        let stamp_ns = match messages::stamp_ns(kind, data) {
            Ok(_) if log_times => log_time_ns,
            Ok(absolute_ns) => relative_ns(absolute_ns, log.epoch_ns()),
            Err(error) => return entry.refuse(error.to_string()),
        };
        let (frame, checksum) = match frame_and_checksum(kind, data) {
            Some((frame_id, checksum)) => (entry.frame(frame_id), Some(checksum)),
            None => (0, None),
        };
        entry.times.push(Times { log_time_ns, stamp_ns, checksum, frame });
        if kind == MessageKind::Imu && self.imu_topic.as_deref() == Some(topic) {
            match messages::read_imu(data) {
                Ok(imu) => {
                    let measured = ImuSample {
                        stamp_ns,
                        angular_velocity_rad_per_s: imu.angular_velocity_rad_per_s,
                        specific_force_m_per_s2: imu.specific_force_m_per_s2,
                        unmeasured_s: 0.0,
                    };
                    self.imu.push(rig.map_or(measured, |rig| rig.imu.intrinsics.correct(&measured)));
                }
                Err(error) => entry.refuse(error.to_string()),
            }
        }
        let Some(rig) = rig else { return };
        if let Some(imu) = rig.gimbal_imu.as_ref().filter(|imu| imu.sensor.reads(topic)) {
            let taken = (&mut self.gimbal_imu, &mut self.gimbal_accelerometer);
            if let Err(problem) = take_gimbal_imu(taken, &imu.sensor, topic, stamp_ns, data) {
                entry.refuse(problem);
            }
        }
        if rig.imu.accelerometer_topic.as_deref() == Some(topic) {
            match messages::read_imu(data) {
                Ok(imu) => {
                    self.accelerometer_topic.get_or_insert_with(|| topic.to_owned());
                    let force = rig.imu.intrinsics.correct_specific_force(&imu.specific_force_m_per_s2);
                    self.accelerometer.push((stamp_ns, force));
                }
                Err(error) => entry.refuse(error.to_string()),
            }
        }
        if let Some(attitude) = &mut self.attitude
            && let Err(problem) = attitude.take(topic, stamp_ns, log.epoch_ns(), data)
        {
            entry.refuse(problem);
        }
        let encoders = rig.gimbal.as_ref().filter(|gimbal| gimbal.attitude.is_none());
        if let Some(gimbal) = encoders.filter(|gimbal| gimbal.topic.as_deref() == Some(topic)) {
            let taken = (&mut self.joints, &mut self.joint_names);
            match take_joint_state(taken, &gimbal.joints, stamp_ns, data) {
                Ok(None) => {}
                Ok(Some(content)) => entry.without_positions.get_or_insert((0, content)).0 += 1,
                Err(problem) => entry.refuse(problem),
            }
        }
        let is_read = place.is_sampled || place.is_grouped;
        if is_read && let Some(camera) = rig.cameras.iter().find(|camera| camera.topic == topic && kind.is_image()) {
            let levels = self.grey_levels.entry(camera.key.clone());
            let narrowing = levels.or_insert_with(|| grey_levels_of_topic(log, topic, kind)).at(log_time_ns);
            match decode_image(kind, data, narrowing, log.file().limits(), None) {
                Ok(image) => {
                    if place.is_sampled {
                        self.gradients.entry(camera.key.clone()).or_default().add(&image);
                        let sampled = SampledImage { stamp_ns, measure: measure(&image) };
                        self.images.entry(camera.key.clone()).or_default().push(sampled);
                    }
                    if place.is_grouped {
                        let content = self.content.entry(camera.key.clone()).or_default();
                        let orders = content.orders(kind, data, log.file().limits());
                        content.add(place.number, stamp_ns, image, orders);
                    }
                }
                Err(problem) => entry.refuse(problem.to_string()),
            }
        }
    }
}

/// Adds a message of the IMU on the gimbal to its samples, or to the specific forces of a separate accelerometer.
fn take_gimbal_imu(
    (samples, forces): (&mut Vec<ImuSample>, &mut Vec<(i64, Vector3<f64>)>),
    sensor: &ImuRig,
    topic: &str,
    stamp_ns: i64,
    data: &[u8],
) -> Result<(), String> {
    let message = messages::read_imu(data).map_err(|error| error.to_string())?;
    let (rate, force) = (message.angular_velocity_rad_per_s, message.specific_force_m_per_s2);
    if sensor.topic == topic {
        let measured =
            ImuSample { stamp_ns, angular_velocity_rad_per_s: rate, specific_force_m_per_s2: force, unmeasured_s: 0.0 };
        samples.push(sensor.intrinsics.correct(&measured));
    } else {
        forces.push((stamp_ns, sensor.intrinsics.correct_specific_force(&force)));
    }
    Ok(())
}

/// Adds a message of joint states to the readings of the rig's joints, and its names to those known; returns what a
/// message without positions has.
fn take_joint_state(
    (readings, known_names): (&mut Vec<JointReading>, &mut Vec<String>),
    joints: &[Joint],
    stamp_ns: i64,
    data: &[u8],
) -> Result<Option<&'static str>, String> {
    let message = messages::read_joint_state(data).map_err(|error| error.to_string())?;
    if message.lacks_positions() {
        return message.content_without_positions().map(Some).ok_or_else(|| message.length_problem());
    }
    let angle = |name: &str| {
        let place = message.names.iter().position(|known| *known == name)?;
        message.positions_rad.get(place).copied()
    };
    readings.push(JointReading { stamp_ns, angles_rad: joints.iter().map(|joint| angle(&joint.name)).collect() });
    for name in &message.names {
        if known_names.len() < JOINT_NAMES && !known_names.iter().any(|known| known == name) {
            known_names.push((*name).to_owned());
        }
    }
    Ok(None)
}

/// True for a reading that can be an angle in radians, with whole revolutions.
pub(crate) fn is_in_radians(reading: f64) -> bool {
    reading.abs() <= MAX_LIMIT_RAD
}

/// Readings of all messages as samples of all joints; those that are not finite are omitted.
fn merged(readings: &[JointReading]) -> Vec<JointSample> {
    let Some(joints) = readings.first().map(|reading| reading.angles_rad.len()) else { return Vec::new() };
    let mut ordered: Vec<&JointReading> = readings.iter().collect();
    ordered.sort_by_key(|reading| reading.stamp_ns);
    let mut merge = JointMerge::new(joints);
    let mut samples = Vec::new();
    for reading in ordered {
        let finite = |angle: &Option<f64>| angle.filter(|angle| angle.is_finite());
        let angles_rad = reading.angles_rad.iter().map(finite).collect();
        merge.push(&JointReading { stamp_ns: reading.stamp_ns, angles_rad });
        samples.extend(std::iter::from_fn(|| merge.pop()));
    }
    merge.finish();
    samples.extend(std::iter::from_fn(|| merge.pop()));
    samples
}
