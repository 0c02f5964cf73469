use std::collections::VecDeque;
use std::sync::Arc;

use super::super::grey_levels::GreyLevels;
use super::super::grey_sampling::grey_levels_of_topic;
use super::super::image_decoding::decode_image;
use super::super::image_problem::ImageProblem;
use super::super::log::relative_ns;
use super::super::messages::{self, MessageKind};
use super::super::video::PictureStream;
use super::super::{FlightLog, LogError, LogWarning, SensorFrame};
use super::imu::ImuStream;
use super::joint_angles::JointAngleStream;
use super::joint_topic::JointSamples;
use super::ordered::{Decoder, Lookup, MessageSource, OrderedSamples, ReadContext, Refusal};
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns};
use crate::sensors::{CameraRig, GrayImage, ImuSample, NEAREST_POSE_NS, PoseSample, Rig};

/// Duration of the IMU samples before the first frame.
const FIRST_FRAME_IMU_NS: i64 = 2_000_000_000;
/// Largest delay of log times after header stamps; reading starts this much earlier.
const SEEK_MARGIN_NS: i64 = 1_000_000_000;
/// Longer gaps between IMU samples, in periods, are reported.
const IMU_GAP_PERIODS: f64 = 3.5;
/// Longer gaps between images, in periods, are reported.
const IMAGE_GAP_PERIODS: f64 = 1.75;

/// Image message that is not decoded yet.
struct PendingImage {
    number: usize,
    log_time_ns: i64,
    content: ImageContent,
}

/// Images are decoded on demand, video frames in the order of their messages.
enum ImageContent {
    Message(Vec<u8>),
    Decoded(GrayImage),
}

/// Assembles the frames of one camera, in order.
pub(super) struct FrameSource {
    context: ReadContext,
    camera: CameraStream,
    imu: ImuStream,
    imu_topic: String,
    imu_gap_ns: i64,
    imu_ended: bool,
    /// IMU samples not before the previous frame, and the first one after the frame.
    samples: VecDeque<ImuSample>,
    joints: Option<JointAngleStream>,
    ground_truth: Option<Lookup<PoseSample>>,
    /// IMU sample interpolated at the previous frame's end.
    previous_end: Option<ImuSample>,
    start_ns: i64,
    end_ns: i64,
    /// Warnings of the log that are not reported yet.
    log_warnings: VecDeque<LogWarning>,
    /// Number of images before the first IMU sample.
    skipped: usize,
    /// Duration of the samples after a stamp in its frame.
    after_ns: i64,
}

/// Topic of a camera with its expected rate and size.
struct CameraStream {
    images: OrderedSamples<PendingImage>,
    /// Number of images in the log.
    count: usize,
    topic: String,
    kind: MessageKind,
    grey_levels: Arc<GreyLevels>,
    key: String,
    resolution_px: [usize; 2],
    shift_ns: i64,
    gap_ns: i64,
    previous_stamp_ns: Option<i64>,
}

