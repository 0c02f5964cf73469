//! Frames of one camera with the samples of the other sensors.

use std::collections::VecDeque;
use std::sync::Arc;

use super::super::messages::MessageKind;
use super::super::{FlightLog, LogError, LogWarning, WarningKind};
use super::camera::CameraStream;
use super::gaps::GapWatch;
use super::gimbal_imu::GimbalImuStream;
use super::ground_truth::GroundTruth;
use super::imu::{FIRST_FRAME_IMU_NS, FrameImuBuffer, ImuStream};
use super::joint_angles::JointAngleStream;
use super::joint_topic::JointSamples;
use super::read_context::ReadContext;
use crate::flight_log::imu::filter::{ROTATING_NS, ROTATING_RAD_PER_S};
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns};
use crate::sensors::{CameraMount, CameraRig, GrayImage, ImuSample, JointAngles, Rig};
use crate::text::counted;

/// Image of one camera with the measurements that belong to it: the input of front end and estimator in one step.
#[derive(Clone, Debug)]
pub struct SensorFrame {
    /// Number of the image in its camera's stream, from 0, over the entire log. Skipped images keep their number, so
    /// that it depends neither on the start of a replay nor on earlier damage.
    pub index: usize,
    /// Header stamp of the image since the start of the log, in camera time.
    pub stamp_ns: i64,
    /// Log time of the image since the start of the log.
    pub log_time_ns: i64,
    pub image: Arc<GrayImage>,
    /// IMU samples from the previous frame's stamp to this one's, both ends included: the first and the last are
    /// interpolated exactly at the stamps (shifted by the rig's `timeshift_cam_imu`).
    /// The first frame has the samples of at most 2 s before it.
    pub imu: Vec<ImuSample>,
    /// IMU samples after the stamp, the first one at the stamp; empty unless requested from the stream.
    pub imu_after: Vec<ImuSample>,
    /// Samples of the IMU on the gimbal from the previous frame's stamp to this one's, both ends included and
    /// interpolated, on the clock of `imu`; empty without such an IMU or where its samples are missing.
    pub gimbal_imu: Vec<ImuSample>,
    /// Encoder angles at the stamp, from all readings around it; `None` without encoders or if none lies within 0.1 s.
    pub joint_angles: Option<JointAngles>,
    /// Ground truth `world_from_imu` interpolated at the stamp: for comparison and display only, never for estimation.
    pub ground_truth: Option<RigidTransform>,
    /// Problems of the log since the previous frame.
    pub warnings: Vec<LogWarning>,
}

/// Images without joint angles for a shorter time are not reported: attitudes of gimbals come at 5 Hz or more.
const WITHOUT_JOINTS_NS: i64 = 400_000_000;

/// Largest delay of log times after header stamps; reading starts this much earlier.
const SEEK_MARGIN_NS: i64 = 1_000_000_000;
/// Images that are left out within this time are reported together.
const LEFT_OUT_NS: i64 = 10_000_000_000;

/// Images that were left out.
#[derive(Clone, Copy, Debug)]
struct LeftOut {
    first_ns: i64,
    last_ns: i64,
    count: usize,
}

