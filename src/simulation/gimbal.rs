//! Gimbal: its chain, a stabilizing controller with lag, and the resulting joint angles.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::aim::Aim;
use super::exercise::Exercise;
use super::random::RandomStream;
use super::route::Wave;
use super::trajectory::{Kinematics, Trajectory};
use crate::geometry::{RigidTransform, during, so3};
use crate::gimbal::{ClassicalChain, DhLink};
use crate::sensors::{GimbalRig, Joint};

/// Joints of the paper's gimbal (§5.1): yaw ±180°, roll ±25°, pitch −120° to 30°.
pub fn joints() -> Vec<Joint> {
    let joint = |name: &str, low_deg: f64, high_deg: f64| Joint {
        name: name.to_owned(),
        limits_rad: (low_deg.to_radians(), high_deg.to_radians()),
    };
    vec![joint("yaw", -180.0, 180.0), joint("roll", -25.0, 25.0), joint("pitch", -120.0, 30.0)]
}

/// True chain: the nominal yaw–roll–pitch gimbal under the nose with random machining and mounting errors.
///
/// Nominal: base z down; yaw about it, roll about the forward axis, pitch about the right one; at angles zero the
/// optical frame is level and looks forward.
pub fn true_chain(random: &mut RandomStream) -> ClassicalChain {
    let mut angle = |nominal_deg: f64| (nominal_deg + 2.2 * random.normal().clamp(-2.0, 2.0)).to_radians();
    let quarter = 90.0;
    let offsets = [angle(-quarter), angle(quarter), angle(-quarter)];
    let twists = [angle(-quarter), angle(-quarter), angle(-quarter)];
    let tilt = Vector3::new(angle(0.0), angle(0.0), angle(0.0)) * 0.6;
    let tip = Vector3::new(angle(0.0), angle(0.0), angle(0.0)) * 0.5;
    let mut length = |nominal_m: f64| nominal_m + 0.004 * random.normal().clamp(-2.0, 2.0);
    let along = [length(0.042), length(-0.024), length(0.028)];
    let across = [length(0.012), length(0.031), length(0.014)];
    let mount = Vector3::new(length(0.095), length(0.004), length(-0.058));
    let lens = Vector3::new(length(0.026), length(-0.007), length(0.009));
    let downwards = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let optical = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let optical = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(optical));
    ClassicalChain {
        imu_from_base: RigidTransform::new(UnitQuaternion::from_rotation_matrix(&downwards) * so3::exp(&tilt), mount),
        links: (0..3)
            .map(|k| DhLink { theta_offset_rad: offsets[k], d_m: along[k], a_m: across[k], alpha_rad: twists[k] })
            .collect(),
        effector_from_camera: RigidTransform::new(optical * so3::exp(&tip), lens),
    }
}

/// Commanded orientation of the camera: level roll, varying pitch and heading.
#[derive(Clone, Debug)]
pub struct LookAround {
    /// Heading relative to the vehicle's (smoothed) heading, and its amplitude.
    pub yaw_rad: [f64; 2],
    /// Pitch, positive up, and its amplitude.
    pub(crate) pitch_rad: [f64; 2],
    /// Amplitude of the roll about level.
    pub(crate) roll_rad: f64,
    /// Start and duration of back-and-forth swings of the heading at the motors' largest rate.
    pub slew_s: Option<[f64; 2]>,
    /// Joint that is fixed at its angle, start and duration in seconds.
    pub fixed_joint: Option<(usize, [f64; 2])>,
    /// Start and duration of an interval in which the camera keeps its orientation in the world exactly.
    pub stabilized_s: Option<[f64; 2]>,
    /// Direction at which the camera points in place of the vehicle's heading.
    pub(crate) aim: Option<Aim>,
    waves: [Wave; 3],
}

