/// Joint angles at one time, in the order of the rig's links, without the static offsets.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSample {
    /// Header stamp in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    /// One angle per joint in radians.
    pub angles_rad: Vec<f64>,
}

/// Joint angles at an image's stamp as the encoders measure them, in the order of the rig's links, without the static
/// offsets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointAngles {
    /// One angle per joint in radians.
    pub angles_rad: Vec<f64>,
    /// Standard deviation of each angle in radians: below the rig's value for one reading if several were averaged.
    pub sigmas_rad: Vec<f64>,
    /// Part of each standard deviation in radians that is common to consecutive images, so that no average reduces it
    /// (zero for white noise).
    pub lasting_sigmas_rad: Vec<f64>,
    /// Angular rate of each joint in rad/s from the readings around the stamp; zero if they do not constrain it.
    pub rates_rad_per_s: Vec<f64>,
    /// Angular acceleration of each joint, and standard deviations of rate and acceleration.
    pub motion_fits: Vec<JointMotionFit>,
}

/// Parabola fitted to the readings of a joint around a stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotionFit {
    /// Standard deviation of the rate in rad/s, infinite if the readings do not constrain it.
    pub rate_sigma_rad_per_s: f64,
    pub acceleration_rad_per_s2: f64,
    /// Standard deviation of the acceleration in rad/s², infinite if the readings do not constrain it.
    pub acceleration_sigma_rad_per_s2: f64,
}

impl JointMotionFit {
    /// Rates of a fit without any readings, with infinite standard deviation.
    pub const UNKNOWN: Self = Self {
        rate_sigma_rad_per_s: f64::INFINITY,
        acceleration_rad_per_s2: 0.0,
        acceleration_sigma_rad_per_s2: f64::INFINITY,
    };
}

impl JointAngles {
    pub fn heap_bytes(&self) -> usize {
        let all = [&self.angles_rad, &self.sigmas_rad, &self.lasting_sigmas_rad, &self.rates_rad_per_s];
        all.iter().map(|numbers| numbers.capacity() * size_of::<f64>()).sum::<usize>()
            + self.motion_fits.capacity() * size_of::<JointMotionFit>()
    }
}
