//! Feature tracking of one camera's stream; all runs on the camera share the tracks.

use std::sync::Arc;

use nalgebra::Vector3;

use super::partner_images::PartnerImages;
use super::step_inputs::OwnedStepInput;
use super::stopwatch::Stopwatch;
use crate::flight_log::{FlightLog, FrameStream, LogError, LogWarning, SensorFrame, WarningKind};
use crate::frontend::{
    ChainOrientation, FrontEnd, FrontEndOptions, PredictionNoise, StereoCamera, StereoMatcher, camera_rates,
    predict_camera_rotation,
};
use crate::gimbal::ClassicalChain;
use crate::sensors::{CameraMount, CameraRig, ChainPrior, ImuSample, PoseTrack, Rig};
use crate::session::plan::SessionError;

pub(super) struct CameraTracker {
    stream: FrameStream,
    front_end: FrontEnd,
    chain: ClassicalChain,
    noise: PredictionNoise,
    readout_s: f64,
    previous_orientation: Option<ChainOrientation>,
    gimbal_imu: Option<GimbalGyroscope>,
    /// Other camera of a stereo pair, `None` if no run uses one.
    stereo: Option<StereoTracker>,
    /// True after the first image.
    tracking: bool,
    /// Ground truth in place of the log's; `None` keeps the log's.
    ground_truth: Option<Arc<PoseTrack>>,
}

/// Matcher with the images of the other camera of a stereo pair.
struct StereoTracker {
    images: PartnerImages,
    matcher: StereoMatcher,
}

/// Gyroscope that moves with the camera.
struct GimbalGyroscope {
    /// Orientation of the camera relative to it, without joints.
    orientation: ChainOrientation,
    noise: PredictionNoise,
}

impl GimbalGyroscope {
    /// Gyroscope of the rig for a camera; `None` without one, or for a rigid camera.
    fn of_rig(rig: &Rig, camera: &CameraRig) -> Option<Self> {
        let imu = rig.gimbal_imu.as_ref().filter(|_| camera.is_on_gimbal())?;
        let imu_from_camera = imu.camera_from_imu.inverse() * camera.first_from_camera;
        let camera = ClassicalChain { imu_from_base: imu_from_camera, ..ClassicalChain::default() };
        Some(Self {
            orientation: ChainOrientation::new(&camera, &[], &[]),
            noise: PredictionNoise {
                gyroscope_bias_rad_per_s: GYROSCOPE_BIAS_SIGMA_RAD_PER_S,
                gyroscope_noise_density: imu.sensor.noise.gyroscope_noise_density,
                chain_rotation_rad: RIGID_EXTRINSICS_SIGMA_RAD,
            },
        })
    }
}

/// Standard deviation of a gyroscope's turn-on bias, in rad/s (1.1°/s, a small MEMS IMU).
const GYROSCOPE_BIAS_SIGMA_RAD_PER_S: f64 = 0.02;
/// Standard deviation of the orientation of a rigid camera's extrinsics, in radians (0.6°).
const RIGID_EXTRINSICS_SIGMA_RAD: f64 = 0.01;

/// Features of a camera on a gimbal, a fifth more than for a rigid camera: they also constrain its joint angles.
const FEATURES_ON_GIMBAL: usize = 180;

/// Time after a stamp for which IMU samples are kept for the rows of a rolling shutter: the readout takes at most 40
/// ms, and a time offset may be added. A run or a fork may estimate the readout on any log.
const LONGEST_READOUT_S: f64 = 0.06;
/// Additional time after the readout stated in the rig.
const READOUT_MARGIN_S: f64 = 0.03;

impl CameraTracker {
    /// Starts at a stamp of the log.
    pub(super) fn new(
        log: Arc<FlightLog>,
        rig: &Rig,
        camera_key: &str,
        start_s: f64,
        duration_s: Option<f64>,
    ) -> Result<Self, SessionError> {
        let camera = rig.camera(camera_key).map_err(LogError::from)?;
        let after_s = LONGEST_READOUT_S.max(camera.readout_s.abs() + READOUT_MARGIN_S);
        let stream = FrameStream::with_motion_after(log, rig, camera_key, start_s, duration_s, after_s)?;
        let mask = camera.mask.as_ref().map(|mask| mask.image.clone());
        Ok(Self {
            stream,
            front_end: FrontEnd::new(camera.model.clone(), front_end_options(&camera.mount)).with_mask(mask),
            chain: rig.chain_of_camera(camera_key).unwrap_or_default(),
            noise: prediction_noise(rig, &camera.mount),
            readout_s: camera.readout_s,
            previous_orientation: None,
            gimbal_imu: GimbalGyroscope::of_rig(rig, camera),
            stereo: None,
            tracking: false,
            ground_truth: None,
        })
    }

    /// Matches the features in the images of the other camera of a stereo pair.
    pub(super) fn with_partner(
        self,
        log: &Arc<FlightLog>,
        rig: &Rig,
        [camera_key, partner_key]: [&str; 2],
        start_s: f64,
        duration_s: Option<f64>,
    ) -> Result<Self, SessionError> {
        let partner = rig.camera(partner_key).map_err(LogError::from)?;
        let Some(camera_from_partner) = rig.base_from_camera(Some(camera_key), partner_key) else { return Ok(self) };
        let camera = StereoCamera {
            model: partner.model.clone(),
            mask: partner.mask.as_ref().map(|mask| mask.image.clone()),
            here_from_features: camera_from_partner.inverse(),
            orientation_sigma_rad: partner.relative_prior.unwrap_or(ChainPrior::RELATIVE).sigmas().1,
        };
        let stereo = StereoTracker {
            images: PartnerImages::new(FrameStream::new(Arc::clone(log), rig, partner_key, start_s, duration_s)?),
            matcher: StereoMatcher::new(self.front_end.camera().clone(), camera),
        };
        Ok(Self { stereo: Some(stereo), ..self })
    }

