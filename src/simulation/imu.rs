//! The IMU: ground truth from the trajectory's derivatives, noise densities, bias random walks and turn-on biases.

use nalgebra::Vector3;

use super::random::RandomStream;
use super::trajectory::Trajectory;
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::sensors::{ImuIntrinsics, ImuNoise, ImuSample, samples_between};

/// Noise of the ADIS16448, the IMU of the paper, with the values of `RotorS`.
pub const FIREFLY_IMU: ImuNoise = ImuNoise {
    accelerometer_noise_density: 0.004,
    accelerometer_random_walk: 0.006,
    gyroscope_noise_density: 3.394e-4,
    gyroscope_random_walk: 3.879e-5,
};

/// Standard deviation of the accelerometer's turn-on bias per axis (`RotorS`), in m/s².
const ACCELEROMETER_TURN_ON_M_PER_S2: f64 = 0.196;
/// Standard deviation of the gyroscope's turn-on bias per axis (`RotorS`), in rad/s.
const GYROSCOPE_TURN_ON_RAD_PER_S: f64 = 0.0087;

/// Biases at one time, in the IMU frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulatedBias {
    /// Added to the true specific force.
    pub accelerometer_m_per_s2: Vector3<f64>,
    /// Added to the true angular velocity.
    pub gyroscope_rad_per_s: Vector3<f64>,
}

/// True angular velocity and specific force at one time, in the IMU frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ImuMotion {
    pub(super) angular_velocity_rad_per_s: Vector3<f64>,
    pub(super) specific_force_m_per_s2: Vector3<f64>,
}

/// All samples of a flight with their biases.
#[derive(Clone, Debug)]
pub struct ImuRecord {
    pub samples: Vec<ImuSample>,
    pub biases: Vec<SimulatedBias>,
}

impl ImuRecord {
    /// Simulates the samples of a flight; `noise_scale` 0 gives ideal samples without bias.
    pub fn measure(
        trajectory: &Trajectory,
        noise: &ImuNoise,
        rate_hz: f64,
        noise_scale: f64,
        random: &mut RandomStream,
    ) -> Self {
        let count = (trajectory.duration_s() * rate_hz).floor() as usize + 1;
        let times_s = (0..count).map(|index| index as f64 / rate_hz);
        let motion = |time_s: f64| {
            let ground_truth = trajectory.at(time_s);
            ImuMotion {
                angular_velocity_rad_per_s: ground_truth.angular_velocity_rad_per_s,
                specific_force_m_per_s2: ground_truth.specific_force_m_per_s2,
            }
        };
        Self::of_motion(times_s, motion, noise, rate_hz, noise_scale, random)
    }

    /// Simulates samples at these times of a motion; `noise_scale` 0 gives ideal samples without bias.
    pub(super) fn of_motion(
        times_s: impl ExactSizeIterator<Item = f64>,
        motion: impl Fn(f64) -> ImuMotion,
        noise: &ImuNoise,
        rate_hz: f64,
        noise_scale: f64,
        random: &mut RandomStream,
    ) -> Self {
        let count = times_s.len();
        let mut bias = SimulatedBias {
            accelerometer_m_per_s2: random.normal_vector(ACCELEROMETER_TURN_ON_M_PER_S2 * noise_scale),
            gyroscope_rad_per_s: random.normal_vector(GYROSCOPE_TURN_ON_RAD_PER_S * noise_scale),
        };
        let white = noise_scale * rate_hz.sqrt();
        let walk = noise_scale / rate_hz.sqrt();
        let mut record = Self { samples: Vec::with_capacity(count), biases: Vec::with_capacity(count) };
        for time_s in times_s {
            let ground_truth = motion(time_s);
            record.samples.push(ImuSample {
                stamp_ns: ns_from_seconds(time_s),
                angular_velocity_rad_per_s: ground_truth.angular_velocity_rad_per_s
                    + bias.gyroscope_rad_per_s
                    + random.normal_vector(noise.gyroscope_noise_density * white),
                specific_force_m_per_s2: ground_truth.specific_force_m_per_s2
                    + bias.accelerometer_m_per_s2
                    + random.normal_vector(noise.accelerometer_noise_density * white),
                unmeasured_s: 0.0,
            });
            record.biases.push(bias);
            bias.gyroscope_rad_per_s += random.normal_vector(noise.gyroscope_random_walk * walk);
            bias.accelerometer_m_per_s2 += random.normal_vector(noise.accelerometer_random_walk * walk);
        }
        record
    }

    /// Adds a first-order Gauss–Markov error of this stationary standard deviation (m/s²) and time constant to each
    /// axis of the accelerometer; the error is part of the bias.
    pub fn drift(&mut self, sigma_m_per_s2: f64, time_constant_s: f64, random: &mut RandomStream) {
        let mut error = random.normal_vector(sigma_m_per_s2);
        let mut before_ns = None;
        for (sample, bias) in self.samples.iter_mut().zip(&mut self.biases) {
            if let Some(before_ns) = before_ns.replace(sample.stamp_ns) {
                let kept = (-seconds_from_ns(sample.stamp_ns - before_ns) / time_constant_s).exp();
                error = error * kept + random.normal_vector(sigma_m_per_s2 * (1.0 - kept * kept).sqrt());
            }
            sample.specific_force_m_per_s2 += error;
            bias.accelerometer_m_per_s2 += error;
        }
    }

    /// Applies errors of scales and axes: `intrinsics` corrects the new samples to the previous ones.
    pub(crate) fn miscalibrate(&mut self, intrinsics: &ImuIntrinsics) {
        // A correction near the identity is invertible.
        let Some(measured) = ImuIntrinsics::default().left_after(intrinsics) else { return };
        for sample in &mut self.samples {
            *sample = measured.correct(sample);
        }
    }

    /// Samples from one stamp to another, both ends included and interpolated.
    pub(crate) fn between(&self, from_ns: i64, to_ns: i64) -> Vec<ImuSample> {
        samples_between(&self.samples, from_ns, to_ns)
    }

    pub(crate) fn bias_at(&self, stamp_ns: i64) -> SimulatedBias {
        let after = self.samples.partition_point(|sample| sample.stamp_ns <= stamp_ns);
        self.biases.get(after.saturating_sub(1)).copied().unwrap_or_default()
    }
}