impl LookAround {
    /// Periods of about 11, 9 and 7 seconds with random phases.
    pub(crate) fn new(yaw_deg: [f64; 2], pitch_deg: [f64; 2], roll_deg: f64, random: &mut RandomStream) -> Self {
        Self {
            yaw_rad: yaw_deg.map(f64::to_radians),
            pitch_rad: pitch_deg.map(f64::to_radians),
            roll_rad: roll_deg.to_radians(),
            slew_s: None,
            fixed_joint: None,
            stabilized_s: None,
            aim: None,
            waves: [Wave::new(random, 11.3), Wave::new(random, 9.1), Wave::new(random, 7.3)],
        }
    }

    /// Commands of a mirrored flight: the mean heading relative to the vehicle's changes its side.
    pub fn mirrored(mut self) -> Self {
        self.yaw_rad[0] = -self.yaw_rad[0];
        self
    }

    /// Points at what there is to see, up to 12° to each side of a target.
    pub fn aimed(mut self, aim: Aim) -> Self {
        if aim.target_m.is_some() {
            self.yaw_rad = [0.0, 12_f64.to_radians()];
        }
        Self { aim: Some(aim), ..self }
    }

    /// Heading that the camera follows at a time.
    fn heading_to_follow_rad(&self, vehicle: &Kinematics, time_s: f64) -> f64 {
        self.aim.map_or(vehicle.heading_rad, |aim| {
            let route_rad = vehicle.heading_rad - aim.swing_at(time_s);
            aim.direction_rad(&vehicle.world_from_imu.translation_m, route_rad)
        })
    }

    /// A triangle wave of 60° to each side at the motors' largest rate while the camera is slewed.
    fn slew_rad(&self, time_s: f64) -> f64 {
        let Some([start_s, length_s]) = self.slew_s else { return 0.0 };
        let since_s = time_s - start_s;
        if since_s < 0.0 || since_s >= length_s {
            return 0.0;
        }
        let amplitude = 60_f64.to_radians();
        let quarters = since_s * Stabilizer::default().rate_rad_per_s / amplitude;
        let place = (quarters + 1.0).rem_euclid(4.0);
        amplitude * if place < 2.0 { place - 1.0 } else { 3.0 - place }
    }

    /// Commanded orientation `world_from_camera` of the camera at a time.
    fn orientation(&self, followed_heading_rad: f64, time_s: f64) -> UnitQuaternion<f64> {
        let wave = self.yaw_rad[1] * self.waves[0].at(time_s);
        let yaw = followed_heading_rad + self.yaw_rad[0] + wave + self.slew_rad(time_s);
        let pitch = self.pitch_rad[0] + self.pitch_rad[1] * self.waves[1].at(time_s);
        let roll = self.roll_rad * self.waves[2].at(time_s);
        // Forward-left-up body with positive pitch up, then the optical axes.
        let level = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -pitch)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll);
        let optical = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        level * UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(optical))
    }
}

/// Gains and limits of the stabilizing controller.
#[derive(Clone, Copy, Debug)]
pub struct Stabilizer {
    /// Commanded rate per radian of orientation error, in 1/s: its inverse is the lag.
    pub(crate) gain_per_s: f64,
    /// Time constant of the joint motors.
    pub(crate) motor_s: f64,
    pub(crate) rate_rad_per_s: f64,
    /// Time constant with which the camera's heading follows the vehicle's.
    pub(crate) follow_s: f64,
}

impl Default for Stabilizer {
    fn default() -> Self {
        Self { gain_per_s: 9.0, motor_s: 0.03, rate_rad_per_s: 200_f64.to_radians(), follow_s: 0.5 }
    }
}

/// Step of the controller and of the stored motion, in seconds.
const CONTROL_STEP_S: f64 = 0.001;

/// True joint angles over a flight.
#[derive(Clone, Debug)]
pub struct JointMotion {
    joints: usize,
    /// Angles and rates at each control step, joint by joint.
    states: Vec<[f64; 2]>,
}