impl FrameSource {
    pub(super) fn new(
        log: Arc<FlightLog>,
        rig: &Rig,
        camera_key: &str,
        start_s: f64,
        duration_s: Option<f64>,
    ) -> Result<Self, LogError> {
        let mut context = ReadContext::new(log);
        let log = &Arc::clone(&context.log);
        let camera = rig.camera(camera_key)?;
        let field = format!("{camera_key}.rostopic");
        let info = log.require_topic(&field, &camera.topic, &MessageKind::IMAGES)?;
        let kind = info.kind.unwrap_or(MessageKind::Image);
        let count = info.count as usize;
        let image_gap_ns = gap_ns(IMAGE_GAP_PERIODS, camera.rate_hz, info.rate_hz);
        let imu_rate_hz = log.require_topic("imu0.rostopic", &rig.imu.topic, &[MessageKind::Imu])?.rate_hz;
        let imu_gap_ns = gap_ns(IMU_GAP_PERIODS, rig.imu.rate_hz, imu_rate_hz);
        let start_ns = ns_from_seconds(start_s);
        let end_ns = duration_s.map_or(i64::MAX, |duration_s| start_ns.saturating_add(ns_from_seconds(duration_s)));
        let shift_ns = ns_from_seconds(camera.timeshift_cam_imu_s);
        let from_ns = start_ns.saturating_sub(FIRST_FRAME_IMU_NS + SEEK_MARGIN_NS + shift_ns.abs());
        let half_interval_ns = gap_ns(0.5, camera.rate_hz, info.rate_hz);
        let joints = joint_angles(log, rig, from_ns, half_interval_ns)?;
        let ground_truth = ground_truth_samples(log, rig, from_ns, &mut context).map(Lookup::new);
        let log_warnings = log.warnings().iter().cloned().collect();
        let images = if kind.is_video() {
            let decoder = picture_decoder(log, kind, camera);
            OrderedSamples::new(log, &camera.topic, from_ns, true, decoder).starting_at_keyframe(log, kind)
        } else {
            OrderedSamples::new(log, &camera.topic, from_ns, true, image_decoder(kind, log.epoch_ns()))
        };
        let stream = CameraStream {
            images,
            count,
            topic: camera.topic.clone(),
            kind,
            grey_levels: grey_levels_of_topic(log, &camera.topic, kind),
            key: camera_key.to_owned(),
            resolution_px: camera.model.resolution_px,
            shift_ns,
            gap_ns: image_gap_ns,
            previous_stamp_ns: None,
        };
        Ok(Self {
            imu: ImuStream::new(log, &rig.imu, from_ns)?,
            imu_topic: rig.imu.topic.clone(),
            context,
            camera: stream,
            imu_gap_ns,
            imu_ended: false,
            samples: VecDeque::new(),
            joints,
            ground_truth,
            previous_end: None,
            start_ns,
            end_ns,
            log_warnings,
            skipped: 0,
            after_ns: 0,
        })
    }

    /// Adds to each frame the IMU samples of `after_s` seconds after its stamp, as far as the log has them.
    pub(super) fn with_motion_after(self, after_s: f64) -> Self {
        Self { after_ns: ns_from_seconds(after_s), ..self }
    }

    /// Next frame, `None` at the end of the log or of the requested duration.
    pub(super) fn next_frame(&mut self) -> Option<SensorFrame> {
        loop {
            let (stamp_ns, pending) = self.camera.images.next(&mut self.context)?;
            if stamp_ns > self.end_ns {
                return None;
            }
            let previous_ns = self.camera.previous_stamp_ns.map(|previous| previous + self.camera.shift_ns);
            self.camera.check_gap(&mut self.context, stamp_ns, self.start_ns);
            let imu_stamp_ns = stamp_ns + self.camera.shift_ns;
            self.read_imu_until(imu_stamp_ns);
            let Some(last) = self.samples.back().filter(|last| last.stamp_ns >= imu_stamp_ns).copied() else {
                self.warn_of_imu_end(stamp_ns, pending.number);
                return None;
            };
            let first_known = self.samples.front().map_or(last.stamp_ns, |first| first.stamp_ns);
            if self.previous_end.is_none() && first_known > imu_stamp_ns {
                self.skipped += usize::from(stamp_ns >= self.start_ns);
                continue;
            }
            if stamp_ns < self.start_ns {
                self.forget_samples_before(imu_stamp_ns - FIRST_FRAME_IMU_NS);
                continue;
            }
            let (number, log_time_ns) = (pending.number, pending.log_time_ns);
            let Some(image) = self.camera.decode(&mut self.context, stamp_ns, pending) else { continue };
            self.warn_of_skipped_images();
            let imu = self.take_imu(imu_stamp_ns);
            let imu_after = self.imu_after(imu_stamp_ns);
            let context = &mut self.context;
            let joint_angles = self.joints.as_mut().and_then(|joints| joints.at(context, imu_stamp_ns, previous_ns));
            let ground_truth = self.ground_truth_at(imu_stamp_ns);
            while self.log_warnings.front().is_some_and(|warning| warning.stamp_ns <= stamp_ns) {
                self.context.warnings.extend(self.log_warnings.pop_front());
            }
            return Some(SensorFrame {
                index: number,
                stamp_ns,
                log_time_ns,
                image: Arc::new(image),
                imu,
                imu_after,
                joint_angles,
                ground_truth,
                warnings: std::mem::take(&mut self.context.warnings),
            });
        }
    }

