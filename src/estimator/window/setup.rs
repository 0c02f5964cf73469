//! Constant input of every step: configuration and derived values.

use nalgebra::Vector3;

use crate::estimator::config::{EstimatorConfig, rigid_chain};
use crate::estimator::factors::joint_motion::measured_joint_motion;
use crate::estimator::state::calibration::Calibration;
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::state::earlier_pass::BiasPrior;
use crate::estimator::state::given_chain::GivenSigmas;
use crate::estimator::state::imu_calibration::ImuCalibration;
use crate::estimator::state::motion_profile::MotionProfile;
use crate::estimator::state::navigation::GimbalImuState;
use crate::estimator::state::navigation::ImuBias;
use crate::estimator::state::preintegration::Preintegration;
use crate::estimator::state::sensor_columns::SensorColumn;
use crate::estimator::step_input::StepInput;
use crate::gimbal::Parameterization;
use crate::sensors::{ImuNoise, ImuSample, JointAngles};

/// Gravity in the world frame, whose z axis points up: `(0, 0, −g)` in m/s².
pub fn gravity_in_world(gravity_m_per_s2: f64) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -gravity_m_per_s2)
}

/// Largest part of an interval without samples of the IMU on the gimbal: rounding of stamps.
const MAX_MISSING_NS: i64 = 1_000;

#[derive(Clone, Debug)]
pub(crate) struct Setup {
    pub(crate) config: EstimatorConfig,
    /// The rig's noise densities times [`crate::estimator::EstimatorOptions::imu_noise_factor`].
    pub(crate) imu_noise: ImuNoise,
    /// Gravity in the world frame, in m/s².
    pub(crate) gravity_in_world: Vector3<f64>,
}

impl Setup {
    pub(crate) fn new(config: EstimatorConfig) -> Self {
        let imu_noise = config.imu_noise.scaled(config.options.imu_noise_factor);
        Self { imu_noise, gravity_in_world: gravity_in_world(config.gravity_m_per_s2), config }
    }

    /// Scales the noise densities of all following IMU intervals.
    pub(crate) fn scale_imu_noise(&mut self, factor: f64) {
        self.imu_noise = self.imu_noise.scaled(factor);
        self.config.imu_noise = self.config.imu_noise.scaled(factor);
    }

    /// Time of the stage-time clock in milliseconds.
    pub(crate) fn clock_ms(&self) -> f64 {
        (self.config.clock_ms)()
    }

    /// Initial calibration: the result of an earlier pass, else of earlier flights, else the rig's calibration.
    pub(crate) fn given_calibration(&self) -> Calibrations {
        let mut given = self.rig_calibration();
        if let Some(prior) = &self.config.calibration_prior {
            given = given.with_flights(&prior.cameras);
        }
        match &self.config.earlier_pass {
            Some(earlier) => given.with_found(&earlier.cameras),
            None => given,
        }
    }

    fn rig_calibration(&self) -> Calibrations {
        let config = &self.config;
        let given = |camera: usize| {
            let (translation_m, rotation_rad) = config.extrinsics_sigmas(camera);
            GivenSigmas { translation_m, rotation_rad }
        };
        let encoders = config.encoder_in_use().is_some();
        let main = Calibration::new(&config.chain, config.parameterization, given(MAIN), config.calibrate, encoders);
        let has_readings = main.joint_count() > 0 && encoders;
        let main = self.with_sensors(main, MAIN, config.timeshift_s, has_readings);
        let rigid = config.further_cameras.iter().enumerate().map(|(index, camera)| {
            let mount = rigid_chain(&camera.base_from_camera);
            let rigid = Calibration::new(&mount, Parameterization::Minimal, given(index + 1), config.calibrate, false);
            let rigid = self.with_sensors(rigid, index + 1, camera.timeshift_s, false);
            rigid.of_camera(index + 1, camera.number).mounted_on(camera.base)
        });
        let estimated = config.calibrate && config.estimate_imu_intrinsics;
        Calibrations::new(main, rigid)
            .with_imu(estimated.then(|| ImuCalibration::new(config.imu_intrinsics)))
            .led_by(config.frame_camera)
    }

    /// Prior of the biases from an earlier pass.
    pub(crate) fn found_bias(&self) -> Option<BiasPrior> {
        self.config.earlier_pass.as_ref().map(|earlier| earlier.bias)
    }

