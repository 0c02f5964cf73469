//! Unknowns of one frame: navigation state and joint angles, with the measured rates for extrapolation.

use std::sync::Arc;

use nalgebra::{DVector, Vector3};

use super::layout::{POSE, VELOCITY_BIAS};
use super::navigation::{NavigationState, Vector15};
use crate::geometry::{so3, wrap_angle};
use crate::sensors::{ImuSample, JointAngles};

/// The unknowns of one frame (Eq. 7).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FrameState {
    /// Pose, velocity, biases.
    pub(crate) navigation: NavigationState,
    /// Joint angles without the static offsets, in radians.
    pub(crate) joints_rad: Vec<f64>,
    /// Measured rates of attitude and joints.
    pub(crate) rates: Arc<Rates>,
}

/// Measured rates at a frame's stamp, for the time offset of a camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Rates {
    /// Angular velocity of the gyroscope, in rad/s.
    pub(crate) gyroscope_rad_per_s: Vector3<f64>,
    /// Joint rates of the encoders, in rad/s; empty without readings.
    pub(crate) joints_rad_per_s: Vec<f64>,
}

impl Rates {
    /// Rates at the last of these samples, whose stamp is the frame's.
    pub(crate) fn at(imu: &[ImuSample], encoder: Option<&JointAngles>) -> Arc<Self> {
        let gyroscope_rad_per_s = imu.last().map_or_else(Vector3::zeros, |sample| sample.angular_velocity_rad_per_s);
        let finite = gyroscope_rad_per_s.iter().all(|rate| rate.is_finite());
        let joints = encoder.map_or_else(Vec::new, |encoder| encoder.rates_rad_per_s.clone());
        Arc::new(Self {
            gyroscope_rad_per_s: if finite { gyroscope_rad_per_s } else { Vector3::zeros() },
            joints_rad_per_s: if joints.iter().all(|rate| rate.is_finite()) { joints } else { Vec::new() },
        })
    }

    /// Rate of one joint, in rad/s; zero without a measurement.
    pub(crate) fn joint_rad_per_s(&self, joint: usize) -> f64 {
        self.joints_rad_per_s.get(joint).copied().unwrap_or(0.0)
    }
}

impl FrameState {
    /// Extrapolates the state over a time, at constant rates.
    pub(crate) fn later(&self, seconds: f64) -> Self {
        let mut later = self.clone();
        let rotation_vector = self.body_rate_rad_per_s() * seconds;
        let pose = &mut later.navigation.world_from_imu;
        pose.rotation *= so3::exp(&rotation_vector);
        pose.translation_m += self.navigation.velocity_m_per_s * seconds;
        for (joint, angle) in later.joints_rad.iter_mut().enumerate() {
            *angle += self.rates.joint_rad_per_s(joint) * seconds;
        }
        later
    }

    /// Time derivative of pose and joints, in the order of [`Layout::camera`].
    pub(crate) fn motion(&self) -> DVector<f64> {
        let joints = (0..self.joints_rad.len()).map(|joint| self.rates.joint_rad_per_s(joint));
        let (angular_velocity, velocity) = (self.body_rate_rad_per_s(), self.navigation.velocity_m_per_s);
        let all: Vec<f64> = angular_velocity.iter().chain(velocity.iter()).copied().chain(joints).collect();
        DVector::from_vec(all)
    }

    fn body_rate_rad_per_s(&self) -> Vector3<f64> {
        self.rates.gyroscope_rad_per_s - self.navigation.bias.gyroscope_rad_per_s
    }

    /// `x ⊞ δ` with `δ` in the order of [`Layout`]: pose, joints, velocity and biases.
    pub(crate) fn plus(&self, delta: &[f64]) -> Self {
        let joints = self.joints_rad.len();
        let mut navigation = Vector15::zeros();
        navigation.as_mut_slice()[..POSE].copy_from_slice(&delta[..POSE]);
        navigation.as_mut_slice()[POSE..].copy_from_slice(&delta[POSE + joints..POSE + joints + VELOCITY_BIAS]);
        Self {
            navigation: self.navigation.plus(&navigation),
            joints_rad: self.joints_rad.iter().zip(&delta[POSE..]).map(|(angle, step)| angle + step).collect(),
            rates: Arc::clone(&self.rates),
        }
    }

    /// `self ⊟ origin` in the order of [`Layout`].
    pub(crate) fn minus(&self, origin: &Self) -> DVector<f64> {
        let joints = self.joints_rad.len();
        let navigation = self.navigation.minus(&origin.navigation);
        let mut delta = DVector::zeros(POSE + joints + VELOCITY_BIAS);
        delta.rows_mut(0, POSE).copy_from(&navigation.fixed_rows::<POSE>(0));
        delta.rows_mut(POSE + joints, VELOCITY_BIAS).copy_from(&navigation.fixed_rows::<VELOCITY_BIAS>(POSE));
        for (joint, (angle, start)) in self.joints_rad.iter().zip(&origin.joints_rad).enumerate() {
            delta[POSE + joint] = angle - start;
        }
        delta
    }

    /// Largest rotation of vehicle or joints from another state, in radians.
    pub(crate) fn rotation_from_rad(&self, other: &Self) -> f64 {
        let vehicle = self.navigation.world_from_imu.rotation.angle_to(&other.navigation.world_from_imu.rotation);
        let joints = self.joints_rad.iter().zip(&other.joints_rad);
        joints.map(|(angle, start)| wrap_angle(angle - start).abs()).fold(vehicle, f64::max)
    }

    /// Applies a step of the solver: frames in the prior count their step from its linearization point, so that the
    /// prior stays exactly linear.
    pub(crate) fn stepped(&self, first_estimate: Option<&Self>, delta: &[f64]) -> Self {
        let Some(first) = first_estimate else { return self.plus(delta) };
        let mut sum = self.minus(first);
        for (entry, step) in sum.iter_mut().zip(delta) {
            *entry += step;
        }
        first.plus(sum.as_slice())
    }
}
