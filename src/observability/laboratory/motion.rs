//! Named motions of the vehicle and the joints, in closed form.

use std::f64::consts::TAU;

use nalgebra::{DVector, UnitQuaternion, Vector3};
use thiserror::Error;

use super::mechanism::Mechanism;
use crate::estimator::{ImuBias, NavigationState};
use crate::geometry::{RigidTransform, ns_from_seconds, so3};
use crate::sensors::ImuSample;
use crate::text::Named;

/// Motion of the vehicle, or constraint on the motion of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaboratoryMotion {
    Aggressive,
    TranslationOnly,
    Hover,
    ConstantVelocity,
    ConstantAcceleration,
    RollOnly,
    PitchOnly,
    YawOnly,
    YawPlanar,
    YawTilted,
    YawInPlace,
    RotationOnly,
    ConstantVelocityRotation,
    SteadyTurn,
    StraightLine,
    Stabilized,
    YawFollowing,
    StabilizedRotationOnly,
    StabilizedTranslationOnly,
    CameraStationary,
    OneJointFrozen,
    AllJointsFrozen,
}

/// Error: unknown name of a motion.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("unknown motion '{given}': expected one of {}", LaboratoryMotion::names())]
pub struct UnknownMotion {
    pub given: String,
}

impl Named for LaboratoryMotion {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Aggressive, "aggressive"),
        (Self::TranslationOnly, "translation-only"),
        (Self::Hover, "hover"),
        (Self::ConstantVelocity, "constant-velocity"),
        (Self::ConstantAcceleration, "constant-acceleration"),
        (Self::RollOnly, "roll-only"),
        (Self::PitchOnly, "pitch-only"),
        (Self::YawOnly, "yaw-only"),
        (Self::YawPlanar, "yaw-planar"),
        (Self::YawTilted, "yaw-tilted"),
        (Self::YawInPlace, "yaw-in-place"),
        (Self::RotationOnly, "rotation-only"),
        (Self::ConstantVelocityRotation, "constant-velocity-rotation"),
        (Self::SteadyTurn, "steady-turn"),
        (Self::StraightLine, "straight-line"),
        (Self::Stabilized, "stabilized"),
        (Self::YawFollowing, "yaw-following"),
        (Self::StabilizedRotationOnly, "stabilized-rotation-only"),
        (Self::StabilizedTranslationOnly, "stabilized-translation-only"),
        (Self::CameraStationary, "camera-held-still"),
        (Self::OneJointFrozen, "one-joint-frozen"),
        (Self::AllJointsFrozen, "all-joints-frozen"),
    ];
}

impl LaboratoryMotion {
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Aggressive => "the vehicle rotates and translates about all axes",
            Self::TranslationOnly => "the vehicle translates and never rotates",
            Self::Hover => "the vehicle neither translates nor rotates",
            Self::ConstantVelocity => "the vehicle moves at constant velocity without rotation",
            Self::ConstantAcceleration => "the vehicle moves at constant acceleration without rotation",
            Self::RollOnly => "the vehicle rotates about the IMU's x axis only and translates in space",
            Self::PitchOnly => "the vehicle rotates about the IMU's y axis only and translates in space",
            Self::YawOnly => "the level vehicle yaws and translates in space",
            Self::YawPlanar => "the level vehicle yaws and translates in the horizontal plane",
            Self::YawTilted => "the tilted vehicle rotates about the vertical only and translates",
            Self::YawInPlace => "the vehicle yaws without translating",
            Self::RotationOnly => "the vehicle rotates about all axes without translating",
            Self::ConstantVelocityRotation => "the vehicle rotates about all axes at constant velocity",
            Self::SteadyTurn => {
                "the tilted vehicle turns about the vertical and climbs, angular rate and velocity constant in the body"
            }
            Self::StraightLine => "the vehicle rotates and accelerates on a straight line",
            Self::Stabilized => "the camera never rotates in the world while vehicle and joints move",
            Self::YawFollowing => "the camera rotates about the vertical only while vehicle and joints move",
            Self::StabilizedRotationOnly => "the camera never rotates in the world, the vehicle does not translate",
            Self::StabilizedTranslationOnly => "neither camera, vehicle nor joints rotate in the world",
            Self::CameraStationary => {
                "the camera neither rotates nor translates in the world while vehicle and joints move"
            }
            Self::OneJointFrozen => {
                "vehicle and joints move about all axes, except the second (or only) joint, which is stationary"
            }
            Self::AllJointsFrozen => "the vehicle rotates and translates about all axes, all joints are stationary",
        }
    }

    /// True if the joint with this index is stationary in the motion.
    fn holds_joint(self, joint: usize, joints: usize) -> bool {
        match self {
            Self::StabilizedTranslationOnly | Self::AllJointsFrozen => true,
            Self::OneJointFrozen => joint == 1 || joints == 1,
            _ => false,
        }
    }
}