    /// Warnings after the last frame.
    pub(super) fn finish(&mut self) -> Vec<LogWarning> {
        self.warn_of_skipped_images();
        self.imu.finish(&mut self.context);
        if self.end_ns == i64::MAX {
            self.context.warnings.extend(self.log_warnings.drain(..));
        }
        std::mem::take(&mut self.context.warnings)
    }

    fn read_imu_until(&mut self, stamp_ns: i64) {
        while !self.imu_ended && self.samples.back().is_none_or(|last| last.stamp_ns < stamp_ns) {
            let Some(sample) = self.imu.next(&mut self.context) else {
                self.imu_ended = true;
                return;
            };
            if let Some(last) = self.samples.back()
                && sample.stamp_ns - last.stamp_ns > self.imu_gap_ns
            {
                let message = format!(
                    "{}: no samples for {:.3} s from {:.3} s on; IMU samples are interpolated over the gap",
                    self.imu_topic,
                    seconds_from_ns(sample.stamp_ns - last.stamp_ns),
                    seconds_from_ns(last.stamp_ns)
                );
                self.context.warn(last.stamp_ns, message);
            }
            self.samples.push_back(sample);
        }
    }

    /// Drops samples that no later frame needs, except the last one before the stamp.
    fn forget_samples_before(&mut self, stamp_ns: i64) {
        while self.samples.get(1).is_some_and(|second| second.stamp_ns <= stamp_ns) {
            self.samples.pop_front();
        }
    }

    /// Removes and returns the samples from the previous frame's end to `end_ns`, both ends interpolated.
    fn take_imu(&mut self, end_ns: i64) -> Vec<ImuSample> {
        let start_ns = self.previous_end.map_or(end_ns - FIRST_FRAME_IMU_NS, |previous| previous.stamp_ns);
        let mut imu: Vec<ImuSample> = self.previous_end.into_iter().collect();
        let includes_start = imu.is_empty();
        let inside =
            |stamp_ns: i64| (stamp_ns > start_ns || (includes_start && stamp_ns == start_ns)) && stamp_ns < end_ns;
        imu.extend(self.samples.iter().filter(|sample| inside(sample.stamp_ns)));
        let after = self.samples.iter().position(|sample| sample.stamp_ns >= end_ns);
        if let Some(after) = after {
            let end = match after.checked_sub(1).and_then(|before| self.samples.get(before)) {
                Some(before) => interpolate_imu(before, &self.samples[after], end_ns),
                None => self.samples[after],
            };
            imu.push(end);
            self.previous_end = Some(end);
        }
        self.forget_samples_before(end_ns);
        imu
    }

    /// Samples from the end of the frame on, the first one interpolated there.
    fn imu_after(&mut self, end_ns: i64) -> Vec<ImuSample> {
        if self.after_ns == 0 {
            return Vec::new();
        }
        let last_ns = end_ns.saturating_add(self.after_ns);
        self.read_imu_until(last_ns);
        let following = self.samples.iter().filter(|sample| (end_ns + 1..=last_ns).contains(&sample.stamp_ns));
        self.previous_end.iter().chain(following).copied().collect()
    }

    fn ground_truth_at(&mut self, stamp_ns: i64) -> Option<RigidTransform> {
        let [before, after] = self.ground_truth.as_mut()?.around(&mut self.context, stamp_ns);
        let (from_ns, from) = before?;
        if *from_ns == stamp_ns {
            return Some(from.world_from_imu);
        }
        let (to_ns, to) = after?;
        if (stamp_ns - from_ns).min(to_ns - stamp_ns) > NEAREST_POSE_NS {
            return None;
        }
        Some(from.world_from_imu.interpolate(&to.world_from_imu, fraction_at(*from_ns, *to_ns, stamp_ns)))
    }

