//! Recorded samples of one sensor from the start of a log to its end, for conversion to other formats.

use std::sync::Arc;

use super::camera::CameraStream;
use super::frames::{half_interval_ns, joint_angles};
use super::ground_truth::GroundTruth;
use super::imu::ImuStream;
use super::joint_topic::JointSamples;
use super::read_context::ReadContext;
use crate::flight_log::{FlightLog, LogError, LogWarning};
use crate::sensors::{CameraMount, CameraRig, GrayImage, ImuSample, JointAngles, JointSample, PoseSample, Rig};

/// Start of reading: before every message of a log.
const FROM_NS: i64 = i64::MIN / 8;

/// Image with its stamp in camera time, in nanoseconds since the start of the log.
#[derive(Clone, Debug)]
pub struct RecordedImage {
    pub stamp_ns: i64,
    pub image: Arc<GrayImage>,
    /// Joint angles at the image; `None` for a rigid camera, and without a reading near it.
    pub joint_angles: Option<JointAngles>,
}

/// Next sample of a sensor, `None` at the end of the log.
type NextSample<T> = Box<dyn FnMut(&mut ReadContext) -> Option<T>>;

/// Samples of one sensor in the order of their stamps, read chunk by chunk.
pub struct SensorSamples<T> {
    context: ReadContext,
    source: NextSample<T>,
}

impl<T> SensorSamples<T> {
    fn new(log: &Arc<FlightLog>, source: NextSample<T>) -> Self {
        Self { context: ReadContext::new(Arc::clone(log)), source }
    }

    /// Removes and returns the problems met since the last call.
    pub fn take_warnings(&mut self) -> Vec<LogWarning> {
        std::mem::take(&mut self.context.warnings)
    }
}

impl<T> Iterator for SensorSamples<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        (self.source)(&mut self.context)
    }
}

/// Samples of the IMU, corrected by the rig's scale and misalignment.
///
/// # Errors
/// If the log lacks a topic of the rig's IMU.
pub fn imu_samples(log: &Arc<FlightLog>, rig: &Rig) -> Result<SensorSamples<ImuSample>, LogError> {
    let mut imu = ImuStream::new(log, &rig.imu, FROM_NS)?;
    let source = move |context: &mut ReadContext| {
        let sample = imu.next(context);
        if sample.is_none() {
            imu.finish(context);
        }
        sample
    };
    Ok(SensorSamples::new(log, Box::new(source)))
}

/// All images of a camera that can be decoded, copies of the image before included.
///
/// # Errors
/// If the log lacks the camera's topic, or its joint angles do not match the rig.
pub fn recorded_images(
    log: &Arc<FlightLog>,
    rig: &Rig,
    camera: &CameraRig,
) -> Result<SensorSamples<RecordedImage>, LogError> {
    let mut images = CameraStream::new(log, camera, FROM_NS)?;
    let half_ns = half_interval_ns(camera.rate_hz, log.topic(&camera.topic).map_or(0.0, |info| info.rate_hz));
    let mut joints = match camera.mount {
        CameraMount::Gimbal => joint_angles(log, rig, FROM_NS, half_ns)?,
        CameraMount::Static { .. } => None,
    };
    let mut previous_ns = None;
    let source = move |context: &mut ReadContext| loop {
        let Some((stamp_ns, pending)) = images.next(context) else {
            images.finish(context);
            return None;
        };
        let imu_stamp_ns = stamp_ns + images.shift_ns;
        let before_ns = previous_ns.replace(imu_stamp_ns);
        let joint_angles = joints.as_mut().and_then(|joints| joints.at(context, imu_stamp_ns, before_ns));
        if let Some(image) = images.decode_any(context, stamp_ns, pending) {
            return Some(RecordedImage { stamp_ns, image, joint_angles });
        }
    };
    Ok(SensorSamples::new(log, Box::new(source)))
}

/// Stamps of a camera's images on the clock of the IMU, in nanoseconds since the start of the log, of messages with log
/// times at or after `from_ns`; images are not decoded.
///
/// # Errors
/// If the log lacks the camera's topic.
pub(crate) fn image_stamps(
    log: &Arc<FlightLog>,
    camera: &CameraRig,
    from_ns: i64,
) -> Result<SensorSamples<i64>, LogError> {
    let mut images = CameraStream::new(log, camera, from_ns)?;
    let source = move |context: &mut ReadContext| Some(images.next(context)?.0 + images.shift_ns);
    Ok(SensorSamples::new(log, Box::new(source)))
}

/// Angles of all joints as recorded, in IMU time: readings of encoders, or angles computed from the attitudes of the
/// gimbal. `None` without a gimbal or its topic.
///
/// # Errors
/// If the log lacks the topic, or a joint of the rig.
pub fn joint_samples(log: &Arc<FlightLog>, rig: &Rig) -> Result<Option<SensorSamples<JointSample>>, LogError> {
    let Some((gimbal, topic)) = rig.gimbal.as_ref().and_then(|gimbal| Some((gimbal, gimbal.topic.as_ref()?))) else {
        return Ok(None);
    };
    let mut joints = JointSamples::new(log, gimbal, topic, FROM_NS)?;
    Ok(Some(SensorSamples::new(log, Box::new(move |context| joints.next(context)))))
}

/// Ground-truth poses `world_from_imu` as recorded; `None` if the rig or the log has none, or only positions.
pub fn ground_truth_poses(log: &Arc<FlightLog>, rig: &Rig) -> Option<SensorSamples<PoseSample>> {
    let mut context = ReadContext::new(Arc::clone(log));
    let mut poses = GroundTruth::new(log, rig, FROM_NS, &mut context)?;
    Some(SensorSamples { context, source: Box::new(move |context| poses.next(context)) })
}
