//! Frames of one camera, each with its samples of the other sensors.

pub(crate) mod angle_fit;
mod attitude;
mod camera;
mod frames;
mod gaps;
mod gimbal_imu;
mod ground_truth;
mod imu;
mod joint_angles;
mod joint_topic;
pub(crate) mod ordered;
mod read_context;
mod sensor_samples;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

use self::frames::FrameSource;
pub use self::frames::SensorFrame;
pub use self::joint_angles::nominal_joint_sigma_rad;
pub(crate) use self::sensor_samples::image_stamps;
pub use self::sensor_samples::{
    RecordedImage, SensorSamples, ground_truth_poses, imu_samples, joint_samples, recorded_images,
};
use super::{FlightLog, LogError, LogWarning, WarningKind};
use crate::sensors::Rig;

/// Number of frames read ahead; one takes about half a megabyte.
const FRAMES_AHEAD: usize = 6;

/// Messages of the reading thread.
enum Delivery {
    Frame(Box<SensorFrame>),
    /// End of the log, with the warnings after the last frame.
    End(Vec<LogWarning>),
}

/// Frames of one camera in the order of their stamps.
///
/// A thread reads the log chunk by chunk, a few frames ahead; the frames do not depend on the speed of their consumer.
#[derive(Debug)]
pub struct FrameStream {
    /// `None` after the end has been reached.
    receiver: Option<Receiver<Delivery>>,
    thread: Option<JoinHandle<()>>,
    remaining_warnings: Vec<LogWarning>,
}

impl FrameStream {
    /// Starts with the camera's first frame at or after `start_s` (seconds since the start of the log) and ends
    /// `duration_s` later, or with the log. Fails if the rig does not match the log; a missing ground truth is a
    /// warning.
    pub fn new(
        log: Arc<FlightLog>,
        rig: &Rig,
        camera_key: &str,
        start_s: f64,
        duration_s: Option<f64>,
    ) -> Result<Self, LogError> {
        Self::with_motion_after(log, rig, camera_key, start_s, duration_s, 0.0)
    }

    /// [`Self::new`] with the IMU samples of `after_s` seconds after each stamp, during which the rows of a rolling
    /// shutter are exposed. Such a stream leaves out images of a log that is followed with a longest delay.
    pub fn with_motion_after(
        log: Arc<FlightLog>,
        rig: &Rig,
        camera_key: &str,
        start_s: f64,
        duration_s: Option<f64>,
        after_s: f64,
    ) -> Result<Self, LogError> {
        let path = log.path().to_owned();
        let mut source = FrameSource::new(log, rig, camera_key, start_s, duration_s)?.with_motion_after(after_s);
        // Images that are read ahead cannot be left out any more.
        let (sender, receiver) = sync_channel(if source.keeps_up() { 1 } else { FRAMES_AHEAD });
        let read_ahead = move || {
            while let Some(frame) = source.next_frame() {
                if sender.send(Delivery::Frame(Box::new(frame))).is_err() {
                    return; // the receiver was dropped
                }
            }
            // The warnings are lost if the receiver was dropped.
            drop(sender.send(Delivery::End(source.finish())));
        };
        let thread = std::thread::Builder::new().name("log-reader".into()).spawn(read_ahead);
        let thread =
            thread.map_err(|source| LogError::Io { action: "start a thread to read the log", source, path })?;
        Ok(Self { receiver: Some(receiver), thread: Some(thread), remaining_warnings: Vec::new() })
    }

    /// Next frame, `None` at the end.
    pub fn next_frame(&mut self) -> Option<SensorFrame> {
        match self.receiver.as_ref()?.recv() {
            Ok(Delivery::Frame(frame)) => return Some(*frame),
            Ok(Delivery::End(warnings)) => self.remaining_warnings = warnings,
            Err(_) => {
                let message = "reading stopped before the log's end: the reading thread failed".to_owned();
                self.remaining_warnings.push(LogWarning::new(WarningKind::ReadingStopped, "", 0, message));
            }
        }
        self.receiver = None;
        None
    }

    /// Problems of the log after the last frame; complete after `next_frame` has returned `None`.
    pub fn remaining_warnings(&self) -> &[LogWarning] {
        &self.remaining_warnings
    }
}

impl Iterator for FrameStream {
    type Item = SensorFrame;

    fn next(&mut self) -> Option<SensorFrame> {
        self.next_frame()
    }
}

impl Drop for FrameStream {
    fn drop(&mut self) {
        self.receiver = None; // lets the thread's next send fail, so that it ends
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported as a missing end.
            drop(thread.join());
        }
    }
}
