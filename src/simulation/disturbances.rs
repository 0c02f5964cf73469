//! Simulated sensor faults and calibration errors.

use super::error::SimulationError;
use super::interval::during;
use super::vibration::Vibration;

/// Simulated sensor faults and calibration errors; none by default.
///
/// Times are in seconds since the log's start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Disturbances {
    /// Kalibr's `timeshift_cam_imu`, `t_imu = t_cam + shift`; applied to the data only, absent from the given rig.
    pub camera_time_offset_s: f64,
    /// Readout of the cameras: row v is exposed `v / height · readout` after the stamp. Applied to the data only,
    /// absent from the given rig.
    pub readout_s: f64,
    /// Error of the given rig's focal lengths, as a ratio: 0.01 makes them 1 % too long.
    pub focal_ratio: f64,
    /// Standard deviations of the errors of the IMU's scales, and of its angles in radians (misalignment, rotation of
    /// the gyroscope). Applied to the data only, absent from the given rig.
    pub imu_intrinsics: [f64; 2],
    /// First-order Gauss–Markov error of each axis of the accelerometer: standard deviation in m/s², time constant in
    /// seconds.
    pub accelerometer_drift: Option<[f64; 2]>,
    /// Delay of the stamps of the joint angles after the measurement.
    pub joint_lag_s: f64,
    /// Start of the recording of joint angles.
    pub joint_start_s: f64,
    /// Start and duration of an interval without images.
    pub image_gap_s: Option<[f64; 2]>,
    /// Exposure time; images are blurred by the motion during it.
    pub exposure_s: f64,
    /// Standard deviation of the image noise in grey values; replaces that of the options.
    pub image_noise: Option<f64>,
    /// Quality of the JPEG images, 1 to 100; replaces that of the options.
    pub jpeg_quality: Option<f64>,
    /// Ratio by which the farthest corner is darker than the centre; replaces 0.12.
    pub vignetting: Option<f64>,
    /// Amplitude of the slow drift of the exposure as a ratio of its mean, as with automatic exposure; replaces 0.05.
    pub exposure_drift: Option<f64>,
    /// Range of the gyroscope, in rad/s.
    pub gyroscope_range_rad_per_s: Option<f64>,
    /// Range of the accelerometer, in m/s².
    pub accelerometer_range_m_per_s2: Option<f64>,
    /// Time and factor of a change of the light (a cloud, a shadow's edge); the cameras' automatic exposure compensates
    /// it with a time constant of 0.4 s.
    pub light_change: Option<[f64; 2]>,
    /// Start and duration of an interval in which the images are uniformly grey, as in fog or in front of a bare wall;
    /// noise is added.
    pub blank_s: Option<[f64; 2]>,
    /// Start and duration of an interval in which the operator swings the gimbal's heading back and forth, 60° to each
    /// side, at the motors' largest rate (200°/s).
    pub gimbal_slew_s: Option<[f64; 2]>,
    /// Joint (from 1) that is fixed at its angle, start and duration.
    pub fixed_joint: Option<[f64; 3]>,
    /// Start and duration of hovering with a sway of a centimetre; the flight continues afterwards.
    pub hover_s: Option<[f64; 2]>,
    /// Start and duration of an interval in which the camera keeps its orientation in the world exactly, within the
    /// joint limits.
    pub stabilized_s: Option<[f64; 2]>,
    /// Start, duration and rate (in rad/s) of a rotation of the vehicle about the vertical, beyond the limits of the
    /// experiments.
    pub spin: Option<[f64; 3]>,
    /// Vibration of the airframe in the IMU; images and gimbal are not affected.
    pub vibration: Option<Vibration>,
}

/// Default ratio by which the farthest corner of an image is darker than the centre.
pub(crate) const VIGNETTING: f64 = 0.12;
/// Default slow drift of the exposure as a ratio of its mean.
pub(crate) const EXPOSURE_DRIFT: f64 = 0.05;
/// Time constant of the cameras' automatic exposure.
const AUTO_EXPOSURE_S: f64 = 0.4;
/// Grey value of the images in a blank interval.
pub(crate) const BLANK_GREY: f32 = 150.0;

/// Keys and values of [`Disturbances::set`], for messages and help.
const KEYS: &str = "camera-offset=S, readout=S, focal=RATIO, imu-intrinsics=SCALE,RAD, accelerometer-drift=M/S²,S, \
                    joint-lag=S, joint-start=S, image-gap=START,LENGTH, exposure=S, image-noise=GREY, jpeg=QUALITY, vignetting=RATIO, exposure-drift=RATIO, \
                    gyroscope-range=RAD/S, accelerometer-range=M/S², light=START,FACTOR, blank=START,LENGTH, \
                    slew=START,LENGTH, spin=START,LENGTH,RAD/S, hold-joint=NUMBER,START,LENGTH, hover=START,LENGTH, \
                    stabilize=START,LENGTH or vibration=HZ,RAD/S,M/S²";