    fn warn_of_skipped_images(&mut self) {
        let count = std::mem::take(&mut self.skipped);
        if count > 0 {
            let message = format!(
                "{}: {count} images before the first IMU sample at {:.3} s are not used",
                self.camera.topic,
                seconds_from_ns(self.samples.front().map_or(0, |first| first.stamp_ns))
            );
            self.context.warn(self.start_ns, message);
        }
    }

    fn warn_of_imu_end(&mut self, stamp_ns: i64, number: usize) {
        let left = self.camera.count.saturating_sub(number);
        let Some(last) = self.samples.back() else {
            let message = format!("{}: no IMU sample for the images of {}", self.imu_topic, self.camera.key);
            self.context.warn(stamp_ns, message);
            return;
        };
        // The topics of a log seldom end together; the last one or two images may have no IMU sample after them.
        if left > 2 {
            let message = format!(
                "{}: the IMU ends at {:.3} s; the last {left} images of {} are not used",
                self.imu_topic,
                seconds_from_ns(last.stamp_ns),
                self.camera.key
            );
            self.context.warn(last.stamp_ns, message);
        }
    }
}

impl CameraStream {
    fn check_gap(&mut self, context: &mut ReadContext, stamp_ns: i64, start_ns: i64) {
        if let Some(previous_ns) = self.previous_stamp_ns.filter(|previous| *previous >= start_ns)
            && stamp_ns - previous_ns > self.gap_ns
        {
            let message = format!(
                "{}: no image for {:.3} s from {:.3} s on",
                self.topic,
                seconds_from_ns(stamp_ns - previous_ns),
                seconds_from_ns(previous_ns)
            );
            context.warn(previous_ns, message);
        }
        self.previous_stamp_ns = Some(stamp_ns);
    }

    /// Decoded image, or `None` and a warning with the reason why it is skipped.
    fn decode(&self, context: &mut ReadContext, stamp_ns: i64, pending: PendingImage) -> Option<GrayImage> {
        let message = match pending.content {
            ImageContent::Message(message) => message,
            ImageContent::Decoded(image) => return Some(image),
        };
        let limits = context.log.file().limits();
        let narrowing = self.grey_levels.at(pending.log_time_ns);
        let problem = match decode_image(self.kind, &message, narrowing, limits, Some(self.resolution_px)) {
            Ok(image) => return Some(image),
            Err(problem) => problem_text(problem, self.resolution_px, &self.key),
        };
        let message = format!(
            "{}: image {} at {:.3} s skipped: {problem}",
            self.topic,
            pending.number,
            seconds_from_ns(stamp_ns)
        );
        context.warn(stamp_ns, message);
        None
    }
}

/// Largest gap that is not reported: `periods` of the slower of the rig's rate and the log's mean rate.
fn gap_ns(periods: f64, rig_rate_hz: f64, log_rate_hz: f64) -> i64 {
    let slower = [rig_rate_hz, log_rate_hz].into_iter().filter(|rate| *rate > 0.0).fold(f64::INFINITY, f64::min);
    if slower.is_finite() { ns_from_seconds(periods / slower) } else { i64::MAX }
}

fn fraction_at(from_ns: i64, to_ns: i64, stamp_ns: i64) -> f64 {
    if to_ns > from_ns { (stamp_ns - from_ns) as f64 / (to_ns - from_ns) as f64 } else { 0.0 }
}

