use std::path::PathBuf;

use super::disturbances::Disturbances;
use super::error::SimulationError;
use crate::sensors::{ChainPrior, Rig};
use crate::simulation::equipment::Lens;
use crate::simulation::experiment::{Experiment, WorldKind};
use crate::simulation::motion_samples::PrescribedMotion;

/// Flight and sensors of a simulation; [`SimulationOptions::new`] gives an experiment of the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationOptions {
    pub experiment: Experiment,
    /// Kind of the surfaces that the images show.
    pub world: WorldKind,
    /// Amplitude by which the vehicle's heading swings off what there is to see, at which the gimbal points; `None` for the
    /// experiment's heading and gimbal.
    pub swing_rad: Option<f64>,
    /// True if the path is mirrored at the x–z plane of the world: T1 then circles to the right.
    pub mirrored: bool,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Length in seconds; with `None` the path has the experiment's length. A shorter flight equals the beginning of a
    /// longer one.
    pub duration_s: Option<f64>,
    /// Standard deviation of the encoders' white noise; `None` records no joint angles.
    pub encoder_sigma_rad: Option<f64>,
    /// Errors of the given rig's chain.
    pub start_error: ChainPrior,
    /// Factor of noise, bias random walk and turn-on biases of the IMU; 0 makes it ideal.
    pub imu_noise_scale: f64,
    /// Factor of noise and biases of an IMU on the gimbal; `None` without one.
    pub gimbal_imu_noise_scale: Option<f64>,
    pub lens: Lens,
    pub resolution_px: [usize; 2],
    pub camera_rate_hz: f64,
    /// Rate of the static camera; `None` for the rate of the gimbal camera.
    pub static_camera_rate_hz: Option<f64>,
    /// Time from an image of the gimbal camera to the next one of the static camera, in seconds, at the start.
    pub static_camera_phase_s: f64,
    /// True if the static camera is also recorded.
    pub static_camera: bool,
    /// Distance of a second static camera to the right of the static one in metres, a stereo pair; `None` without one.
    pub stereo_baseline_m: Option<f64>,
    /// True if a second, thermal camera with a longer focal length is on the gimbal.
    pub second_gimbal_camera: bool,
    /// Standard deviation of the image noise, in grey values.
    pub image_noise: f64,
    /// Quality of the JPEG images, 1 to 100.
    pub jpeg_quality: u8,
    pub disturbances: Disturbances,
    /// Motion that replaces the experiment's, relative to the start of its route; `None` for the experiment's.
    pub motion: Option<PrescribedMotion>,
    /// True rig that replaces the firefly's, with its own cameras; it needs a motion ([`Self::with_rig`]).
    pub rig: Option<Rig>,
}

impl SimulationOptions {
    /// Experiment under the paper's conditions; seed 1.
    pub fn new(experiment: Experiment) -> Self {
        Self {
            experiment,
            world: WorldKind::Textured,
            swing_rad: None,
            mirrored: false,
            seed: 1,
            duration_s: None,
            encoder_sigma_rad: Some(experiment.encoder_sigma_rad()),
            start_error: experiment.start_error(),
            imu_noise_scale: 1.0,
            gimbal_imu_noise_scale: None,
            lens: Lens::Pinhole,
            resolution_px: [640, 480],
            camera_rate_hz: 20.0,
            static_camera_rate_hz: None,
            static_camera_phase_s: 0.0,
            static_camera: true,
            stereo_baseline_m: None,
            second_gimbal_camera: false,
            image_noise: 2.0,
            jpeg_quality: 85,
            disturbances: Disturbances::default(),
            motion: None,
            rig: None,
        }
    }

    /// The same flight with another true rig: its encoders, and errors of the given chain within its prior.
    #[must_use]
    pub fn with_rig(self, rig: Rig) -> Self {
        let gimbal = rig.gimbal.as_ref();
        Self {
            encoder_sigma_rad: gimbal.and_then(|gimbal| gimbal.encoder_sigma_rad),
            start_error: gimbal.map_or(self.start_error, |gimbal| gimbal.prior),
            rig: Some(rig),
            ..self
        }
    }

    pub(crate) fn check(&self) -> Result<(), SimulationError> {
        let within = |option: &'static str, value: f64, low: f64, high: f64| {
            let inside = value >= low && value <= high;
            inside.then_some(()).ok_or(SimulationError::BadOption { option, value, low, high })
        };
        if self.world.environment().is_some_and(|environment| environment != self.experiment.environment()) {
            return Err(SimulationError::WrongWorld { world: self.world, experiment: self.experiment });
        }
        if let Some(swing_rad) = self.swing_rad {
            within("swing in degrees", swing_rad.to_degrees(), 0.0, 90.0)?;
        }
        if let Some(duration_s) = self.duration_s {
            within("duration in seconds", duration_s, 0.5, 3600.0)?;
        }
        if let Some(sigma) = self.encoder_sigma_rad {
            within("encoder sigma in degrees", sigma.to_degrees(), 0.0, 90.0)?;
        }
        within("translation bound in metres", self.start_error.translation_bound_m, 0.0, 1.0)?;
        within("rotation bound in degrees", self.start_error.rotation_bound_rad.to_degrees(), 0.0, 90.0)?;
        within("scale of the IMU noise", self.imu_noise_scale, 0.0, 1000.0)?;
        if let Some(scale) = self.gimbal_imu_noise_scale {
            within("scale of the gimbal IMU's noise", scale, 0.0, 1000.0)?;
        }
        within("image width", self.resolution_px[0] as f64, 32.0, 4096.0)?;
        within("image height", self.resolution_px[1] as f64, 24.0, 4096.0)?;
        within("camera rate in Hz", self.camera_rate_hz, 0.1, 200.0)?;
        if let Some(rate_hz) = self.static_camera_rate_hz {
            within("rate of the static camera in Hz", rate_hz, 0.1, 200.0)?;
        }
        within("phase of the static camera in seconds", self.static_camera_phase_s, 0.0, 10.0)?;
        if let Some(baseline_m) = self.stereo_baseline_m {
            within("baseline of the stereo pair in metres", baseline_m, 0.01, 2.0)?;
        }
        within("image noise in grey values", self.image_noise, 0.0, 100.0)?;
        within("JPEG quality", f64::from(self.jpeg_quality), 1.0, 100.0)?;
        self.disturbances.check()
    }
}

/// Result of a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationSummary {
    pub log: PathBuf,
    /// Rig given to an estimator.
    pub rig: PathBuf,
    /// True rig with further ground truth.
    pub ground_truth: PathBuf,
    pub duration_s: f64,
    pub path_length_m: f64,
    /// Number of images of all cameras.
    pub images: usize,
    /// Mean extrinsics error of the given chain over the joint angles of the flight: metres and radians.
    pub given_chain_error: (f64, f64),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimulationProgress {
    pub images_done: usize,
    pub images_total: usize,
}
