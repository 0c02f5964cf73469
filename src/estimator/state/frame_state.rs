//! Unknowns of one frame: navigation state and joint angles, with the measured rates for extrapolation.

use std::sync::Arc;

use nalgebra::{DVector, Vector3};

use super::allocation::allocated_bytes;
use super::calibrations::MAIN;
use super::layout::{POSE, VELOCITY_BIAS};
use super::motion_profile::{MotionProfile, RowMotion};
use super::navigation::GimbalImuState;
use super::navigation::{NavigationState, Vector15};
use crate::geometry::{so3, wrap_angle};
use crate::sensors::{ImuSample, JointAngles};

/// Unknowns of one frame (Eq. 7).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FrameState {
    pub(crate) navigation: NavigationState,
    /// Joint angles without the static offsets, in radians, at the stamp of the main camera's image (at the frame's stamp
    /// without one).
    pub(crate) joints_rad: Vec<f64>,
    /// Joint rates in rad/s, then joint accelerations in rad/s²; empty unless rows of the image depend on them.
    pub(crate) joint_motion: Vec<f64>,
    /// Velocity and biases of the IMU on the gimbal, `None` without one.
    pub(crate) gimbal_imu: Option<GimbalImuState>,
    /// Measured rates of attitude and joints.
    pub(crate) rates: Arc<Rates>,
}

/// Measured rates at a frame's stamp, for the time offset of a camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Rates {
    /// Angular velocity measured by the gyroscope, bias included, in rad/s.
    pub(crate) gyroscope_rad_per_s: Vector3<f64>,
    /// Joint rates measured by the encoders, in rad/s; empty without readings.
    pub(crate) joints_rad_per_s: Vec<f64>,
    /// Motion of the vehicle near the stamp, `None` unless images depend on it.
    pub(crate) profile: Option<MotionProfile>,
    /// Times of the images after the stamp in seconds, by camera; empty if all are at the stamp.
    pub(crate) image_times_s: Vec<f64>,
}

/// Time of an exposure, in seconds after the times to which the unknowns of a frame refer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Exposure {
    /// After the stamp, to which pose and velocity of the vehicle refer.
    pub(crate) after_stamp_s: f64,
    /// After the stamp of the main camera's image, to which the joint angles refer.
    pub(crate) after_joints_s: f64,
}

impl Exposure {
    /// At the times of the unknowns.
    pub(crate) const NONE: Self = Self { after_stamp_s: 0.0, after_joints_s: 0.0 };
}

impl Rates {
    /// Rates at the last of `imu`, which has the stamp of the frame; the times of the images are by camera.
    pub(crate) fn at(
        imu: &[ImuSample],
        encoder: Option<&JointAngles>,
        profile: Option<MotionProfile>,
        image_times_s: &[f64],
    ) -> Arc<Self> {
        let gyroscope_rad_per_s = imu.last().map_or_else(Vector3::zeros, |sample| sample.angular_velocity_rad_per_s);
        let finite = gyroscope_rad_per_s.iter().all(|rate| rate.is_finite());
        let joints = encoder.map_or_else(Vec::new, |encoder| encoder.rates_rad_per_s.clone());
        Arc::new(Self {
            gyroscope_rad_per_s: if finite { gyroscope_rad_per_s } else { Vector3::zeros() },
            joints_rad_per_s: if joints.iter().all(|rate| rate.is_finite()) { joints } else { Vec::new() },
            profile,
            image_times_s: image_times_s.to_vec(),
        })
    }

    /// Exposure of a camera, `seconds` after the stamp of its image.
    pub(crate) fn exposure(&self, camera: usize, seconds: f64) -> Exposure {
        let image_s = |camera: usize| self.image_times_s.get(camera).copied().unwrap_or(0.0);
        let after_stamp_s = image_s(camera) + seconds;
        Exposure { after_stamp_s, after_joints_s: if camera == MAIN { seconds } else { after_stamp_s - image_s(MAIN) } }
    }

    /// Memory use in bytes, heap included.
    pub(crate) fn bytes(&self) -> usize {
        allocated_bytes(size_of::<Self>())
            + allocated_bytes(self.joints_rad_per_s.capacity() * size_of::<f64>())
            + self.profile.as_ref().map_or(0, MotionProfile::heap_bytes)
            + allocated_bytes(self.image_times_s.capacity() * size_of::<f64>())
    }