impl std::str::FromStr for LaboratoryMotion {
    type Err = UnknownMotion;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::from_name(name).ok_or_else(|| UnknownMotion { given: name.to_owned() })
    }
}

#[derive(Clone, Copy, Debug)]
struct Sine {
    size: f64,
    rate_rad_per_s: f64,
    phase_rad: f64,
}

impl Sine {
    /// Value (`derivative` 0) or derivative of this order with respect to time.
    fn at(&self, time_s: f64, derivative: i32) -> f64 {
        let quarter_periods = f64::from(derivative) * 0.25 * TAU;
        let phase = self.rate_rad_per_s * time_s + self.phase_rad + quarter_periods;
        self.size * self.rate_rad_per_s.powi(derivative) * phase.sin()
    }
}

const fn sine(size: f64, rate_rad_per_s: f64, phase_rad: f64) -> Sine {
    Sine { size, rate_rad_per_s, phase_rad }
}

/// Rotation vector of the vehicle, in radians.
const ROTATION: [Sine; 3] = [sine(0.2, 2.8, 0.4), sine(0.25, 2.0, 1.3), sine(0.3, 1.6, 0.2)];
/// Position of the vehicle, in metres.
const PATH: [Sine; 3] = [sine(1.2, 1.6, 0.0), sine(0.9, 2.4, 0.7), sine(0.7, 2.0, 1.9)];
/// Velocity of the vehicle in motions with constant velocity.
const VELOCITY_M_PER_S: Vector3<f64> = Vector3::new(0.9, 0.4, -0.3);
/// Acceleration of the vehicle in motions with constant acceleration.
const ACCELERATION_M_PER_S2: Vector3<f64> = Vector3::new(0.5, -0.35, 0.2);
/// Angular rate of a circle about the vertical.
const TURN_RATE_RAD_PER_S: f64 = 0.6;
/// Path of a circle that starts along x, with a constant climb.
const TURN: [Sine; 2] = [sine(1.5, TURN_RATE_RAD_PER_S, 0.0), sine(1.5, TURN_RATE_RAD_PER_S, -0.25 * TAU)];
/// Angles of the joints; further joints repeat them.
const JOINTS: [Sine; 5] =
    [sine(0.4, 2.0, 0.1), sine(0.4, 3.2, 1.0), sine(0.4, 2.4, 2.0), sine(0.4, 2.8, 0.6), sine(0.4, 1.8, 1.5)];
/// Step of the numerical derivatives of rotations and composed positions.
const STEP_S: f64 = 1e-3;
/// Largest amplitude of a joint as a fraction of the distance from its centre to the nearer limit.
const ROOM_RATIO: f64 = 0.9;

/// Pose, joint angles and their rates at one time of a motion.
#[derive(Clone, Debug)]
pub(super) struct MechanismState {
    pub(super) world_from_imu: RigidTransform,
    /// Velocity in the world frame.
    pub(super) velocity_m_per_s: Vector3<f64>,
    /// In the IMU frame.
    pub(super) angular_velocity_rad_per_s: Vector3<f64>,
    pub(super) joints_rad: Vec<f64>,
    pub(super) joint_rates_rad_per_s: Vec<f64>,
}