/// Assembles the frames of one camera, in order.
pub(super) struct FrameSource {
    context: ReadContext,
    camera: CameraStream,
    imu: ImuStream,
    imu_topic: String,
    imu_gaps: GapWatch,
    imu_ended: bool,
    /// Stamp of the last sample of a rotation.
    rotating_ns: Option<i64>,
    buffer: FrameImuBuffer,
    gimbal_imu: Option<GimbalImuStream>,
    joints: Option<JointAngleStream>,
    /// Topic of the joint angles of a camera on a gimbal.
    joint_topic: Option<String>,
    /// Stamp of the first of the last images without joint angles.
    without_joints_ns: Option<i64>,
    ground_truth: Option<GroundTruth>,
    /// Stamp of the previous image, in camera time.
    previous_image_ns: Option<i64>,
    start_ns: i64,
    end_ns: i64,
    /// Warnings of the log that are not reported yet.
    log_warnings: VecDeque<LogWarning>,
    /// Number of images before the first IMU sample.
    skipped: usize,
    /// Images that were left out to keep up with a vehicle in flight and are not reported yet.
    left_out: Option<LeftOut>,
    /// Duration of the samples after a stamp in its frame.
    after_ns: i64,
    /// Rate of the images, as far as it is known.
    rate_hz: f64,
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
        let start_ns = ns_from_seconds(start_s);
        let end_ns = duration_s.map_or(i64::MAX, |duration_s| start_ns.saturating_add(ns_from_seconds(duration_s)));
        let shift_ns = ns_from_seconds(camera.timeshift_cam_imu_s);
        let from_ns = start_ns.saturating_sub(FIRST_FRAME_IMU_NS + SEEK_MARGIN_NS + shift_ns.abs());
        let stream = CameraStream::new(log, camera, from_ns)?;
        log.require_topic("imu0.rostopic", &rig.imu.topic, &[MessageKind::Imu])?;
        let topic_rate_hz = log.topic(&camera.topic).map_or(0.0, |it| it.rate_hz);
        let half_interval_ns = half_interval_ns(camera.rate_hz, topic_rate_hz);
        let joints = joint_angles(log, rig, from_ns, half_interval_ns)?;
        let ground_truth = GroundTruth::new(log, rig, from_ns, &mut context);
        let gimbal_imu = rig.gimbal_imu.as_ref().map(|imu| GimbalImuStream::new(log, imu, from_ns)).transpose()?;
        let unset = |warning: &&LogWarning| warning.kind == WarningKind::Stamps && rig.uses_log_time(&warning.subject);
        let log_warnings = log.warnings().iter().filter(|warning| !unset(warning)).cloned().collect();
        Ok(Self {
            imu: ImuStream::new(log, &rig.imu, from_ns)?,
            imu_topic: rig.imu.topic.clone(),
            context,
            camera: stream,
            imu_gaps: GapWatch::new(WarningKind::ImuGap, &rig.imu.topic, rig.imu.rate_hz),
            imu_ended: false,
            rotating_ns: None,
            buffer: FrameImuBuffer::default(),
            gimbal_imu,
            without_joints_ns: None,
            joint_topic: joints.is_some().then(|| joint_topic(rig, camera)).flatten(),
            joints,
            ground_truth,
            previous_image_ns: None,
            start_ns,
            end_ns,
            log_warnings,
            skipped: 0,
            left_out: None,
            after_ns: 0,
            rate_hz: if camera.rate_hz > 0.0 { camera.rate_hz } else { topic_rate_hz },
        })
    }

    /// Adds to each frame the IMU samples of `after_s` seconds after its stamp, as far as the log has them.
    pub(super) fn with_motion_after(self, after_s: f64) -> Self {
        Self { after_ns: ns_from_seconds(after_s), ..self }
    }

    /// True if images may be left out, because they come faster than they are processed.
    pub(super) fn keeps_up(&self) -> bool {
        self.after_ns > 0 && self.context.log.keeps_up()
    }

    /// Next frame, `None` at the end of the log or of the requested duration.
    pub(super) fn next_frame(&mut self) -> Option<SensorFrame> {
        loop {
            let (stamp_ns, pending) = self.camera.next(&mut self.context)?;
            if stamp_ns > self.end_ns {
                return None;
            }
            let previous_ns = self.previous_image_ns.replace(stamp_ns).map(|previous| previous + self.camera.shift_ns);
            if stamp_ns >= self.start_ns {
                self.camera.check_gap(&mut self.context, stamp_ns);
            }
            let imu_stamp_ns = stamp_ns + self.camera.shift_ns;
            self.read_imu_until(imu_stamp_ns);
            let Some(last) = self.buffer.samples.back().filter(|last| last.stamp_ns >= imu_stamp_ns).copied() else {
                self.warn_of_imu_end(stamp_ns, pending.number);
                return None;
            };
            let first_known = self.buffer.samples.front().map_or(last.stamp_ns, |first| first.stamp_ns);
            if self.buffer.previous_end.is_none() && first_known > imu_stamp_ns {
                self.skipped += usize::from(stamp_ns >= self.start_ns);
                continue;
            }
            if stamp_ns < self.start_ns {
                let before_ns = imu_stamp_ns - FIRST_FRAME_IMU_NS;
                self.buffer.forget_before(before_ns);
                if let Some(imu) = &mut self.gimbal_imu {
                    imu.forget_before(&mut self.context, before_ns);
                }
                continue;
            }
            // A stereo partner, whose frames have no samples after them, keeps all images: its other camera chooses.
            if self.after_ns > 0 && self.context.log.leaves_out(stamp_ns, self.rate_hz) {
                self.note_left_out(stamp_ns);
                continue;
            }
            let (number, log_time_ns) = (pending.number, pending.log_time_ns);
            let rotates = self.rotating_ns.is_some_and(|rotating_ns| imu_stamp_ns - rotating_ns < ROTATING_NS);
            let Some(image) = self.camera.decode(&mut self.context, stamp_ns, pending, rotates) else { continue };
            self.warn_of_skipped_images();
            let imu = self.buffer.take(imu_stamp_ns);
            let imu_after = self.imu_after(imu_stamp_ns);
            let context = &mut self.context;
            let gimbal_imu = self.gimbal_imu.as_mut().map_or_else(Vec::new, |imu| imu.take(context, imu_stamp_ns));
            let joint_angles = self.joints.as_mut().and_then(|joints| joints.at(context, imu_stamp_ns, previous_ns));
            let ground_truth = self.ground_truth.as_mut().and_then(|poses| poses.at(context, imu_stamp_ns));
            self.warn_of_joint_angles(stamp_ns, joint_angles.is_some());
            self.context.warnings.extend(self.context.log.take_reception_warnings());
            if self.left_out.is_some_and(|left_out| stamp_ns - left_out.first_ns > LEFT_OUT_NS) {
                self.warn_of_left_out();
            }
            while self.log_warnings.front().is_some_and(|warning| warning.stamp_ns <= stamp_ns) {
                self.context.warnings.extend(self.log_warnings.pop_front());
            }
            return Some(SensorFrame {
                index: number,
                stamp_ns,
                log_time_ns,
                image,
                imu,
                imu_after,
                gimbal_imu,
                joint_angles,
                ground_truth,
                warnings: self.take_warnings(),
            });
        }
    }

    /// Warnings after the last frame.
    pub(super) fn finish(&mut self) -> Vec<LogWarning> {
        self.warn_of_skipped_images();
        self.warn_of_left_out();
        self.context.warnings.extend(self.context.log.take_reception_warnings());
        self.imu.finish(&mut self.context);
        self.imu_gaps.finish(&mut self.context);
        if let Some(imu) = &mut self.gimbal_imu {
            imu.finish(&mut self.context);
        }
        self.camera.finish(&mut self.context);
        if self.end_ns == i64::MAX {
            self.context.warnings.extend(self.log_warnings.drain(..));
        }
        self.take_warnings()
    }

    fn take_warnings(&mut self) -> Vec<LogWarning> {
        let mut warnings = std::mem::take(&mut self.context.warnings);
        warnings.retain(|warning| !self.context.log.is_interruption(warning));
        warnings
    }

    /// Reports images of a camera on a gimbal without joint angles for some time, although the log has their topic.
    fn warn_of_joint_angles(&mut self, stamp_ns: i64, found: bool) {
        if found {
            self.without_joints_ns = None;
            return;
        }
        let Some(topic) = &self.joint_topic else { return };
        if stamp_ns - *self.without_joints_ns.get_or_insert(stamp_ns) < WITHOUT_JOINTS_NS {
            return;
        }
        let message = format!(
            "{topic}: no joint angles near the image at {:.3} s: the camera's orientation is estimated without them",
            seconds_from_ns(stamp_ns)
        );
        self.context.warn(WarningKind::NoJointAngles, topic, stamp_ns, message);
    }

    fn read_imu_until(&mut self, stamp_ns: i64) {
        while !self.imu_ended && self.buffer.samples.back().is_none_or(|last| last.stamp_ns < stamp_ns) {
            let Some(sample) = self.imu.next(&mut self.context) else {
                self.imu_ended = true;
                return;
            };
            self.imu_gaps.push(&mut self.context, sample.stamp_ns);
            if sample.angular_velocity_rad_per_s.norm() > ROTATING_RAD_PER_S {
                self.rotating_ns = Some(sample.stamp_ns);
            }
            self.buffer.samples.push_back(sample);
        }
    }

    /// Samples from the end of the frame on, the first one interpolated there.
    fn imu_after(&mut self, end_ns: i64) -> Vec<ImuSample> {
        if self.after_ns == 0 {
            return Vec::new();
        }
        let last_ns = end_ns.saturating_add(self.after_ns);
        self.read_imu_until(last_ns);
        let following = self.buffer.samples.iter().filter(|sample| (end_ns + 1..=last_ns).contains(&sample.stamp_ns));
        self.buffer.previous_end.iter().chain(following).copied().collect()
    }

    fn warn_of_skipped_images(&mut self) {
        let count = std::mem::take(&mut self.skipped);
        if count > 0 {
            let message = format!(
                "{}: {} before the first IMU sample at {:.3} s skipped",
                self.camera.topic,
                counted(count, "image"),
                seconds_from_ns(self.buffer.samples.front().map_or(0, |first| first.stamp_ns))
            );
            let warning = LogWarning::new(WarningKind::ImageBeforeImu, &self.camera.topic, self.start_ns, message);
            self.context.warnings.push(warning.with_count(count, self.start_ns));
        }
    }

    fn note_left_out(&mut self, stamp_ns: i64) {
        let left_out = self.left_out.get_or_insert(LeftOut { first_ns: stamp_ns, last_ns: stamp_ns, count: 0 });
        left_out.last_ns = stamp_ns;
        left_out.count += 1;
    }

    fn warn_of_left_out(&mut self) {
        let Some(LeftOut { first_ns, last_ns, count }) = self.left_out.take() else { return };
        let message = format!(
            "{}: {} from {:.3} s to {:.3} s left out, because the run was behind; the recording has them",
            self.camera.topic,
            counted(count, "image"),
            seconds_from_ns(first_ns),
            seconds_from_ns(last_ns)
        );
        let warning = LogWarning::new(WarningKind::LeftOut, &self.camera.topic, first_ns, message);
        self.context.warnings.push(warning.with_count(count, last_ns));
    }

    fn warn_of_imu_end(&mut self, stamp_ns: i64, number: usize) {
        let left = self.camera.count(&self.context).saturating_sub(number);
        let Some(last) = self.buffer.samples.back() else {
            let message = format!("{}: no IMU sample for the images of {}", self.imu_topic, self.camera.key);
            self.context.warn(WarningKind::NoImu, &self.imu_topic, stamp_ns, message);
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
            let warning = LogWarning::new(WarningKind::ImageAfterImu, &self.camera.topic, last.stamp_ns, message);
            self.context.warnings.push(warning.with_count(left, last.stamp_ns));
        }
    }
}

/// Topic of the joint angles of a camera, `None` for a rigid one.
fn joint_topic(rig: &Rig, camera: &CameraRig) -> Option<String> {
    rig.gimbal.as_ref().filter(|_| camera.mount == CameraMount::Gimbal)?.topic.clone()
}

/// Half an interval between images, by the slower of the rig's rate and the log's mean rate.
pub(super) fn half_interval_ns(rig_rate_hz: f64, log_rate_hz: f64) -> i64 {
    let slower = [rig_rate_hz, log_rate_hz].into_iter().filter(|rate| *rate > 0.0).fold(f64::INFINITY, f64::min);
    if slower.is_finite() { ns_from_seconds(0.5 / slower) } else { i64::MAX }
}

/// Joint angles of the gimbal, `None` without a gimbal or encoders.
pub(super) fn joint_angles(
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