impl JointMotion {
    /// Simulates the gimbal: at every step the controller commands joint rates towards the commanded orientation, and
    /// the motors follow with lag within the joint limits.
    pub fn simulate(
        trajectory: &Trajectory,
        chain: &ClassicalChain,
        joints: &[Joint],
        look: &LookAround,
        stabilizer: &Stabilizer,
    ) -> Self {
        let steps = (trajectory.duration_s() / CONTROL_STEP_S).ceil() as usize + 2;
        let mut followed_rad = look.heading_to_follow_rad(&trajectory.at(0.0), 0.0);
        let mut angles = start_angles(trajectory, chain, look, followed_rad);
        let mut rates = [0.0; 3];
        let mut states = Vec::with_capacity(3 * steps);
        let mut kept: Option<UnitQuaternion<f64>> = None;
        for step in 0..steps {
            let time_s = step as f64 * CONTROL_STEP_S;
            let vehicle = trajectory.at(time_s);
            if during(look.stabilized_s, time_s) {
                let rotation = vehicle.world_from_imu.rotation;
                let wanted = kept.get_or_insert_with(|| rotation * chain.imu_from_camera(&angles).rotation);
                let before = angles;
                keep(&rotation, chain, joints, wanted, &mut angles);
                rates = std::array::from_fn(|k| (angles[k] - before[k]) / CONTROL_STEP_S);
            }
            states.extend((0..3).map(|k| [angles[k], rates[k]]));
            followed_rad +=
                (look.heading_to_follow_rad(&vehicle, time_s) - followed_rad) * (CONTROL_STEP_S / stabilizer.follow_s);
            let wanted = look.orientation(followed_rad, time_s);
            let asked =
                joint_rates_towards(&vehicle.world_from_imu.rotation, chain, &angles, &wanted) * stabilizer.gain_per_s;
            let limit = stabilizer.rate_rad_per_s;
            let fixed = look.fixed_joint.filter(|(_, stretch_s)| during(Some(*stretch_s), time_s));
            if during(look.stabilized_s, time_s) {
                continue;
            }
            for k in 0..3 {
                let (low, high) = joints[k].limits_rad;
                let asked = if fixed.is_some_and(|(joint, _)| joint == k) { 0.0 } else { asked[k] };
                rates[k] += (asked.clamp(-limit, limit) - rates[k]) * (CONTROL_STEP_S / stabilizer.motor_s);
                // Braking ahead of a joint limit keeps the motion smooth up to it.
                let brake_per_s = 20.0;
                rates[k] = rates[k].clamp((low - angles[k]) * brake_per_s, (high - angles[k]) * brake_per_s);
                angles[k] = (angles[k] + rates[k] * CONTROL_STEP_S).clamp(low, high);
            }
        }
        Self { joints: 3, states }
    }

    /// Motion of a gimbal with three joints that stabilizes its camera.
    pub fn stabilized(trajectory: &Trajectory, gimbal: &GimbalRig, look: &LookAround) -> Self {
        Self::simulate(trajectory, &gimbal.chain, &gimbal.joints, look, &Stabilizer::default())
    }

    /// Joints that follow prescribed angles; `at` returns angle and rate of a joint at a time in seconds.
    pub fn prescribed(joints: usize, duration_s: f64, at: impl Fn(usize, f64) -> [f64; 2]) -> Self {
        let steps = (duration_s / CONTROL_STEP_S).ceil() as usize + 2;
        let states = (0..steps).flat_map(|step| (0..joints).map(move |joint| (joint, step as f64 * CONTROL_STEP_S)));
        Self { joints, states: states.map(|(joint, time_s)| at(joint, time_s)).collect() }
    }