/// Step of [`derivative`] and [`second_derivative`]: their errors of order 6 stay below rounding errors.
const STENCIL_STEP_S: f64 = 2e-3;

/// Derivative of a smooth function of time, to about 1e-13.
fn derivative<T>(function: impl Fn(f64) -> T, time_s: f64) -> T
where
    T: std::ops::Sub<Output = T> + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let change = |steps: f64| function(time_s + steps * STENCIL_STEP_S) - function(time_s - steps * STENCIL_STEP_S);
    (change(1.0) * 45.0 + change(2.0) * -9.0 + change(3.0)) * (1.0 / (60.0 * STENCIL_STEP_S))
}

/// Second derivative of a smooth function of time, to about 1e-10.
fn second_derivative<T>(function: impl Fn(f64) -> T, time_s: f64) -> T
where
    T: std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let both = |steps: f64| function(time_s + steps * STENCIL_STEP_S) + function(time_s - steps * STENCIL_STEP_S);
    (both(1.0) * 270.0 + both(2.0) * -27.0 + both(3.0) * 2.0 + function(time_s) * -490.0)
        * (1.0 / (180.0 * STENCIL_STEP_S * STENCIL_STEP_S))
}

/// Angle of a joint about which it moves: zero, moved so that at least a quarter of the range lies on both sides.
pub(super) fn middle_angle_rad((low, high): (f64, f64)) -> f64 {
    let quarter = 0.25 * (high - low).max(0.0);
    0.0_f64.max(low + quarter).min(high - quarter)
}

/// A mechanism in motion, some of its joints fixed.
#[derive(Clone, Debug)]
pub(super) struct MechanismMotion<'a> {
    pub(super) mechanism: &'a Mechanism,
    pub(super) motion: LaboratoryMotion,
    /// Fixed joints, in order.
    pub(super) frozen: &'a [usize],
    pub(super) gravity_in_world: Vector3<f64>,
}

