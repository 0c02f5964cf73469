//! Constant input of every step: the configuration and derived values.

use nalgebra::Vector3;

use super::config::{EstimatorConfig, rigid_chain};
use super::state::calibration::{Calibration, FreeClocks, GivenSigmas};
use super::state::calibrations::{Calibrations, MAIN};
use super::step_input::StepInput;
use crate::gimbal::Parameterization;
use crate::sensors::{ImuNoise, JointAngles};

/// Gravity in the world frame, whose z axis points up: `(0, 0, −g)` in m/s².
pub fn gravity_in_world(gravity_m_per_s2: f64) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -gravity_m_per_s2)
}

/// The configuration and derived values.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    pub(crate) config: EstimatorConfig,
    /// The rig's noise densities times [`crate::estimator::EstimatorOptions::imu_noise_factor`].
    pub(crate) imu_noise: ImuNoise,
    /// In the world frame, in m/s².
    pub(crate) gravity_in_world: Vector3<f64>,
}

impl Setup {
    pub(crate) fn new(config: EstimatorConfig) -> Self {
        let mut imu_noise = config.imu_noise;
        scale_noise(&mut imu_noise, config.options.imu_noise_factor);
        Self { imu_noise, gravity_in_world: gravity_in_world(config.gravity_m_per_s2), config }
    }

    /// Scales the noise densities of all following IMU intervals.
    pub(crate) fn scale_imu_noise(&mut self, factor: f64) {
        scale_noise(&mut self.imu_noise, factor);
        scale_noise(&mut self.config.imu_noise, factor);
    }

    /// Milliseconds of the clock of the stage times.
    pub(crate) fn clock_ms(&self) -> f64 {
        (self.config.clock_ms)()
    }

    /// Given calibration of the rig.
    pub(crate) fn given_calibration(&self) -> Calibrations {
        let config = &self.config;
        let given = |camera: usize| {
            let (translation_m, rotation_rad) = config.extrinsics_sigmas(camera);
            GivenSigmas { translation_m, rotation_rad }
        };
        let encoders = config.encoder_in_use().is_some();
        let main = Calibration::new(&config.chain, config.parameterization, given(MAIN), config.calibrate, encoders);
        let clocks = |encoders: bool| match (config.estimate_timeshift, encoders) {
            (false, _) => FreeClocks::None,
            (true, false) => FreeClocks::Camera,
            (true, true) => FreeClocks::CameraAndEncoders,
        };
        let has_readings = main.joint_count() > 0 && encoders;
        let main = main.with_clocks(clocks(has_readings), config.timeshift_s);
        let rigid = config.rigid_cameras.iter().enumerate().map(|(index, camera)| {
            let mount = rigid_chain(&camera.imu_from_camera);
            Calibration::new(&mount, Parameterization::Minimal, given(index + 1), config.calibrate, false)
                .with_clocks(clocks(false), camera.timeshift_s)
        });
        Calibrations::new(main, rigid)
    }

    /// Encoder angles of the joints, `None` where they are unused or unusable.
    pub(crate) fn encoder_reading(&self, input: &StepInput<'_>, joints: usize) -> Option<JointAngles> {
        self.config.encoder_in_use()?;
        input.encoder_angles(joints).cloned()
    }
}

fn scale_noise(noise: &mut ImuNoise, factor: f64) {
    noise.accelerometer_noise_density *= factor;
    noise.accelerometer_random_walk *= factor;
    noise.gyroscope_noise_density *= factor;
    noise.gyroscope_random_walk *= factor;
}