    /// Fixes the joints from a time on, except for the swing of an exercise within the joint limits.
    pub(crate) fn exercise_from(&mut self, start_s: f64, exercise: &Exercise, joints: &[Joint]) {
        let first = ((start_s / CONTROL_STEP_S).ceil() as usize).min(self.steps() - 1);
        let fixed = self.states[first * self.joints..][..self.joints].to_vec();
        for (step, states) in self.states.chunks_exact_mut(self.joints).enumerate().skip(first) {
            let time_s = (step - first) as f64 * CONTROL_STEP_S;
            for (joint, [angle, rate]) in states.iter_mut().enumerate() {
                let swung = |time_s: f64| {
                    let (low, high) = joints[joint].limits_rad;
                    (fixed[joint][0] + exercise.joint_rad(joint, time_s)).clamp(low, high)
                };
                *angle = swung(time_s);
                *rate = (swung(time_s + CONTROL_STEP_S) - swung(time_s - CONTROL_STEP_S)) / (2.0 * CONTROL_STEP_S);
            }
        }
    }

    fn steps(&self) -> usize {
        self.states.len() / self.joints.max(1)
    }

    /// True joint angles at a time, by cubic interpolation between control steps.
    pub fn at(&self, time_s: f64) -> Vec<f64> {
        if self.joints == 0 {
            return Vec::new();
        }
        let last = self.steps() - 1;
        let position = (time_s / CONTROL_STEP_S).clamp(0.0, last as f64);
        let before = (position as usize).min(last - 1);
        let u = position - before as f64;
        let (from, to) = self.states[before * self.joints..][..2 * self.joints].split_at(self.joints);
        let (u2, u3) = (u * u, u * u * u);
        let angle_rad = |([from, from_rate], [to, to_rate]): (&[f64; 2], &[f64; 2])| {
            (2.0 * u3 - 3.0 * u2 + 1.0) * from
                + (u3 - 2.0 * u2 + u) * CONTROL_STEP_S * from_rate
                + (3.0 * u2 - 2.0 * u3) * to
                + (u3 - u2) * CONTROL_STEP_S * to_rate
        };
        from.iter().zip(to).map(angle_rad).collect()
    }
}

/// First-order joint increments, in radians, that rotate the camera to the commanded orientation.
fn joint_rates_towards(
    world_from_imu: &UnitQuaternion<f64>,
    chain: &ClassicalChain,
    angles_rad: &[f64; 3],
    wanted: &UnitQuaternion<f64>,
) -> Vector3<f64> {
    let mut orientation = *world_from_imu * chain.imu_from_base.rotation;
    let mut axes = Matrix3::zeros();
    for (k, link) in chain.links.iter().take(3).enumerate() {
        axes.set_column(k, &(orientation * Vector3::z()));
        orientation *= link.transform(angles_rad[k]).rotation;
    }
    orientation *= chain.effector_from_camera.rotation;
    let error = so3::log(&(wanted * orientation.inverse()));
    // Damped, so that parallel axes do not lead to infinite rates.
    let normal = axes.transpose() * axes + Matrix3::identity() * 1e-3;
    normal.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * (axes.transpose() * error))
}

/// Iterates the joint angles, in radians within their limits, towards a commanded orientation of the camera in the
/// world.
fn keep(
    world_from_imu: &UnitQuaternion<f64>,
    chain: &ClassicalChain,
    joints: &[Joint],
    wanted: &UnitQuaternion<f64>,
    angles_rad: &mut [f64; 3],
) {
    const ROUNDS: usize = 8;
    for _ in 0..ROUNDS {
        let step = joint_rates_towards(world_from_imu, chain, angles_rad, wanted);
        for k in 0..3 {
            let (low, high) = joints[k].limits_rad;
            angles_rad[k] = (angles_rad[k] + step[k]).clamp(low, high);
        }
    }
}

/// Joint angles, in radians, with the commanded orientation at the log's start.
fn start_angles(trajectory: &Trajectory, chain: &ClassicalChain, look: &LookAround, heading_rad: f64) -> [f64; 3] {
    let rotation = trajectory.at(0.0).world_from_imu.rotation;
    let wanted = look.orientation(heading_rad, 0.0);
    let mut angles = [0.0; 3];
    for _ in 0..40 {
        let step = joint_rates_towards(&rotation, chain, &angles, &wanted);
        for k in 0..3 {
            angles[k] += step[k].clamp(-0.3, 0.3);
        }
    }
    angles
}
