//! Motion of the vehicle near a stamp, while the rows of a rolling shutter or images of other cameras are exposed.

use nalgebra::{UnitQuaternion, Vector3};

use super::navigation::ImuBias;
use super::preintegration::Preintegration;
use crate::geometry::{seconds_from_ns, so3};
use crate::sensors::{ImuNoise, ImuSample};

/// Time before the first image of a frame that a profile covers, in seconds: time offsets change during the estimation.
const MARGIN_S: f64 = 0.01;

/// Motion of the IMU near a stamp, integrated from its samples without gravity and initial velocity.
///
/// It depends only on the samples, not on the state at the stamp, which adds pose, velocity and gyroscope bias.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MotionProfile {
    /// Biases used in the integration.
    pub(crate) bias: ImuBias,
    /// Gravity in the world, in m/s².
    pub(crate) gravity_in_world: Vector3<f64>,
    /// Motion at the stamp and at samples before and after it, in ascending order; the knot at time zero has no motion.
    pub(crate) knots: Vec<ProfileKnot>,
}

/// Motion from the stamp to one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ProfileKnot {
    /// Time since the stamp, in seconds; negative before it.
    pub(crate) time_s: f64,
    /// Rotation from the IMU at that time to the IMU at the stamp.
    pub(crate) rotation: UnitQuaternion<f64>,
    /// Integral of the specific force in the IMU frame at the stamp, in m/s.
    pub(crate) velocity_m_per_s: Vector3<f64>,
    /// Integral of `velocity_m_per_s`, in metres.
    pub(crate) position_m: Vector3<f64>,
    /// Measured angular velocity at that time, bias included, in rad/s.
    pub(crate) rate_rad_per_s: Vector3<f64>,
    /// Specific force at that time without bias, in the IMU frame at that time, in m/s².
    pub(crate) force_m_per_s2: Vector3<f64>,
}

/// Motion from the stamp to another time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RowMotion {
    /// Rotation from the IMU at that time to the IMU at the stamp, at the given gyroscope bias.
    pub(crate) rotation: UnitQuaternion<f64>,
    /// Velocity at that time, as in [`ProfileKnot::velocity_m_per_s`].
    pub(crate) velocity_m_per_s: Vector3<f64>,
    /// Position at that time, as in [`ProfileKnot::position_m`].
    pub(crate) position_m: Vector3<f64>,
    /// Angular velocity at that time without bias, in rad/s.
    pub(crate) rate_rad_per_s: Vector3<f64>,
}

impl MotionProfile {
    /// Integrates samples from the stamp on, the first of them at the stamp; skips samples that are not finite or not
    /// later than the previous one. `None` without a sample at the stamp.
    pub(crate) fn new(samples: &[ImuSample], bias: ImuBias, gravity_in_world: Vector3<f64>) -> Option<Self> {
        let first = samples.first()?;
        // The measured motion over the rows of an image is treated as exact.
        let mut motion = Preintegration::new(ImuNoise::ZERO, bias);
        let mut knots = Vec::with_capacity(samples.len());
        for sample in samples {
            let before = motion.samples().len();
            motion.extend(std::slice::from_ref(sample));
            if motion.samples().len() == before {
                continue;
            }
            let increment = motion.increment();
            knots.push(ProfileKnot {
                time_s: seconds_from_ns(sample.stamp_ns - first.stamp_ns),
                rotation: increment.rotation,
                velocity_m_per_s: increment.velocity_m_per_s,
                position_m: increment.position_m,
                rate_rad_per_s: sample.angular_velocity_rad_per_s,
                force_m_per_s2: sample.specific_force_m_per_s2 - bias.accelerometer_m_per_s2,
            });
        }
        (!knots.is_empty()).then_some(Self { bias, gravity_in_world, knots })
    }

