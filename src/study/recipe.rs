//! A simulated flight of a plan, as plain values that determine the options of the simulation.

use serde::{Deserialize, Serialize};

use crate::sensors::ChainPrior;
use crate::simulated_log::{SimulationError, SimulationOptions};
use crate::simulation::{Experiment, Lens, WorldKind};
use crate::text::Named as _;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EncoderNoise {
    /// The encoder noise of the experiment.
    OfExperiment,
    /// No encoders in the log.
    None,
    /// White noise of this standard deviation, in degrees.
    Degrees(f64),
}

/// Name of the second camera on the gimbal.
const SECOND_GIMBAL_CAMERA: &str = "thermal";

/// A simulated flight, without its seed and the disturbances of the plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightRecipe {
    /// Name in the tables.
    pub name: String,
    /// Name of the experiment, `T1` to `T4`.
    pub experiment: String,
    /// `textured`, `plain` or `facades`; `None` for the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world: Option<String>,
    /// Swing of the vehicle's heading in degrees, `None` for the experiment's heading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swing_deg: Option<f64>,
    /// True if the path is mirrored: T1 then circles to the right.
    pub mirrored: bool,
    /// Duration in seconds, `None` for the experiment's.
    pub duration_s: Option<f64>,
    pub encoder: EncoderNoise,
    /// Width and height of the images in pixels.
    pub size_px: [usize; 2],
    /// Frame rate of the cameras.
    pub rate_hz: f64,
    /// True if the static camera is recorded as well.
    pub static_camera: bool,
    /// Frame rate of the static camera, `None` for `rate_hz`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_camera_rate_hz: Option<f64>,
    /// Time by which the static camera exposes its images later than the gimbal camera, `None` for cameras that are triggered
    /// together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_camera_phase_s: Option<f64>,
    /// Distance of a second static camera to the right of the static one, `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stereo_baseline_m: Option<f64>,
    /// Second camera on the gimbal: `thermal`; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gimbal_camera: Option<String>,
    /// Factor of the noise of an IMU that moves with the gimbal camera, `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gimbal_imu_noise_scale: Option<f64>,
    /// Disturbances of every flight of this recipe, in the syntax of `dcvins simulate --disturb`.
    pub disturb: Vec<String>,
    /// Bound of the error of each translation of the given chain in metres, `None` for the experiment's.
    pub start_error_m: Option<f64>,
    /// Bound of the error of each angle of the given chain in degrees, `None` for the experiment's.
    pub start_error_deg: Option<f64>,
    /// Factor of the IMU's noise and biases.
    pub imu_noise_scale: f64,
    /// Lens model: `pinhole` or `radtan`.
    pub lens: String,
}

impl FlightRecipe {
    /// Checks names and ranges; the error contains the key and the problem.
    pub(super) fn check(&self) -> Result<(), (&'static str, String)> {
        if self.experiment().is_none() {
            return Err(("experiment", format!("is '{}', expected {}", self.experiment, Experiment::alternatives())));
        }
        if self.lens().is_none() {
            return Err(("lens", format!("is '{}', expected {}", self.lens, Lens::alternatives())));
        }
        let Some(world) = self.world() else {
            let found = self.world.as_deref().unwrap_or_default();
            return Err(("world", format!("is '{found}', expected {}", WorldKind::alternatives())));
        };
        if let (Some(environment), Some(experiment)) = (world.environment(), self.experiment())
            && environment != experiment.environment()
        {
            return Err(("world", SimulationError::WrongWorld { world, experiment }.to_string()));
        }
        if let Some(found) = self.gimbal_camera.as_deref().filter(|kind| *kind != SECOND_GIMBAL_CAMERA) {
            return Err(("gimbal_camera", format!("is '{found}', expected {SECOND_GIMBAL_CAMERA}")));
        }
        let options = self.options(1, &[]).map_err(|error| ("disturb", error.to_string()))?;
        options.check().map_err(|error| ("disturb", error.to_string()))
    }

    fn experiment(&self) -> Option<Experiment> {
        Experiment::from_name(&self.experiment)
    }

    fn world(&self) -> Option<WorldKind> {
        self.world.as_deref().map_or(Some(WorldKind::Textured), WorldKind::from_name)
    }

    fn lens(&self) -> Option<Lens> {
        Lens::from_name(&self.lens)
    }

    /// Options of the simulation with a seed and additional disturbances.
    ///
    /// # Errors
    /// For a disturbance that cannot be parsed.
    pub fn options(&self, seed: u64, disturb: &[String]) -> Result<SimulationOptions, SimulationError> {
        let mut options = SimulationOptions::new(self.experiment().unwrap_or(Experiment::T3));
        options.world = self.world().unwrap_or_default();
        options.swing_rad = self.swing_deg.map(f64::to_radians);
        options.mirrored = self.mirrored;
        options.seed = seed;
        options.duration_s = self.duration_s;
        match self.encoder {
            EncoderNoise::OfExperiment => {}
            EncoderNoise::None => options.encoder_sigma_rad = None,
            EncoderNoise::Degrees(sigma_deg) => options.encoder_sigma_rad = Some(sigma_deg.to_radians()),
        }
        options.start_error = ChainPrior {
            translation_bound_m: self.start_error_m.unwrap_or(options.start_error.translation_bound_m),
            rotation_bound_rad: self.start_error_deg.map_or(options.start_error.rotation_bound_rad, f64::to_radians),
        };
        options.imu_noise_scale = self.imu_noise_scale;
        options.lens = self.lens().unwrap_or(Lens::Pinhole);
        options.resolution_px = self.size_px;
        options.camera_rate_hz = self.rate_hz;
        options.static_camera = self.static_camera;
        options.static_camera_rate_hz = self.static_camera_rate_hz;
        options.static_camera_phase_s = self.static_camera_phase_s.unwrap_or(0.0);
        options.stereo_baseline_m = self.stereo_baseline_m;
        options.second_gimbal_camera = self.gimbal_camera.is_some();
        options.gimbal_imu_noise_scale = self.gimbal_imu_noise_scale;
        for text in self.disturb.iter().chain(disturb) {
            options.disturbances.set(text)?;
        }
        Ok(options)
    }
}
