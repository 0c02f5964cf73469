use nalgebra::Vector3;

use crate::geometry::seconds_from_ns;

/// Standard gravity (ISO 80000-3), the unit of accelerations in g.
pub const STANDARD_GRAVITY_M_PER_S2: f64 = 9.806_65;

/// IMU sample in the IMU frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Header stamp in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    pub angular_velocity_rad_per_s: Vector3<f64>,
    /// Specific force: +g upwards when stationary.
    pub specific_force_m_per_s2: Vector3<f64>,
}

/// Rotation vector (rad) from each sample to the next, at their mean angular velocity without a bias (rad/s).
pub fn rotation_steps<'a>(samples: &'a [ImuSample], bias: &'a Vector3<f64>) -> impl Iterator<Item = Vector3<f64>> + 'a {
    samples.windows(2).map(move |pair| {
        let mean = (pair[0].angular_velocity_rad_per_s + pair[1].angular_velocity_rad_per_s) * 0.5;
        (mean - bias) * seconds_from_ns(pair[1].stamp_ns - pair[0].stamp_ns)
    })
}

/// Continuous-time noise densities of an IMU, as in Kalibr.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuNoise {
    /// White noise of the accelerometer in m/s²/√Hz.
    pub accelerometer_noise_density: f64,
    /// Random walk of the accelerometer bias in m/s³/√Hz.
    pub accelerometer_random_walk: f64,
    /// White noise of the gyroscope in rad/s/√Hz.
    pub gyroscope_noise_density: f64,
    /// Random walk of the gyroscope bias in rad/s²/√Hz.
    pub gyroscope_random_walk: f64,
}

impl ImuNoise {
    /// No noise: measurements taken as exact, or absent.
    pub const ZERO: Self = Self {
        accelerometer_noise_density: 0.0,
        accelerometer_random_walk: 0.0,
        gyroscope_noise_density: 0.0,
        gyroscope_random_walk: 0.0,
    };

    /// Noise with all densities multiplied by a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            accelerometer_noise_density: self.accelerometer_noise_density * factor,
            accelerometer_random_walk: self.accelerometer_random_walk * factor,
            gyroscope_noise_density: self.gyroscope_noise_density * factor,
            gyroscope_random_walk: self.gyroscope_random_walk * factor,
        }
    }
}
