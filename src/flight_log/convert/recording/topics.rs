//! Log topics of a recording.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};

use super::super::super::MessageTimes;
use super::super::ConvertError;
use super::super::sink::LogSink;
use super::attitude::{AttitudeTrack, earth_from_heading, enu_from_ned};
use super::candidates::{Candidates, Choice, NamedSamples, Samples};
use super::mp4::Video;
use super::recorded::{GimbalAttitude, GimbalFrame, Recorded, RecordedImu, rate_hz};
use crate::geometry::RigidTransform;

const IMU_TYPE: &str = "sensor_msgs/msg/Imu";
const ROTATION_TYPE: &str = "geometry_msgs/msg/QuaternionStamped";
const POSE_TYPE: &str = "geometry_msgs/msg/PoseStamped";
const VIDEO_TYPE: &str = "foxglove.CompressedVideo";

/// Topic of an IMU, without its number.
const IMU_TOPIC: &str = "/imu";
pub(super) const GIMBAL_TOPIC: &str = "/gimbal/attitude";
/// Rotation from the vehicle's body (forward, right, down) to the earth (north, east, down).
pub(super) const VEHICLE_TOPIC: &str = "/vehicle/attitude";
/// Poses of the autopilot's estimator (east, north, up).
const VEHICLE_POSE_TOPIC: &str = "/vehicle/pose";
/// Poses of the satellite receiver (east, north, up from the first fix).
const GPS_POSE_TOPIC: &str = "/gps/pose";
pub(super) const VIDEO_TOPIC: &str = "/camera/video";

/// A time is damaged if it is this much later than the next one, or at the end than all before.
const MAX_JUMP_NS: i64 = 60_000_000_000;

/// Content of a message to write.
#[derive(Clone, Debug)]
enum Content {
    /// Angular velocity and specific force.
    Imu([Vector3<f64>; 2]),
    Rotation(UnitQuaternion<f64>),
    Pose(RigidTransform),
    /// Video frame with this number.
    VideoFrame(usize),
}

/// Message with its header stamp and its log time.
#[derive(Clone, Debug)]
struct Message {
    stamp_ns: i64,
    log_time_ns: i64,
    content: Content,
}

#[derive(Clone, Debug)]
struct Topic {
    name: String,
    message_type: &'static str,
    frame_id: &'static str,
    remark: String,
    messages: Vec<Message>,
}

#[derive(Debug, Default)]
pub(super) struct Topics {
    topics: Vec<Topic>,
    pub(super) gimbal_frame: Option<GimbalFrame>,
}

/// Name and measurements of the chosen record; the others are counted as left out, and several devices are named.
fn chosen<T>(candidates: Candidates<T>, format: &str, topic: &str, sink: &mut LogSink<'_>) -> Option<NamedSamples<T>> {
    candidates.names().for_each(|name| sink.records.offer(name));
    let Choice { record, samples, others, devices } = candidates.choose(|name| sink.records.wants(name))?;
    for (other, count) in others {
        sink.leave(&other, format, count, format!("{topic} uses {record}"));
    }
    if let Some(devices) = devices {
        sink.note(format!("{topic}: several devices: {devices}; {record} is taken, another one with --take \"NAME\""));
    }
    Some((record.clone(), in_order(samples, format, &record, sink)))
}

/// Measurements in time order; those whose time goes back, or jumps far ahead of the next one, are left out.
fn in_order<T>(samples: Samples<T>, format: &str, record: &str, sink: &mut LogSink<'_>) -> Samples<T> {
    let times_ns: Vec<i64> = samples.iter().map(|(time_ns, _)| *time_ns).collect();
    let mut before_ns = None;
    let mut kept = Vec::with_capacity(samples.len());
    let mut left = 0;
    for (index, sample) in samples.into_iter().enumerate() {
        let goes_back = before_ns.is_some_and(|before_ns| sample.0 < before_ns);
        let jumps = match (before_ns, times_ns.get(index + 1)) {
            (Some(before_ns), Some(next_ns)) => *next_ns >= before_ns && sample.0 > next_ns.saturating_add(MAX_JUMP_NS),
            (None, Some(next_ns)) => sample.0 > next_ns.saturating_add(MAX_JUMP_NS),
            (Some(before_ns), None) => index > 1 && sample.0 > before_ns.saturating_add(MAX_JUMP_NS),
            (None, None) => false,
        };
        if goes_back || jumps {
            left += 1;
        } else {
            before_ns = Some(sample.0);
            kept.push(sample);
        }
    }
    if left > 0 {
        sink.leave(record, format, left, "its time goes back or jumps ahead");
    }
    kept
}

fn imu_rate_hz(imu: &RecordedImu) -> f64 {
    rate_hz(&imu.combined).max(rate_hz(&imu.gyroscope))
}

