//! One camera's stream through the front end; every run that watches the camera is given these tracks.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::plan::SessionError;
use super::stopwatch::Stopwatch;
use crate::flight_log::rig::{CameraMount, Rig};
use crate::flight_log::{FlightLog, FrameStream, LogWarning, SensorFrame};
use crate::frontend::{FrontEnd, FrontEndOptions, TrackedFrame, predict_camera_rotation};
use crate::gimbal::ClassicalChain;

/// An image with its tracks.
#[derive(Clone, Debug)]
pub(super) struct TrackedSensorFrame {
    /// The sensors' part.
    pub frame: SensorFrame,
    /// The front end's part.
    pub tracks: Arc<TrackedFrame>,
    /// What the front end took.
    pub frontend_ms: f64,
}

/// Reads a camera's stream and tracks its features.
pub(super) struct CameraTracker {
    stream: FrameStream,
    front_end: FrontEnd,
    chain: ClassicalChain,
    previous_imu_from_camera: Option<UnitQuaternion<f64>>,
}

impl CameraTracker {
    /// Starts at a time of the log.
    pub(super) fn new(
        log: Arc<FlightLog>,
        rig: &Rig,
        camera_key: &str,
        start_s: f64,
        duration_s: Option<f64>,
    ) -> Result<Self, SessionError> {
        let stream = FrameStream::new(log, rig, camera_key, start_s, duration_s)?;
        let camera = rig.camera(camera_key)?;
        Ok(Self {
            stream,
            front_end: FrontEnd::new(camera.model.clone(), FrontEndOptions::default()),
            chain: chain_of_camera(rig, &camera.mount),
            previous_imu_from_camera: None,
        })
    }

    /// The next image with its tracks, `None` at the end of the stream; an image that the front end refuses is left out
    /// with a warning.
    pub(super) fn next_frame(&mut self) -> Option<TrackedSensorFrame> {
        let mut refused = Vec::new();
        loop {
            let mut frame = self.stream.next_frame()?;
            let watch = Stopwatch::start();
            let imu_from_camera = self.imu_from_camera(&frame);
            let predicted = match (self.previous_imu_from_camera, imu_from_camera) {
                // The bias is the estimators' business; over one frame it turns the image by a pixel or two at most.
                (Some(previous), Some(current)) => {
                    predict_camera_rotation(&frame.imu, &Vector3::zeros(), &previous, &current)
                }
                _ => None,
            };
            self.previous_imu_from_camera = imu_from_camera;
            match self.front_end.process(&frame.image, frame.stamp_ns, predicted.as_ref()) {
                Ok(tracks) => {
                    frame.warnings.append(&mut refused);
                    return Some(TrackedSensorFrame {
                        frame,
                        tracks: Arc::new(tracks),
                        frontend_ms: watch.elapsed_ms(),
                    });
                }
                Err(error) => {
                    refused.append(&mut frame.warnings);
                    refused.push(LogWarning { stamp_ns: frame.stamp_ns, message: format!("image left out: {error}") });
                }
            }
        }
    }

    /// What was wrong with the log behind the last frame.
    pub(super) fn remaining_warnings(&self) -> &[LogWarning] {
        self.stream.remaining_warnings()
    }

    /// Orientation of the camera on the IMU by the rig and the encoders, `None` when a joint's angle is not known.
    fn imu_from_camera(&self, frame: &SensorFrame) -> Option<UnitQuaternion<f64>> {
        let angles_rad = match &frame.joint_angles {
            // A rigid camera of a gimbal rig has readings beside it that are not its own.
            _ if self.chain.links.is_empty() => &[],
            Some(angles) => angles.angles_rad.as_slice(),
            None => return None,
        };
        Some(self.chain.imu_from_camera(angles_rad).rotation)
    }
}

/// The chain that carries a camera; without links for a rigid one.
pub(super) fn chain_of_camera(rig: &Rig, mount: &CameraMount) -> ClassicalChain {
    match (mount, &rig.gimbal) {
        (CameraMount::Static { imu_from_camera }, _) => {
            ClassicalChain { imu_from_base: *imu_from_camera, ..ClassicalChain::default() }
        }
        (CameraMount::Gimbal, Some(gimbal)) => gimbal.chain.clone(),
        (CameraMount::Gimbal, None) => ClassicalChain::default(),
    }
}