    /// Replaces the ground truth of the log; `None` keeps it.
    pub(super) fn with_ground_truth(self, ground_truth: Option<Arc<PoseTrack>>) -> Self {
        Self { ground_truth, ..self }
    }

    /// The next step input of this camera and the new warnings about the log, `None` at the end of the stream. An image
    /// that the front end rejects is skipped with a warning.
    pub(super) fn next_input(&mut self) -> Option<(OwnedStepInput, Vec<LogWarning>)> {
        let mut rejected = Vec::new();
        loop {
            let mut frame = self.stream.next_frame()?;
            if let Some(track) = &self.ground_truth {
                // The last IMU sample is at the stamp of the image on the IMU's clock.
                frame.ground_truth = frame.imu.last().and_then(|last| track.at(last.stamp_ns));
            }
            let watch = Stopwatch::start();
            let orientation = self.camera_orientation(&frame);
            // The gyroscope bias is not removed here: over one frame it rotates the image by two pixels at most.
            let predict =
                |imu: &[ImuSample], previous: &ChainOrientation, now: &ChainOrientation, noise: &PredictionNoise| {
                    let bias = Vector3::zeros();
                    predict_camera_rotation(imu, &bias, previous, now, noise).map(|predicted| {
                        predicted.with_readout(self.readout_s, camera_rates(imu, &bias, previous, now, self.readout_s))
                    })
                };
            // The gyroscope on the gimbal measures the rotation of the camera without the joints in between.
            let on_gimbal = self.gimbal_imu.as_ref().filter(|_| self.tracking).and_then(|gyroscope| {
                predict(&frame.gimbal_imu, &gyroscope.orientation, &gyroscope.orientation, &gyroscope.noise)
            });
            let predicted = on_gimbal.or_else(|| match (&self.previous_orientation, &orientation) {
                (Some(previous), Some(now)) => predict(&frame.imu, previous, now, &self.noise),
                _ => None,
            });
            self.tracking = true;
            self.previous_orientation = orientation;
            match self.front_end.process(&frame.image, frame.stamp_ns, predicted.as_ref()) {
                Ok(mut tracks) => {
                    if let Some(StereoTracker { images, matcher }) = &mut self.stereo
                        && let Some(other) = images.of_moment(&frame)
                    {
                        let own = self.front_end.last_image();
                        tracks.matched = matcher.match_features(own, &other.image, &tracks.features);
                    }
                    frame.warnings.append(&mut rejected);
                    let warnings = std::mem::take(&mut frame.warnings);
                    return Some((OwnedStepInput::of_camera(frame, tracks, watch.elapsed_ms()), warnings));
                }
                Err(error) => {
                    rejected.append(&mut frame.warnings);
                    let message = format!("image skipped: {error}");
                    rejected.push(LogWarning::new(WarningKind::ImageUnreadable, "", frame.stamp_ns, message));
                }
            }
        }
    }

    /// Warnings about the log after the last image.
    pub(super) fn remaining_warnings(&self) -> &[LogWarning] {
        self.stream.remaining_warnings()
    }

    /// Orientation `imu_from_camera` from rig and encoders, `None` when a joint angle is missing.
    fn camera_orientation(&self, frame: &SensorFrame) -> Option<ChainOrientation> {
        match &frame.joint_angles {
            // Encoder readings of a gimbal rig do not affect its rigid camera.
            _ if self.chain.links.is_empty() => Some(ChainOrientation::new(&self.chain, &[], &[])),
            Some(angles) => Some(
                ChainOrientation::new(&self.chain, &angles.angles_rad, &angles.sigmas_rad)
                    .with_joint_rates(&angles.rates_rad_per_s),
            ),
            None => None,
        }
    }
}

/// Options of the front end of a camera. All runs on a camera share its tracks, so the options depend only on the
/// camera.
fn front_end_options(mount: &CameraMount) -> FrontEndOptions {
    let mut options = FrontEndOptions::default();
    if *mount == CameraMount::Gimbal {
        options.corners.max_features = FEATURES_ON_GIMBAL;
    }
    options
}

/// Standard deviations of the inputs of the predicted camera rotation, from the rig.
fn prediction_noise(rig: &Rig, mount: &CameraMount) -> PredictionNoise {
    let gimbal = rig.gimbal.as_ref().filter(|_| *mount == CameraMount::Gimbal);
    PredictionNoise {
        gyroscope_bias_rad_per_s: GYROSCOPE_BIAS_SIGMA_RAD_PER_S,
        gyroscope_noise_density: rig.imu.noise.gyroscope_noise_density,
        // A uniform error of bound b has standard deviation b/√3.
        chain_rotation_rad: gimbal
            .map_or(RIGID_EXTRINSICS_SIGMA_RAD, |gimbal| gimbal.prior.rotation_bound_rad / 3.0_f64.sqrt()),
    }
}
