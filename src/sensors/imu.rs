use nalgebra::Vector3;

/// IMU sample in the IMU frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Header stamp in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    pub angular_velocity_rad_per_s: Vector3<f64>,
    /// Specific force: +g upwards when stationary.
    pub specific_force_m_per_s2: Vector3<f64>,
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