impl Topics {
    fn add<T>(
        &mut self,
        name: &str,
        [message_type, frame_id]: [&'static str; 2],
        remark: String,
        samples: Samples<T>,
        content: impl Fn(T) -> Content,
    ) {
        if samples.is_empty() {
            return;
        }
        let messages = samples.into_iter().map(|(stamp_ns, sample)| Message {
            stamp_ns,
            log_time_ns: stamp_ns,
            content: content(sample),
        });
        self.topics.push(Topic { name: name.to_owned(), message_type, frame_id, remark, messages: messages.collect() });
    }

    /// Adds all measurements of a recorder, at log times.
    pub(super) fn add_recorded(&mut self, recorded: Recorded, sink: &mut LogSink<'_>) {
        let Recorded { format, prefix, imus, attitudes, gimbal, positions, fixes, left, notes, utc: _ } = recorded;
        for note in notes {
            sink.note(note);
        }
        for (record, left) in left {
            sink.leave(&record, format, left.count, left.reason);
        }
        let mut imus: Vec<(String, RecordedImu)> = imus.into_iter().collect();
        // Stable sort: IMUs of equal rates stay in the order of their names.
        imus.sort_by(|(_, a), (_, b)| {
            a.is_of_other_device.cmp(&b.is_of_other_device).then(imu_rate_hz(b).total_cmp(&imu_rate_hz(a)))
        });
        let only_one = imus.len() == 1;
        for (number, (record, imu)) in imus.into_iter().enumerate() {
            let number = if only_one { String::new() } else { number.to_string() };
            self.add_imu(&format!("{prefix}{IMU_TOPIC}{number}"), format, &record, imu, sink);
        }
        let names = [VEHICLE_TOPIC, GIMBAL_TOPIC, VEHICLE_POSE_TOPIC, GPS_POSE_TOPIC];
        let [vehicle_topic, gimbal_topic, pose_topic, gps_topic] = names.map(|name| format!("{prefix}{name}"));
        let vehicle = chosen(attitudes, format, &vehicle_topic, sink);
        let track = AttitudeTrack::new(vehicle.as_ref().map_or(&[], |(_, samples)| samples));
        if let Some(best) = chosen(gimbal, format, &gimbal_topic, sink) {
            self.add_gimbal(&gimbal_topic, format, best, &track, sink);
        }
        if let Some((record, samples)) = chosen(positions, format, &pose_topic, sink) {
            let samples = samples.into_iter().map(|(at, ned)| (at, Vector3::new(ned.y, ned.x, -ned.z))).collect();
            self.add_poses(&pose_topic, format, (record, samples), &track, sink);
        }
        if let Some((record, samples)) = chosen(fixes, format, &gps_topic, sink)
            && let Some((_, origin)) = samples.first().copied()
        {
            let samples = samples.into_iter().map(|(at, fix)| (at, fix.east_north_up_m(origin))).collect();
            self.add_poses(&gps_topic, format, (record, samples), &track, sink);
        }
        if let Some((record, samples)) = vehicle {
            let remark = format!("{record}, {:.1} Hz; from body (FRD) to earth (NED)", rate_hz(&samples));
            self.add(&vehicle_topic, [ROTATION_TYPE, "earth"], remark, samples, Content::Rotation);
        }
    }

    fn add_imu(&mut self, topic: &str, format: &str, record: &str, imu: RecordedImu, sink: &mut LogSink<'_>) {
        let remark = |rate_hz: f64, what: &str| format!("{record}, {rate_hz:.1} Hz{what}");
        let combined = in_order(imu.combined, format, record, sink);
        let text = remark(rate_hz(&combined), "");
        self.add(topic, [IMU_TYPE, "imu"], text, combined, Content::Imu);
        let gyroscope = in_order(imu.gyroscope, format, record, sink);
        let text = remark(rate_hz(&gyroscope), ", angular velocity only");
        let content = |rate| Content::Imu([rate, Vector3::zeros()]);
        self.add(&format!("{topic}/gyroscope"), [IMU_TYPE, "imu"], text, gyroscope, content);
        let accelerometer = in_order(imu.accelerometer, format, record, sink);
        let text = remark(rate_hz(&accelerometer), ", specific force only");
        let content = |force| Content::Imu([Vector3::zeros(), force]);
        self.add(&format!("{topic}/accelerometer"), [IMU_TYPE, "imu"], text, accelerometer, content);
    }

    /// Adds the gimbal's attitude in the frame of most measurements; others are converted by the vehicle's heading.
    fn add_gimbal(
        &mut self,
        topic: &str,
        format: &str,
        (record, samples): NamedSamples<GimbalAttitude>,
        vehicle: &AttitudeTrack<'_>,
        sink: &mut LogSink<'_>,
    ) {
        let in_earth = samples.iter().filter(|(_, attitude)| attitude.frame == GimbalFrame::Earth).count();
        let frame = if in_earth * 2 > samples.len() { GimbalFrame::Earth } else { GimbalFrame::Vehicle };
        let mut rotations = Vec::with_capacity(samples.len());
        let mut left = 0;
        for (time_ns, attitude) in samples {
            let rotation = attitude.frame_from_camera;
            let heading = || vehicle.at(time_ns).map(|earth_from_body| earth_from_heading(&earth_from_body));
            let rotation = match (attitude.frame, frame) {
                (GimbalFrame::Vehicle, GimbalFrame::Earth) => heading().map(|heading| heading * rotation),
                (GimbalFrame::Earth, GimbalFrame::Vehicle) => heading().map(|heading| heading.inverse() * rotation),
                _ => Some(rotation),
            };
            match rotation {
                Some(rotation) => rotations.push((time_ns, rotation)),
                None => left += 1,
            }
        }
        if left > 0 {
            sink.leave(&record, format, left, "in another frame, without the vehicle's heading at that time");
        }
        self.gimbal_frame = Some(frame);
        let (name, frame_id) = match frame {
            GimbalFrame::Vehicle => ("vehicle: levelled, with the vehicle's heading", "vehicle"),
            GimbalFrame::Earth => ("earth: north, east, down", "earth"),
        };
        let remark = format!("{record}, {:.1} Hz; frame {name}; axes FRD", rate_hz(&rotations));
        self.add(topic, [ROTATION_TYPE, frame_id], remark, rotations, Content::Rotation);
    }

    /// Adds positions (east, north, up) with the vehicle's attitude at their times; without rotation if it has none.
    fn add_poses(
        &mut self,
        topic: &str,
        format: &str,
        (record, samples): NamedSamples<Vector3<f64>>,
        vehicle: &AttitudeTrack<'_>,
        sink: &mut LogSink<'_>,
    ) {
        let count = samples.len();
        let poses: Samples<RigidTransform> = samples
            .into_iter()
            .filter_map(|(time_ns, position_m)| {
                let rotation = match vehicle.at(time_ns) {
                    Some(earth_from_body) => enu_from_ned() * earth_from_body,
                    None if vehicle.is_empty() => UnitQuaternion::identity(),
                    None => return None,
                };
                Some((time_ns, RigidTransform::new(rotation, position_m)))
            })
            .collect();
        if poses.len() < count {
            let left = (count - poses.len()) as u64;
            sink.leave(&record, format, left, "without the vehicle's attitude at that time");
        }
        let rotation = if vehicle.is_empty() { "; rotation unknown" } else { "" };
        let remark = format!("{record}, {:.1} Hz; east, north, up{rotation}", rate_hz(&poses));
        self.add(topic, [POSE_TYPE, "world"], remark, poses, Content::Pose);
    }

    /// Adds the frames of a video; `time_of` converts video time to log time.
    pub(super) fn add_video(&mut self, video: &Video, time_of: impl Fn(i64) -> i64) {
        let messages: Vec<Message> = video
            .frames
            .iter()
            .enumerate()
            .map(|(number, frame)| Message {
                stamp_ns: time_of(frame.presented_ns),
                log_time_ns: time_of(frame.decoded_ns),
                content: Content::VideoFrame(number),
            })
            .collect();
        self.topics.push(Topic {
            name: VIDEO_TOPIC.to_owned(),
            message_type: VIDEO_TYPE,
            frame_id: "camera",
            remark: video.description(),
            messages,
        });
    }

    /// Writes all messages in the order of log times.
    pub(super) fn write(
        self,
        source: &Path,
        video: Option<&Video>,
        sink: &mut LogSink<'_>,
    ) -> Result<(), ConvertError> {
        sink.records.require_all(source)?;
        let Self { topics, .. } = self;
        let mut order: Vec<(i64, usize, usize)> = Vec::new();
        for (number, topic) in topics.iter().enumerate() {
            order
                .extend(topic.messages.iter().enumerate().map(|(index, message)| (message.log_time_ns, number, index)));
        }
        order.sort_unstable();
        let count = order.len();
        for (done, (_, number, index)) in order.into_iter().enumerate() {
            let topic = &topics[number];
            write_message(topic, &topic.messages[index], video, sink)?;
            sink.advance(done, count)?;
        }
        for topic in topics {
            sink.remark(&topic.name, topic.message_type, topic.remark);
        }
        Ok(())
    }
}

fn write_message(
    topic: &Topic,
    message: &Message,
    video: Option<&Video>,
    sink: &mut LogSink<'_>,
) -> Result<(), ConvertError> {
    let Topic { name, message_type, frame_id, .. } = topic;
    let times = MessageTimes { stamp_ns: message.stamp_ns, log_time_ns: message.log_time_ns };
    match &message.content {
        Content::Imu([rate, force]) => sink.writer.write_imu(name, frame_id, times, rate, force)?,
        Content::Rotation(rotation) => sink.writer.write_rotation(name, frame_id, times, rotation)?,
        Content::Pose(pose) => sink.writer.write_pose(name, frame_id, times, pose)?,
        Content::VideoFrame(number) => {
            let Some(video) = video else { return Ok(()) };
            match video.access_unit(*number) {
                Ok(data) => sink.writer.write_compressed_video(name, frame_id, times, video.codec.name(), &data)?,
                Err(problem) => {
                    sink.leave(name, message_type, 1, problem);
                    return Ok(());
                }
            }
        }
    }
    sink.taken(name, message_type);
    Ok(())
}