fn interpolate_imu(from: &ImuSample, to: &ImuSample, stamp_ns: i64) -> ImuSample {
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

/// Description of a problem with a camera's image.
fn problem_text(problem: ImageProblem, resolution_px: [usize; 2], key: &str) -> String {
    match problem {
        ImageProblem::OtherResolution([width, height]) => {
            format!("it has {width}×{height} pixels, {}×{} in the rig for {key}", resolution_px[0], resolution_px[1])
        }
        ImageProblem::Unreadable(problem) => problem,
    }
}

/// Decodes the frames of a video topic; a skipped number is an unreadable message.
fn picture_decoder(log: &FlightLog, kind: MessageKind, camera: &CameraRig) -> Decoder<PendingImage> {
    let (epoch_ns, limits) = (log.epoch_ns(), log.file().limits().clone());
    let (resolution_px, key) = (camera.model.resolution_px, camera.key.clone());
    let mut stream = PictureStream::default();
    Box::new(move |source: MessageSource<'_>| {
        let packet = messages::read_video_packet(kind, source.data).map_err(|error| Refusal::not_decodable(&error));
        let packet = packet.inspect_err(|_| stream.lose_message())?;
        let image = stream.decode(source.number, &packet, &limits, Some(resolution_px)).map_err(|problem| Refusal {
            reason: "the frame cannot be decoded",
            detail: problem_text(problem, resolution_px, &key),
        })?;
        let log_time_ns = relative_ns(i64::try_from(source.position.log_time_ns).unwrap_or(i64::MAX), epoch_ns);
        Ok((
            packet.stamp_ns,
            PendingImage { number: source.number, log_time_ns, content: ImageContent::Decoded(image) },
        ))
    })
}

fn image_decoder(kind: MessageKind, epoch_ns: i64) -> Decoder<PendingImage> {
    Box::new(move |source: MessageSource<'_>| {
        let stamp_ns = messages::stamp_ns(kind, source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let log_time_ns = relative_ns(i64::try_from(source.position.log_time_ns).unwrap_or(i64::MAX), epoch_ns);
        let content = ImageContent::Message(source.data.to_vec());
        Ok((stamp_ns, PendingImage { number: source.number, log_time_ns, content }))
    })
}

/// Joint angles of the gimbal, `None` without a gimbal or encoders.
fn joint_angles(
    log: &Arc<FlightLog>,
    rig: &Rig,
    from_ns: i64,
    half_interval_ns: i64,
) -> Result<Option<JointAngleStream>, LogError> {
    let Some(gimbal) = &rig.gimbal else { return Ok(None) };
    let (Some(topic), Some(sigma_rad)) = (&gimbal.topic, gimbal.encoder_sigma_rad) else { return Ok(None) };
    let samples = JointSamples::new(log, gimbal, topic, from_ns)?;
    Ok(Some(JointAngleStream::new(samples, sigma_rad, half_interval_ns)))
}

/// Ground-truth poses `world_from_imu`, `None` if the rig has no such topic or the log lacks it.
fn ground_truth_samples(
    log: &FlightLog,
    rig: &Rig,
    from_ns: i64,
    context: &mut ReadContext,
) -> Option<OrderedSamples<PoseSample>> {
    // Positions are not poses of the IMU: they are compared with whole trajectories.
    let topic = rig.ground_truth_topic.as_ref().filter(|topic| !log.is_position_topic(topic))?;
    let kinds = [MessageKind::Odometry, MessageKind::PoseStamped, MessageKind::TransformStamped];
    let kind = match log.require_topic("ground_truth.rostopic", topic, &kinds) {
        Ok(info) => info.kind?,
        Err(error) => {
            context.warn(0, format!("no ground truth: {error}"));
            return None;
        }
    };
    let epoch_ns = log.epoch_ns();
    let decode: Decoder<PoseSample> = Box::new(move |source: MessageSource<'_>| {
        let message = messages::read_pose(kind, source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let refusal = || Refusal { reason: "not a pose", detail: "not finite, or a zero quaternion".into() };
        let world_from_imu = message.pose.ok_or_else(refusal)?;
        let sample = PoseSample { stamp_ns: relative_ns(message.stamp_ns, epoch_ns), world_from_imu };
        Ok((message.stamp_ns, sample))
    });
    Some(OrderedSamples::new(log, topic, from_ns, false, decode))
}