    /// Rate of one joint, in rad/s; zero without a measurement.
    pub(crate) fn joint_rad_per_s(&self, joint: usize) -> f64 {
        self.joints_rad_per_s.get(joint).copied().unwrap_or(0.0)
    }
}

impl FrameState {
    /// State at an exposure: along the measured motion if there is one, else at constant rates.
    pub(crate) fn at(&self, exposure: &Exposure) -> Self {
        let Exposure { after_stamp_s: seconds, after_joints_s } = *exposure;
        let mut later = self.clone();
        let pose = &mut later.navigation.world_from_imu;
        if let Some((motion, gravity)) = self.row_motion(seconds) {
            let attitude = self.navigation.world_from_imu.rotation;
            pose.rotation *= motion.rotation;
            pose.translation_m += self.navigation.velocity_m_per_s * seconds
                + gravity * (0.5 * seconds * seconds)
                + attitude * motion.position_m;
            later.navigation.velocity_m_per_s += gravity * seconds + attitude * motion.velocity_m_per_s;
        } else {
            pose.rotation *= so3::exp(&(self.body_rate_rad_per_s() * seconds));
            pose.translation_m += self.navigation.velocity_m_per_s * seconds;
        }
        for (joint, angle) in later.joints_rad.iter_mut().enumerate() {
            *angle += self.joint_rate_rad_per_s(joint) * after_joints_s;
            if let Some(acceleration) = self.joint_acceleration_rad_per_s2(joint) {
                *angle += acceleration * (0.5 * after_joints_s * after_joints_s);
            }
        }
        later
    }

    /// Measured motion of the vehicle over a time since the stamp, and gravity in the world; `None` if it is not
    /// recorded.
    pub(crate) fn row_motion(&self, seconds: f64) -> Option<(RowMotion, Vector3<f64>)> {
        let profile = self.rates.profile.as_ref()?;
        Some((profile.at(seconds, &self.navigation.bias.gyroscope_rad_per_s), profile.gravity_in_world))
    }

    /// True if camera poses at other times than the stamp have derivatives by all unknowns on which they depend.
    pub(crate) fn has_moving_rows(&self) -> bool {
        self.rates.profile.is_some()
    }

    /// Rate of one joint, in rad/s: the estimated one, else the measured one, else zero.
    pub(crate) fn joint_rate_rad_per_s(&self, joint: usize) -> f64 {
        let estimated = self.joint_motion.get(joint).copied();
        estimated.unwrap_or_else(|| self.rates.joint_rad_per_s(joint))
    }

    fn joint_acceleration_rad_per_s2(&self, joint: usize) -> Option<f64> {
        self.joint_motion.get(self.joints_rad.len() + joint).copied()
    }

    /// Time derivative of pose and joints of [`Self::at`]: `[angular velocity; velocity; joint rates]`.
    pub(crate) fn motion_at(&self, exposure: &Exposure) -> DVector<f64> {
        let Exposure { after_stamp_s: seconds, after_joints_s } = *exposure;
        let joints = (0..self.joints_rad.len()).map(|joint| {
            let acceleration = self.joint_acceleration_rad_per_s2(joint).unwrap_or(0.0);
            self.joint_rate_rad_per_s(joint) + acceleration * after_joints_s
        });
        let (angular_velocity, velocity) = match self.row_motion(seconds) {
            Some((motion, gravity)) => (
                motion.rate_rad_per_s,
                self.navigation.velocity_m_per_s
                    + gravity * seconds
                    + self.navigation.world_from_imu.rotation * motion.velocity_m_per_s,
            ),
            None => (self.body_rate_rad_per_s(), self.navigation.velocity_m_per_s),
        };
        let all: Vec<f64> = angular_velocity.iter().chain(velocity.iter()).copied().chain(joints).collect();
        DVector::from_vec(all)
    }

    /// Motion at the times of the unknowns, as [`Self::motion_at`] returns it.
    pub(crate) fn motion(&self) -> DVector<f64> {
        self.motion_at(&Exposure::NONE)
    }

    /// Bytes on the heap, without the rates, which the states of a frame share.
    pub(crate) fn heap_bytes(&self) -> usize {
        let of_vec = |numbers: &Vec<f64>| allocated_bytes(numbers.capacity() * size_of::<f64>());
        of_vec(&self.joints_rad) + of_vec(&self.joint_motion)
    }