    /// This profile with the motion from a time before the stamp on, in seconds after it, by samples of which the last one is
    /// at the stamp.
    ///
    /// In reversed time the angular velocity changes its sign and the specific force does not: the integral over the
    /// reversed samples has the rotations and positions of the motion, and its negative velocities.
    pub(crate) fn with_motion_before(mut self, samples: &[ImuSample], earliest_s: f64) -> Self {
        let Some((last, earlier)) = samples.split_last().filter(|_| earliest_s < 0.0) else { return self };
        let reversed = |sample: &ImuSample| ImuSample {
            stamp_ns: last.stamp_ns - sample.stamp_ns,
            angular_velocity_rad_per_s: -sample.angular_velocity_rad_per_s,
            specific_force_m_per_s2: sample.specific_force_m_per_s2,
            unmeasured_s: sample.unmeasured_s,
        };
        let bias = ImuBias { gyroscope_rad_per_s: -self.bias.gyroscope_rad_per_s, ..self.bias };
        let mut motion = Preintegration::new(ImuNoise::ZERO, bias);
        motion.extend(&[reversed(last)]);
        for sample in earlier.iter().rev() {
            let before = motion.samples().len();
            motion.extend(&[reversed(sample)]);
            if motion.samples().len() == before {
                continue;
            }
            let increment = motion.increment();
            let time_s = seconds_from_ns(sample.stamp_ns - last.stamp_ns);
            self.knots.push(ProfileKnot {
                time_s,
                rotation: increment.rotation,
                velocity_m_per_s: -increment.velocity_m_per_s,
                position_m: increment.position_m,
                rate_rad_per_s: sample.angular_velocity_rad_per_s,
                force_m_per_s2: sample.specific_force_m_per_s2 - self.bias.accelerometer_m_per_s2,
            });
            if time_s < earliest_s - MARGIN_S {
                break;
            }
        }
        self.knots.sort_by(|one, other| one.time_s.total_cmp(&other.time_s));
        self
    }

    /// Profile of a stationary vehicle, without samples.
    pub(crate) fn stationary(bias: ImuBias, gravity_in_world: Vector3<f64>) -> Self {
        let knot = ProfileKnot {
            time_s: 0.0,
            rotation: UnitQuaternion::identity(),
            velocity_m_per_s: Vector3::zeros(),
            position_m: Vector3::zeros(),
            rate_rad_per_s: bias.gyroscope_rad_per_s,
            force_m_per_s2: -gravity_in_world,
        };
        Self { bias, gravity_in_world, knots: vec![knot] }
    }

    /// Motion over `time_s` from the stamp, at a gyroscope bias: from the knot k before that time, τ seconds earlier,
    ///
    /// ```text
    /// ΔR = ΔR_k Exp(φ) Exp(−δb_g t)    Δv = Δv_k + a τ    Δp = Δp_k + Δv_k τ + ½ a τ²
    /// ```
    ///
    /// Between samples the rotation is interpolated at a constant rate, the position with constant specific force;
    /// outside the samples, rate and specific force of the nearest one apply. A change of the gyroscope bias corrects
    /// the rotation to first order; velocity and position neglect it.
    pub(crate) fn at(&self, time_s: f64, gyroscope_bias_rad_per_s: &Vector3<f64>) -> RowMotion {
        let next = self.knots.iter().position(|knot| knot.time_s > time_s).unwrap_or(self.knots.len());
        let before = self.knots[next.saturating_sub(1)];
        let elapsed_s = time_s - before.time_s;
        let (rotation_vector, force, rate_rad_per_s) = if let Some(next) = self.knots.get(next).filter(|_| next > 0) {
            let interval_s = next.time_s - before.time_s;
            let fraction = elapsed_s / interval_s;
            (
                so3::log(&(before.rotation.inverse() * next.rotation)) * fraction,
                (next.velocity_m_per_s - before.velocity_m_per_s) / interval_s,
                before.rate_rad_per_s + (next.rate_rad_per_s - before.rate_rad_per_s) * fraction,
            )
        } else {
            let rate = before.rate_rad_per_s - self.bias.gyroscope_rad_per_s;
            (rate * elapsed_s, before.rotation * before.force_m_per_s2, before.rate_rad_per_s)
        };
        let change = gyroscope_bias_rad_per_s - self.bias.gyroscope_rad_per_s;
        RowMotion {
            rotation: before.rotation * so3::exp(&rotation_vector) * so3::exp(&(change * -time_s)),
            velocity_m_per_s: before.velocity_m_per_s + force * elapsed_s,
            position_m: before.position_m + before.velocity_m_per_s * elapsed_s + force * (0.5 * elapsed_s * elapsed_s),
            rate_rad_per_s: rate_rad_per_s - gyroscope_bias_rad_per_s,
        }
    }

    pub(crate) fn heap_bytes(&self) -> usize {
        self.knots.capacity() * size_of::<ProfileKnot>()
    }
}
