//! One camera's stream through the front end; every run that watches the camera is given these tracks.

use std::sync::Arc;

use nalgebra::Vector3;

use super::stopwatch::Stopwatch;
use crate::flight_log::{FlightLog, FrameStream, LogError, LogWarning, SensorFrame};
use crate::frontend::{
    ChainOrientation, FrontEnd, FrontEndOptions, PredictionNoise, TrackedFrame, predict_camera_rotation,
};
use crate::gimbal::ClassicalChain;
use crate::sensors::{CameraMount, Rig};
use crate::session::plan::SessionError;

/// An image with its tracks.
#[derive(Clone, Debug)]
pub(in crate::session) struct TrackedSensorFrame {
    /// The sensors' part.
    pub frame: SensorFrame,
    /// The front end's part.
    pub tracks: Arc<TrackedFrame>,
    /// What the front end took.
    pub frontend_ms: f64,
}

/// Reads a camera's stream and tracks its features.
pub(in crate::session) struct CameraTracker {
    stream: FrameStream,
    front_end: FrontEnd,
    chain: ClassicalChain,
    noise: PredictionNoise,
    previous_mount: Option<ChainOrientation>,
}

/// The turn-on bias of a gyroscope that nothing is known of, in rad/s (1.1°/s, of the small MEMS kind).
const GYROSCOPE_BIAS_SIGMA_RAD_PER_S: f64 = 0.02;
/// How wrong the orientation of a rigid camera on the IMU may be, in radians (0.6°).
const RIGID_MOUNT_SIGMA_RAD: f64 = 0.01;

impl CameraTracker {
    /// Starts at a time of the log.
    pub(in crate::session) fn new(
        log: Arc<FlightLog>,
        rig: &Rig,
        camera_key: &str,
        start_s: f64,
        duration_s: Option<f64>,
    ) -> Result<Self, SessionError> {
        let stream = FrameStream::new(log, rig, camera_key, start_s, duration_s)?;
        let camera = rig.camera(camera_key).map_err(LogError::from)?;
        Ok(Self {
            stream,
            front_end: FrontEnd::new(camera.model.clone(), FrontEndOptions::default()),
            chain: rig.chain_of_camera(camera_key).unwrap_or_default(),
            noise: prediction_noise(rig, &camera.mount),
            previous_mount: None,
        })
    }

    /// The next image with its tracks, `None` at the end of the stream; an image that the front end refuses is left out
    /// with a warning.
    pub(in crate::session) fn next_frame(&mut self) -> Option<TrackedSensorFrame> {
        let mut refused = Vec::new();
        loop {
            let mut frame = self.stream.next_frame()?;
            let watch = Stopwatch::start();
            let mount = self.mount(&frame);
            let predicted = match (&self.previous_mount, &mount) {
                // The bias is the estimators' business; over one frame it turns the image by a pixel or two at most.
                (Some(previous), Some(now)) => {
                    predict_camera_rotation(&frame.imu, &Vector3::zeros(), previous, now, &self.noise)
                }
                _ => None,
            };
            self.previous_mount = mount;
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
    pub(in crate::session) fn remaining_warnings(&self) -> &[LogWarning] {
        self.stream.remaining_warnings()
    }

    /// How the camera sits on the IMU by the rig and the encoders, `None` when a joint's angle is not known.
    fn mount(&self, frame: &SensorFrame) -> Option<ChainOrientation> {
        let (angles_rad, sigmas_rad) = match &frame.joint_angles {
            // A rigid camera of a gimbal rig has readings beside it that are not its own.
            _ if self.chain.links.is_empty() => (&[][..], &[][..]),
            Some(angles) => (angles.angles_rad.as_slice(), angles.sigmas_rad.as_slice()),
            None => return None,
        };
        Some(ChainOrientation::new(&self.chain, angles_rad, sigmas_rad))
    }
}

/// How wrong the rig says that may be of which a camera's rotation is predicted.
fn prediction_noise(rig: &Rig, mount: &CameraMount) -> PredictionNoise {
    let gimbal = rig.gimbal.as_ref().filter(|_| *mount == CameraMount::Gimbal);
    PredictionNoise {
        gyroscope_bias_rad_per_s: GYROSCOPE_BIAS_SIGMA_RAD_PER_S,
        gyroscope_noise_density: rig.imu.noise.gyroscope_noise_density,
        // A uniform error of bound b has standard deviation b/√3.
        chain_rotation_rad: gimbal
            .map_or(RIGID_MOUNT_SIGMA_RAD, |gimbal| gimbal.prior.rotation_bound_rad / 3.0_f64.sqrt()),
    }
}