    /// Adds the columns of estimated time offsets, shutter and intrinsics of a camera.
    fn with_sensors(&self, calibration: Calibration, camera: usize, timeshift_s: f64, encoders: bool) -> Calibration {
        let config = &self.config;
        let sensor = config.sensor(camera);
        let mut columns = Vec::new();
        if config.estimate_timeshift {
            columns.push(SensorColumn::camera_clock(timeshift_s));
            columns.extend(encoders.then_some(SensorColumn::ENCODER_CLOCK));
        }
        if config.estimate_readout {
            columns.push(SensorColumn::readout(sensor.readout_s, sensor.readout_sigma_s));
        }
        if config.estimate_intrinsics {
            columns.extend(SensorColumn::intrinsics(config.model(camera), sensor.intrinsics_sigma));
        }
        if let Some(imu) = config.gimbal_imu.as_ref().filter(|_| config.estimate_gimbal_imu && camera == MAIN) {
            columns.extend(SensorColumn::gimbal_imu(imu.timeshift_s));
        }
        let gimbal_imu = config.gimbal_imu.as_ref().filter(|_| camera == MAIN).map(|imu| imu.camera_from_imu);
        let calibration = calibration.with_partner(config.partner(camera));
        calibration.with_sensors(columns).with_given_readout(sensor.readout_s).with_given_gimbal_imu(gimbal_imu)
    }

    /// True if some images are exposed at other times than the stamp of their frame, so that camera poses depend on the
    /// motion of the vehicle.
    pub(crate) fn has_moving_rows(&self) -> bool {
        self.config.frame_camera.is_some() || self.has_rolling_shutter()
    }

    fn has_rolling_shutter(&self) -> bool {
        let config = &self.config;
        let given = |camera: usize| config.sensor(camera).readout_s != 0.0;
        (config.estimate_readout && config.calibrate) || (0..=config.further_cameras.len()).any(given)
    }

    /// Motion of the vehicle near a stamp, from the samples before and after it and the times of the images; `None` if
    /// camera poses do not depend on it.
    pub(crate) fn motion_profile(
        &self,
        [before, after]: [&[ImuSample]; 2],
        image_times_s: &[f64],
        bias: ImuBias,
    ) -> Option<MotionProfile> {
        let samples = if after.is_empty() { &before[before.len().saturating_sub(1)..] } else { after };
        let earliest_s = image_times_s.iter().copied().fold(0.0, f64::min);
        let profile =
            || Some(MotionProfile::new(samples, bias, self.gravity_in_world)?.with_motion_before(before, earliest_s));
        self.has_moving_rows()
            .then(|| profile().unwrap_or_else(|| MotionProfile::stationary(bias, self.gravity_in_world)))
    }

    /// Initial joint rates and joint accelerations of the solver; empty if camera poses do not depend on them.
    pub(crate) fn initial_joint_motion(&self, encoder: Option<&JointAngles>, joints: usize) -> Vec<f64> {
        let count = if self.has_rolling_shutter() { 2 * joints } else { 0 };
        (0..count).map(|place| measured_joint_motion(encoder, place, joints).0).collect()
    }

    /// Unknowns of the IMU on the gimbal before any sample, at the velocity of the vehicle; `None` without one.
    pub(crate) fn initial_gimbal_imu(&self, velocity_m_per_s: Vector3<f64>) -> Option<GimbalImuState> {
        self.config.gimbal_imu.as_ref().map(|_| GimbalImuState { velocity_m_per_s, bias: ImuBias::default() })
    }

    /// Integrated samples of the IMU on the gimbal over an interval in nanoseconds; `None` without one, or if they do
    /// not cover it.
    pub(crate) fn gimbal_motion(
        &self,
        samples: &[ImuSample],
        bias: ImuBias,
        interval_ns: i64,
    ) -> Option<Preintegration> {
        let noise = self.config.gimbal_imu.as_ref()?.sensor.noise.scaled(self.config.options.imu_noise_factor);
        let (first, last) = (samples.first()?, samples.last()?);
        let missing_ns = interval_ns - (last.stamp_ns - first.stamp_ns);
        (missing_ns <= MAX_MISSING_NS).then(|| Preintegration::from_samples(noise, bias, samples))
    }

    /// Encoder angles of the joints, `None` if they are unused or unusable.
    pub(crate) fn encoder_reading(&self, input: &StepInput<'_>, joints: usize) -> Option<JointAngles> {
        self.config.encoder_in_use()?;
        input.encoder_angles(joints).cloned()
    }
}