    fn body_rate_rad_per_s(&self) -> Vector3<f64> {
        self.rates.gyroscope_rad_per_s - self.navigation.bias.gyroscope_rad_per_s
    }

    /// `x ⊞ δ` with `δ` in the order of [`Layout`](super::layout::Layout): pose, joints, velocity and biases, then
    /// velocity and biases of the IMU on the gimbal.
    pub(crate) fn plus(&self, delta: &[f64]) -> Self {
        let block = self.joint_block();
        let mut navigation = Vector15::zeros();
        navigation.as_mut_slice()[..POSE].copy_from_slice(&delta[..POSE]);
        navigation.as_mut_slice()[POSE..].copy_from_slice(&delta[POSE + block..POSE + block + VELOCITY_BIAS]);
        let moved =
            |values: &[f64], steps: &[f64]| values.iter().zip(steps).map(|(value, step)| value + step).collect();
        Self {
            navigation: self.navigation.plus(&navigation),
            joints_rad: moved(&self.joints_rad, &delta[POSE..]),
            joint_motion: moved(&self.joint_motion, &delta[POSE + self.joints_rad.len()..]),
            gimbal_imu: self.gimbal_imu.map(|own| own.plus(&delta[POSE + block + VELOCITY_BIAS..])),
            rates: Arc::clone(&self.rates),
        }
    }

    /// `self ⊟ origin` in the order of [`Layout`](super::layout::Layout).
    pub(crate) fn minus(&self, origin: &Self) -> DVector<f64> {
        let (joints, block) = (self.joints_rad.len(), self.joint_block());
        let navigation = self.navigation.minus(&origin.navigation);
        let own = self.gimbal_imu.zip(origin.gimbal_imu).map(|(own, origin)| own.minus(&origin));
        let last = POSE + block + VELOCITY_BIAS;
        let mut delta = DVector::zeros(last + own.map_or(0, |own| own.len()));
        if let Some(own) = own {
            delta.rows_mut(last, own.len()).copy_from_slice(&own);
        }
        delta.rows_mut(0, POSE).copy_from(&navigation.fixed_rows::<POSE>(0));
        delta.rows_mut(POSE + block, VELOCITY_BIAS).copy_from(&navigation.fixed_rows::<VELOCITY_BIAS>(POSE));
        for (joint, (angle, start)) in self.joints_rad.iter().zip(&origin.joints_rad).enumerate() {
            delta[POSE + joint] = angle - start;
        }
        let rates = self.joint_motion.iter().zip(&origin.joint_motion);
        for (joint, (rate, start)) in rates.enumerate() {
            delta[POSE + joints + joint] = rate - start;
        }
        delta
    }

    /// Number of joint angles, rates and accelerations among the unknowns.
    pub(crate) fn joint_block(&self) -> usize {
        self.joints_rad.len() + self.joint_motion.len()
    }

    /// Rotation of the vehicle from another state, in radians.
    pub(crate) fn attitude_from_rad(&self, other: &Self) -> f64 {
        self.navigation.world_from_imu.rotation.angle_to(&other.navigation.world_from_imu.rotation)
    }

    /// Largest rotation of a joint from another state, in radians.
    pub(crate) fn joints_from_rad(&self, other: &Self) -> f64 {
        let joints = self.joints_rad.iter().zip(&other.joints_rad);
        joints.map(|(angle, start)| wrap_angle(angle - start).abs()).fold(0.0, f64::max)
    }

    /// This state with joint angles, rates and accelerations of another one.
    pub(crate) fn with_joints_of(&self, other: &Self) -> Self {
        let (joints_rad, joint_motion) = (other.joints_rad.clone(), other.joint_motion.clone());
        Self { joints_rad, joint_motion, ..self.clone() }
    }

    /// Applies a step of the solver. A frame in the prior adds the step in the tangent space of its linearization
    /// point, so that the prior stays exactly linear.
    pub(crate) fn stepped(&self, first_estimate: Option<&Self>, delta: &[f64]) -> Self {
        let Some(first) = first_estimate else { return self.plus(delta) };
        let mut sum = self.minus(first);
        for (entry, step) in sum.iter_mut().zip(delta) {
            *entry += step;
        }
        first.plus(sum.as_slice())
    }
}
