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
    /// Time between the measured samples around one that is interpolated in a gap, in seconds; 0 otherwise.
    pub unmeasured_s: f64,
}

/// Longest interval between samples in seconds; a longer one is a gap, in which the motion between them is not known.
pub(crate) const LONGEST_INTERVAL_S: f64 = 0.06;

impl ImuSample {
    /// Sample at a time from this one to a later one, both included, by linear interpolation.
    pub fn interpolated(&self, to: &Self, stamp_ns: i64) -> Self {
        let interval_ns = to.stamp_ns - self.stamp_ns;
        if interval_ns <= 0 || stamp_ns >= to.stamp_ns {
            return Self { stamp_ns, ..if interval_ns > 0 { *to } else { *self } };
        }
        let fraction = (stamp_ns - self.stamp_ns) as f64 / interval_ns as f64;
        let interval_s = seconds_from_ns(interval_ns);
        let gap_s = if interval_s > LONGEST_INTERVAL_S { interval_s } else { to.unmeasured_s };
        let gap_s = if stamp_ns > self.stamp_ns { gap_s.max(self.unmeasured_s) } else { self.unmeasured_s };
        Self {
            stamp_ns,
            angular_velocity_rad_per_s: self.angular_velocity_rad_per_s.lerp(&to.angular_velocity_rad_per_s, fraction),
            specific_force_m_per_s2: self.specific_force_m_per_s2.lerp(&to.specific_force_m_per_s2, fraction),
            unmeasured_s: gap_s,
        }
    }
}

/// Sample at a time, by linear interpolation between samples in the order of their stamps; beyond the ends the nearest one.
/// `None` without any sample.
pub fn sample_at(samples: &[ImuSample], stamp_ns: i64) -> Option<ImuSample> {
    let after = samples.partition_point(|sample| sample.stamp_ns < stamp_ns);
    match (after.checked_sub(1).map(|before| &samples[before]), samples.get(after)) {
        (Some(before), Some(next)) => Some(before.interpolated(next, stamp_ns)),
        (before, next) => next.or(before).map(|nearest| ImuSample { stamp_ns, ..*nearest }),
    }
}

/// Samples from one time to another, both ends included as [`sample_at`].
pub fn samples_between(samples: &[ImuSample], from_ns: i64, to_ns: i64) -> Vec<ImuSample> {
    let first = samples.partition_point(|sample| sample.stamp_ns <= from_ns);
    let end = samples.partition_point(|sample| sample.stamp_ns < to_ns);
    let mut between = Vec::with_capacity(end.saturating_sub(first) + 2);
    between.extend(sample_at(samples, from_ns));
    if to_ns > from_ns {
        between.extend_from_slice(samples.get(first..end).unwrap_or_default());
        between.extend(sample_at(samples, to_ns));
    }
    between
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

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(stamp_ms: i64, value: f64, unmeasured_s: f64) -> ImuSample {
        ImuSample {
            stamp_ns: stamp_ms * 1_000_000,
            angular_velocity_rad_per_s: Vector3::repeat(value),
            specific_force_m_per_s2: Vector3::repeat(2.0 * value),
            unmeasured_s,
        }
    }

    #[test]
    fn a_sample_that_is_interpolated_in_a_gap_says_its_length() {
        let at = |from: &ImuSample, to: &ImuSample, stamp_ms: i64| from.interpolated(to, stamp_ms * 1_000_000);
        let (before, after) = (sample(0, 1.0, 0.0), sample(500, 2.0, 0.0));
        assert_eq!(at(&before, &after, 250), sample(250, 1.5, 0.5));
        assert_eq!(at(&before, &after, 0), before);
        assert_eq!(at(&before, &after, 500), after);
        let near = sample(5, 2.0, 0.0);
        assert_eq!(at(&before, &near, 1).unmeasured_s, 0.0);
        // Between a sample that was interpolated in a gap and the first one after it.
        let last = at(&before, &after, 480);
        assert_eq!(at(&last, &after, 490).unmeasured_s, 0.5);
        assert_eq!(at(&after, &after, 500), after);
    }
}