impl Disturbances {
    /// Adds one disturbance written as `KEY=VALUE[,VALUE…]`, in seconds and SI units, as on the command line.
    ///
    /// # Errors
    /// If the key is unknown or its values are invalid.
    pub fn set(&mut self, text: &str) -> Result<(), SimulationError> {
        let bad = |expected: String| SimulationError::BadDisturbance { text: text.to_owned(), expected };
        let unknown = || bad(format!("expected one of {KEYS}"));
        let (key, values) = text.split_once('=').ok_or_else(unknown)?;
        let values: Vec<f64> = values
            .split(',')
            .map(|value| value.parse::<f64>().ok().filter(|value| value.is_finite()))
            .collect::<Option<_>>()
            .ok_or_else(|| bad(format!("expected numbers after '{key}='")))?;
        let wants = |count: usize| bad(format!("'{key}' takes {count} comma-separated numbers, not {}", values.len()));
        let one = || <[f64; 1]>::try_from(values.as_slice()).map(|[value]| value).map_err(|_length| wants(1));
        let two = || <[f64; 2]>::try_from(values.as_slice()).map_err(|_length| wants(2));
        let three = || <[f64; 3]>::try_from(values.as_slice()).map_err(|_length| wants(3));
        match key {
            "camera-offset" => self.camera_time_offset_s = one()?,
            "readout" => self.readout_s = one()?,
            "focal" => self.focal_ratio = one()?,
            "imu-intrinsics" => self.imu_intrinsics = two()?,
            "accelerometer-drift" => self.accelerometer_drift = Some(two()?),
            "joint-lag" => self.joint_lag_s = one()?,
            "joint-start" => self.joint_start_s = one()?,
            "image-gap" => self.image_gap_s = Some(two()?),
            "exposure" => self.exposure_s = one()?,
            "image-noise" => self.image_noise = Some(one()?),
            "jpeg" => self.jpeg_quality = Some(one()?),
            "vignetting" => self.vignetting = Some(one()?),
            "exposure-drift" => self.exposure_drift = Some(one()?),
            "gyroscope-range" => self.gyroscope_range_rad_per_s = Some(one()?),
            "accelerometer-range" => self.accelerometer_range_m_per_s2 = Some(one()?),
            "light" => self.light_change = Some(two()?),
            "blank" => self.blank_s = Some(two()?),
            "slew" => self.gimbal_slew_s = Some(two()?),
            "spin" => self.spin = Some(three()?),
            "hold-joint" => self.fixed_joint = Some(three()?),
            "hover" => self.hover_s = Some(two()?),
            "vibration" => {
                let [rotor_hz, rate_rad_per_s, force_m_per_s2] = three()?;
                self.vibration = Some(Vibration { rotor_hz, rate_rad_per_s, force_m_per_s2 });
            }
            "stabilize" => self.stabilized_s = Some(two()?),
            _ => return Err(unknown()),
        }
        Ok(())
    }

    pub(crate) fn check(&self) -> Result<(), SimulationError> {
        let within = |option: &'static str, value: f64, low: f64, high: f64| {
            let inside = value >= low && value <= high;
            inside.then_some(()).ok_or(SimulationError::BadOption { option, value, low, high })
        };
        within("camera time offset in seconds", self.camera_time_offset_s, -1.0, 1.0)?;
        within("readout in seconds", self.readout_s, -0.2, 0.2)?;
        within("error of the focal length as a ratio", self.focal_ratio, -0.5, 0.5)?;
        within("error of the IMU's scales", self.imu_intrinsics[0], 0.0, 0.1)?;
        within("error of the IMU's angles in radians", self.imu_intrinsics[1], 0.0, 0.1)?;
        let [drift_m_per_s2, drift_s] = self.accelerometer_drift.unwrap_or([0.0, 1.0]);
        within("drift of the accelerometer in m/s²", drift_m_per_s2, 0.0, 10.0)?;
        within("time constant of the accelerometer's drift in seconds", drift_s, 0.01, 1e5)?;
        within("joint lag in seconds", self.joint_lag_s, 0.0, 10.0)?;
        within("start of the joint angles in seconds", self.joint_start_s, 0.0, 3600.0)?;
        within("exposure in seconds", self.exposure_s, 0.0, 0.2)?;
        within("image noise in grey values", self.image_noise.unwrap_or(0.0), 0.0, 100.0)?;
        within("JPEG quality", self.jpeg_quality.unwrap_or(1.0), 1.0, 100.0)?;
        within("vignetting as a ratio", self.vignetting.unwrap_or(0.0), 0.0, 1.0)?;
        within("drift of the exposure as a ratio", self.exposure_drift.unwrap_or(0.0), 0.0, 0.9)?;
        within("range of the gyroscope in rad/s", self.gyroscope_range_rad_per_s.unwrap_or(1.0), 1e-3, 1e3)?;
        within("range of the accelerometer in m/s²", self.accelerometer_range_m_per_s2.unwrap_or(1.0), 1e-3, 1e4)?;
        within("factor of the light", self.light_change.map_or(1.0, |[_, factor]| factor), 0.01, 100.0)?;
        within("number of the fixed joint", self.fixed_joint.map_or(1.0, |[joint, _, _]| joint), 1.0, 3.0)?;
        within("length of the hover in seconds", self.hover_s.map_or(0.0, |[_, length]| length), 0.0, 3600.0)?;
        let vibration = self.vibration.unwrap_or(Vibration { rotor_hz: 1.0, rate_rad_per_s: 0.0, force_m_per_s2: 0.0 });
        within("frequency of the rotors in Hz", vibration.rotor_hz, 1.0, 1000.0)?;
        within("vibration in rad/s", vibration.rate_rad_per_s, 0.0, 100.0)?;
        within("vibration in m/s²", vibration.force_m_per_s2, 0.0, 1000.0)?;
        within("rate of the spin in rad/s", self.spin.map_or(0.0, |[_, _, rate]| rate), -6.0, 6.0)
    }

    /// Ratio of the image brightness at a time to the brightness without a change of the light.
    pub(crate) fn light_at(&self, time_s: f64) -> f64 {
        match self.light_change {
            Some([start_s, factor]) if time_s >= start_s => factor.powf((-(time_s - start_s) / AUTO_EXPOSURE_S).exp()),
            _ => 1.0,
        }
    }

    /// True if the images are blank at a time.
    pub(crate) fn blank_at(&self, time_s: f64) -> bool {
        during(self.blank_s, time_s)
    }
}
