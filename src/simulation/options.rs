use std::path::PathBuf;

use thiserror::Error;

use super::equipment::Lens;
use super::experiment::Experiment;
use crate::flight_log::LogError;
use crate::flight_log::rig::ChainPrior;

/// What `simulate` is to fly and record; [`SimulationOptions::new`] gives an experiment as the paper flew it.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationOptions {
    /// Which experiment.
    pub experiment: Experiment,
    /// Everything random follows from this.
    pub seed: u64,
    /// Length in seconds; `None` flies until the path has the experiment's length. A shorter flight is the beginning
    /// of a longer one.
    pub duration_s: Option<f64>,
    /// Standard deviation of the encoders' white noise; `None` records no joint angles.
    pub encoder_sigma_rad: Option<f64>,
    /// How wrong the given rig's chain is.
    pub start_error: ChainPrior,
    /// Scales noise, bias walk and turn-on biases of the inertial sensor; 0 makes it perfect.
    pub imu_noise_scale: f64,
    /// The cameras' lenses.
    pub lens: Lens,
    /// Size of the images.
    pub resolution_px: [usize; 2],
    /// Rate of the images.
    pub camera_rate_hz: f64,
    /// Whether the static camera is recorded as well.
    pub static_camera: bool,
    /// Standard deviation of the images' noise, in grey values.
    pub image_noise: f64,
    /// Quality of the JPEG images, 1 to 100.
    pub jpeg_quality: u8,
    /// What goes wrong.
    pub disturbances: Disturbances,
}

/// What may go wrong on a flight; by default nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Disturbances {
    /// Kalibr's `timeshift_cam_imu`, untold to the given rig: `t_imu = t_cam + shift`.
    pub camera_time_offset_s: f64,
    /// How much later than measured the joint angles are stamped.
    pub joint_lag_s: f64,
    /// Joint angles are recorded from this time on.
    pub joint_start_s: f64,
    /// From when and for how long no image is recorded.
    pub image_gap_s: Option<[f64; 2]>,
    /// Exposure time: images are blurred by the motion during it.
    pub exposure_s: f64,
    /// Largest rate that the gyroscope can measure, in rad/s.
    pub gyroscope_range_rad_per_s: Option<f64>,
    /// Largest specific force that the accelerometer can measure, in m/s².
    pub accelerometer_range_m_per_s2: Option<f64>,
}

impl SimulationOptions {
    /// An experiment with the paper's conditions; seed 1.
    pub fn new(experiment: Experiment) -> Self {
        Self {
            experiment,
            seed: 1,
            duration_s: None,
            encoder_sigma_rad: Some(experiment.encoder_sigma_rad()),
            start_error: experiment.start_error(),
            imu_noise_scale: 1.0,
            lens: Lens::Pinhole,
            resolution_px: [640, 480],
            camera_rate_hz: 20.0,
            static_camera: true,
            image_noise: 2.0,
            jpeg_quality: 85,
            disturbances: Disturbances::default(),
        }
    }

    /// Refuses what cannot be flown or recorded.
    pub(crate) fn check(&self) -> Result<(), SimulationError> {
        let within = |option: &'static str, value: f64, low: f64, high: f64| {
            let inside = value >= low && value <= high;
            inside.then_some(()).ok_or(SimulationError::BadOption { option, value, low, high })
        };
        if let Some(duration_s) = self.duration_s {
            within("duration in seconds", duration_s, 0.5, 3600.0)?;
        }
        if let Some(sigma) = self.encoder_sigma_rad {
            within("encoder sigma in degrees", sigma.to_degrees(), 0.0, 90.0)?;
        }
        within("translation bound in metres", self.start_error.translation_bound_m, 0.0, 1.0)?;
        within("rotation bound in degrees", self.start_error.rotation_bound_rad.to_degrees(), 0.0, 90.0)?;
        within("scale of the IMU noise", self.imu_noise_scale, 0.0, 1000.0)?;
        within("image width", self.resolution_px[0] as f64, 32.0, 4096.0)?;
        within("image height", self.resolution_px[1] as f64, 24.0, 4096.0)?;
        within("camera rate in Hz", self.camera_rate_hz, 0.1, 200.0)?;
        within("image noise in grey values", self.image_noise, 0.0, 100.0)?;
        within("JPEG quality", f64::from(self.jpeg_quality), 1.0, 100.0)?;
        within("camera time offset in seconds", self.disturbances.camera_time_offset_s, -1.0, 1.0)?;
        within("joint lag in seconds", self.disturbances.joint_lag_s, 0.0, 10.0)?;
        within("start of the joint angles in seconds", self.disturbances.joint_start_s, 0.0, 3600.0)?;
        within("exposure in seconds", self.disturbances.exposure_s, 0.0, 0.2)
    }
}

/// What `simulate` has written.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationSummary {
    /// The log.
    pub log: PathBuf,
    /// The rig given to an estimator.
    pub rig: PathBuf,
    /// The rig as it is, with what else is known.
    pub truth: PathBuf,
    /// Length in seconds.
    pub duration_s: f64,
    /// Length of the path.
    pub path_length_m: f64,
    /// Number of images, all cameras together.
    pub images: usize,
    /// How far the given chain is off over the joint angles visited, on the mean: metres and radians.
    pub given_chain_error: (f64, f64),
}

/// How far a simulation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimulationProgress {
    /// Images rendered and written.
    pub images_done: usize,
    /// Images in all.
    pub images_total: usize,
}

/// Why a simulation ended without its files.
#[derive(Debug, Error)]
pub enum SimulationError {
    /// An option out of its range.
    #[error("{option} is {value}: expected {low} to {high}")]
    BadOption {
        /// Which.
        option: &'static str,
        /// What it holds.
        value: f64,
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// An image could not be compressed.
    #[error("cannot compress an image as JPEG: {problem}")]
    Image {
        /// The encoder's answer.
        problem: String,
    },
    /// A file could not be written.
    #[error(transparent)]
    Log(#[from] LogError),
}