impl MechanismMotion<'_> {
    pub(super) fn joints_rad(&self, time_s: f64) -> Vec<f64> {
        let joints = self.mechanism.chain.joint_count();
        (0..joints)
            .map(|joint| {
                let (low, high) = self.mechanism.joints.get(joint).map_or((-TAU, TAU), |joint| joint.limits_rad);
                let center = middle_angle_rad((low, high));
                if self.frozen.contains(&joint) || self.motion.holds_joint(joint, joints) {
                    return center;
                }
                let wave = JOINTS[joint % JOINTS.len()];
                let room = ROOM_RATIO * (high - center).min(center - low);
                center + wave.at(time_s, 0) * (room / wave.size).min(1.0)
            })
            .collect()
    }

    fn path_m(&self, time_s: f64, derivative: i32) -> Vector3<f64> {
        let wave = Vector3::from_fn(|axis, _| PATH[axis].at(time_s, derivative));
        let steady = match derivative {
            0 => VELOCITY_M_PER_S * time_s,
            1 => VELOCITY_M_PER_S,
            _ => Vector3::zeros(),
        };
        match self.motion {
            LaboratoryMotion::Hover
            | LaboratoryMotion::YawInPlace
            | LaboratoryMotion::RotationOnly
            | LaboratoryMotion::StabilizedRotationOnly => Vector3::zeros(),
            LaboratoryMotion::ConstantVelocity | LaboratoryMotion::ConstantVelocityRotation => steady,
            LaboratoryMotion::ConstantAcceleration => {
                let power = [0.5 * time_s * time_s, time_s, 1.0];
                steady + ACCELERATION_M_PER_S2 * power.get(derivative as usize).copied().unwrap_or(0.0)
            }
            LaboratoryMotion::SteadyTurn => {
                Vector3::new(TURN[0].at(time_s, derivative), TURN[1].at(time_s, derivative), steady.z)
            }
            LaboratoryMotion::StraightLine => VELOCITY_M_PER_S.normalize() * wave.x,
            LaboratoryMotion::YawPlanar => Vector3::new(wave.x, wave.y, 0.0),
            _ => wave,
        }
    }

    fn rotation(&self, time_s: f64) -> UnitQuaternion<f64> {
        let rotation_vector = |time_s: f64| Vector3::from_fn(|axis, _| ROTATION[axis].at(time_s, 0));
        let yaw = || so3::exp(&(Vector3::z() * (2.0 * ROTATION[2].at(time_s, 0))));
        let imu_from_camera = |time_s: f64| self.mechanism.chain.imu_from_camera(&self.joints_rad(time_s)).rotation;
        let start = || so3::exp(&rotation_vector(0.0)) * imu_from_camera(0.0);
        match self.motion {
            LaboratoryMotion::TranslationOnly
            | LaboratoryMotion::Hover
            | LaboratoryMotion::ConstantVelocity
            | LaboratoryMotion::ConstantAcceleration
            | LaboratoryMotion::StabilizedTranslationOnly => so3::exp(&rotation_vector(0.0)),
            LaboratoryMotion::RollOnly => so3::exp(&(Vector3::x() * (2.0 * ROTATION[0].at(time_s, 0)))),
            LaboratoryMotion::PitchOnly => so3::exp(&(Vector3::y() * (2.0 * ROTATION[1].at(time_s, 0)))),
            LaboratoryMotion::SteadyTurn => {
                so3::exp(&(Vector3::z() * (TURN_RATE_RAD_PER_S * time_s))) * so3::exp(&rotation_vector(0.0))
            }
            LaboratoryMotion::YawOnly | LaboratoryMotion::YawPlanar | LaboratoryMotion::YawInPlace => yaw(),
            LaboratoryMotion::YawTilted => yaw() * so3::exp(&rotation_vector(0.0)),
            LaboratoryMotion::Stabilized
            | LaboratoryMotion::StabilizedRotationOnly
            | LaboratoryMotion::CameraStationary => start() * imu_from_camera(time_s).inverse(),
            LaboratoryMotion::YawFollowing => yaw() * start() * imu_from_camera(time_s).inverse(),
            LaboratoryMotion::Aggressive
            | LaboratoryMotion::OneJointFrozen
            | LaboratoryMotion::AllJointsFrozen
            | LaboratoryMotion::RotationOnly
            | LaboratoryMotion::ConstantVelocityRotation
            | LaboratoryMotion::StraightLine => so3::exp(&rotation_vector(time_s)),
        }
    }

    pub(super) fn world_from_imu(&self, time_s: f64) -> RigidTransform {
        let rotation = self.rotation(time_s);
        let position_m = if self.motion == LaboratoryMotion::CameraStationary {
            -(rotation * self.mechanism.chain.imu_from_camera(&self.joints_rad(time_s)).translation_m)
        } else {
            self.path_m(time_s, 0)
        };
        RigidTransform::new(rotation, position_m)
    }

    /// Pose and velocity at a time; the biases are zero.
    pub(super) fn navigation(&self, time_s: f64) -> NavigationState {
        NavigationState {
            world_from_imu: self.world_from_imu(time_s),
            velocity_m_per_s: self.derivative_m(time_s, 1),
            bias: ImuBias::default(),
        }
    }

    /// Pose, velocity, angular rate and joints at a time.
    pub(super) fn kinematics(&self, time_s: f64) -> MechanismState {
        let world_from_imu = self.world_from_imu(time_s);
        let (joints_rad, joint_rates_rad_per_s) = self.joint_motion(time_s);
        MechanismState {
            velocity_m_per_s: if self.motion == LaboratoryMotion::CameraStationary {
                derivative(|time_s| self.world_from_imu(time_s).translation_m, time_s)
            } else {
                self.path_m(time_s, 1)
            },
            angular_velocity_rad_per_s: self.angular_velocity(time_s, &world_from_imu.rotation),
            world_from_imu,
            joints_rad,
            joint_rates_rad_per_s,
        }
    }

    /// Joint angles and their rates, in radians and rad/s.
    pub(super) fn joint_motion(&self, time_s: f64) -> (Vec<f64>, Vec<f64>) {
        let rates = derivative(|time_s| DVector::from_vec(self.joints_rad(time_s)), time_s);
        (self.joints_rad(time_s), rates.as_slice().to_vec())
    }

    /// Angular rate in rad/s and specific force in m/s² in the IMU frame, to about 1e-13 and, where the path depends on
    /// the joints, 1e-10.
    pub(super) fn rate_and_force(&self, time_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let rotation = self.rotation(time_s);
        let acceleration = if self.motion == LaboratoryMotion::CameraStationary {
            second_derivative(|time_s| self.world_from_imu(time_s).translation_m, time_s)
        } else {
            self.path_m(time_s, 2)
        };
        let force = rotation.inverse() * (acceleration - self.gravity_in_world);
        (self.angular_velocity(time_s, &rotation), force)
    }

    fn angular_velocity(&self, time_s: f64, rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
        derivative(|time_s| so3::log(&(rotation.inverse() * self.rotation(time_s))), time_s)
    }

    /// First or second derivative of the position: exact, except for a path that depends on the joints.
    fn derivative_m(&self, time_s: f64, derivative: i32) -> Vector3<f64> {
        if self.motion != LaboratoryMotion::CameraStationary {
            return self.path_m(time_s, derivative);
        }
        let at = |steps: f64| self.world_from_imu(time_s + steps * STEP_S).translation_m;
        if derivative == 1 {
            (at(1.0) - at(-1.0)) / (2.0 * STEP_S)
        } else {
            (at(1.0) - at(0.0) * 2.0 + at(-1.0)) / (STEP_S * STEP_S)
        }
    }

    /// Measurement of an ideal IMU at a time.
    fn imu_sample(&self, time_s: f64) -> ImuSample {
        let rotation_change = self.rotation(time_s - STEP_S).inverse() * self.rotation(time_s + STEP_S);
        let felt = self.derivative_m(time_s, 2) - self.gravity_in_world;
        ImuSample {
            stamp_ns: ns_from_seconds(time_s),
            angular_velocity_rad_per_s: so3::log(&rotation_change) / (2.0 * STEP_S),
            specific_force_m_per_s2: self.rotation(time_s).inverse() * felt,
            unmeasured_s: 0.0,
        }
    }

    /// The samples of an interval, both ends included.
    pub(super) fn imu(&self, from_s: f64, to_s: f64, rate_hz: f64) -> Vec<ImuSample> {
        let count = ((to_s - from_s) * rate_hz).round().max(1.0) as usize;
        (0..=count).map(|index| self.imu_sample(from_s + (to_s - from_s) * index as f64 / count as f64)).collect()
    }

    fn world_from_camera(&self, time_s: f64) -> RigidTransform {
        self.world_from_imu(time_s) * self.mechanism.chain.imu_from_camera(&self.joints_rad(time_s))
    }

    /// Velocity of the camera in the world, to about 1e-13.
    pub(super) fn camera_velocity_m_per_s(&self, time_s: f64) -> Vector3<f64> {
        derivative(|time_s| self.world_from_camera(time_s).translation_m, time_s)
    }

    /// Samples of an ideal IMU at the centre of the camera with its axes over an interval, both ends included.
    pub(super) fn camera_imu(&self, from_s: f64, to_s: f64, rate_hz: f64) -> Vec<ImuSample> {
        let sample = |time_s: f64| {
            let rotation = self.world_from_camera(time_s).rotation;
            let since = |time_s: f64| so3::log(&(rotation.inverse() * self.world_from_camera(time_s).rotation));
            let acceleration = second_derivative(|time_s| self.world_from_camera(time_s).translation_m, time_s);
            ImuSample {
                stamp_ns: ns_from_seconds(time_s),
                angular_velocity_rad_per_s: derivative(since, time_s),
                specific_force_m_per_s2: rotation.inverse() * (acceleration - self.gravity_in_world),
                unmeasured_s: 0.0,
            }
        };
        let count = ((to_s - from_s) * rate_hz).round().max(1.0) as usize;
        (0..=count).map(|index| sample(from_s + (to_s - from_s) * index as f64 / count as f64)).collect()
    }
}
