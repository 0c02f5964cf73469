//! Flight of the multirotor: a spline for position and one for heading, everything else by differential flatness.

use nalgebra::{Matrix3, Rotation3, SVector, UnitQuaternion, Vector1, Vector3};

use super::random::RandomStream;
use super::route::Flight;
use super::spline::Spline;
use crate::geometry::RigidTransform;

/// Limits of the multirotor, after the `AscTec` Firefly of `RotorS` (1.57 kg, six rotors, about two g of thrust).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleLimits {
    /// Largest angle between thrust and the vertical, in radians.
    pub tilt_rad: f64,
    /// Least thrust over mass, in m/s².
    pub min_thrust_m_per_s2: f64,
    /// Largest thrust over mass, in m/s².
    pub largest_thrust_m_per_s2: f64,
    /// Largest angular rate about any axis, in rad/s.
    pub rate_rad_per_s: f64,
    /// Largest velocity, in m/s.
    pub speed_m_per_s: f64,
}

impl Default for VehicleLimits {
    fn default() -> Self {
        Self {
            tilt_rad: 38_f64.to_radians(),
            min_thrust_m_per_s2: 4.5,
            largest_thrust_m_per_s2: 18.5,
            rate_rad_per_s: 2.4,
            speed_m_per_s: 7.0,
        }
    }
}

/// State of the vehicle at one time. The body frame, which is the IMU frame, has x forward, y left, z up along
/// the thrust.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    /// Pose of the IMU in the world, whose z axis points up.
    pub world_from_imu: RigidTransform,
    /// Velocity in the world.
    pub velocity_m_per_s: Vector3<f64>,
    /// Acceleration in the world.
    pub acceleration_m_per_s2: Vector3<f64>,
    /// Angular velocity in the IMU frame.
    pub angular_velocity_rad_per_s: Vector3<f64>,
    /// Specific force in the IMU frame, 3 × 1 in m/s²: +g along z when stationary and level.
    pub specific_force_m_per_s2: Vector3<f64>,
    /// Heading of the vehicle's route, in radians from the world's x axis, not wrapped.
    pub heading_rad: f64,
}

/// Smooth flight in closed form: uniform quintic B-splines of position and heading.
///
/// Attitude, angular velocity and specific force follow from velocity, acceleration, jerk and heading (differential
/// flatness of a multirotor with linear air drag `c`): the z axis is parallel to the thrust `a + g + c·v`, the y axis
/// is perpendicular to it and to the heading.
#[derive(Clone, Debug)]
pub struct Trajectory {
    position_m: Spline<3>,
    heading_rad: Spline<1>,
    gravity_m_per_s2: f64,
    duration_s: f64,
}

/// Drag of the air over mass and velocity, in 1/s.
pub const AIR_DRAG_PER_S: f64 = 0.15;

/// Time step at which limits are checked and lengths are summed, in seconds.
const CHECK_STEP_S: f64 = 0.02;

impl Trajectory {
    /// Follows `flight` with random manoeuvres for `duration_s` seconds; manoeuvres that exceed `limits` are reduced.
    pub fn new(
        flight: &dyn Flight,
        random: &mut RandomStream,
        limits: &VehicleLimits,
        duration_s: f64,
        gravity_m_per_s2: f64,
    ) -> Self {
        let knot_s = flight.knot_s();
        let count = Spline::<3>::points_for(duration_s, knot_s);
        let mut base = Vec::with_capacity(count);
        let mut position_wander = Vec::with_capacity(count);
        let mut heading = Vec::with_capacity(count);
        let mut clock = Spline::<3> { knot_s, points: Vec::new() };
        for index in 0..count {
            let time_s = clock.time_of_point(index);
            let point = flight.point(time_s.max(0.0));
            base.push(point.position_m);
            let fractions = Vector3::new(random.normal(), random.normal(), random.normal()).map(|x| x.clamp(-2.0, 2.0));
            position_wander.push(fractions.component_mul(&point.position_wander_m));
            let heading_wander = random.normal().clamp(-2.0, 2.0) * point.heading_wander_rad;
            heading.push(Vector1::new(point.heading_rad + heading_wander));
        }
        clock.points = base.iter().zip(&position_wander).map(|(position, shift)| position + shift).collect();
        let heading_rad = Spline { knot_s, points: heading };
        let mut trajectory = Self { position_m: clock, heading_rad, gravity_m_per_s2, duration_s };
        trajectory.soften(&base, &mut position_wander, limits);
        trajectory
    }

    /// Flight along these splines.
    pub fn of_splines(position_m: Spline<3>, heading_rad: Spline<1>, gravity_m_per_s2: f64, duration_s: f64) -> Self {
        Self { position_m, heading_rad, gravity_m_per_s2, duration_s }
    }

    /// Reduces the manoeuvres where a limit is exceeded until none is, in at most 200 iterations.
    fn soften(&mut self, base: &[SVector<f64, 3>], position_wander: &mut [SVector<f64, 3>], limits: &VehicleLimits) {
        for _ in 0..200 {
            let mut factor = vec![1.0_f64; base.len()];
            let mut exceeded = false;
            let steps = (self.duration_s / CHECK_STEP_S).ceil() as usize;
            for step in 0..=steps {
                let time_s = step as f64 * CHECK_STEP_S;
                if limits.admit(&self.at(time_s)) {
                    continue;
                }
                exceeded = true;
                let first = self.position_m.first_acting(time_s);
                for slot in factor.iter_mut().skip(first).take(6) {
                    *slot = 0.92;
                }
            }
            if !exceeded {
                return;
            }
            for (index, slot) in factor.iter().enumerate() {
                position_wander[index] *= *slot;
                self.position_m.points[index] = base[index] + position_wander[index];
            }
        }
    }

    /// Adds a rotation about the vertical over an interval of start and length in seconds.
    pub fn spin(&mut self, [start_s, length_s]: [f64; 2], rate_rad_per_s: f64) {
        for index in 0..self.heading_rad.points.len() {
            let time_s = self.heading_rad.time_of_point(index);
            self.heading_rad.points[index].x += rate_rad_per_s * (time_s - start_s).clamp(0.0, length_s.max(0.0));
        }
    }

    /// Inserts hovering over an interval of start and length in seconds, with a sway of a centimetre; the rest is
    /// delayed.
    ///
    /// A spline extends three knots to each side of its points, so the vehicle decelerates before and is stationary
    /// after.
    pub fn hover(&mut self, [start_s, length_s]: [f64; 2]) {
        const SWAY_M: f64 = 0.01;
        const REACH: usize = 6;
        let count = self.position_m.points.len();
        let first = (0..count).find(|index| self.position_m.time_of_point(*index) >= start_s).unwrap_or(count);
        let inserted = (length_s / self.position_m.knot_s).ceil() as usize + REACH;
        let (Some(place), Some(heading)) =
            (self.position_m.points.get(first).copied(), self.heading_rad.points.get(first).copied())
        else {
            return;
        };
        let sway = |index: usize| {
            let phase = index as f64;
            Vector3::new((2.1 * phase).sin(), (3.7 * phase + 1.0).sin(), (2.9 * phase + 2.0).sin()) * SWAY_M
        };
        self.position_m.points.splice(first..first, (0..inserted).map(|index| place + sway(index)));
        self.heading_rad.points.splice(first..first, (0..inserted).map(|_| heading));
        self.position_m.points.truncate(count);
        self.heading_rad.points.truncate(count);
    }

    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Gravity of the world, in m/s².
    pub(super) fn gravity_m_per_s2(&self) -> f64 {
        self.gravity_m_per_s2
    }

    /// Pose, velocity and the measurement of an ideal IMU, `time_s` after the start.
    pub fn at(&self, time_s: f64) -> Kinematics {
        let position_m = self.position_m.derivative(time_s, 0);
        let velocity_m_per_s = self.position_m.derivative(time_s, 1);
        let acceleration_m_per_s2 = self.position_m.derivative(time_s, 2);
        let jerk = self.position_m.derivative(time_s, 3);
        let heading_rad = self.heading_rad.derivative(time_s, 0).x;
        let heading_rate = self.heading_rad.derivative(time_s, 1).x;

        let felt = acceleration_m_per_s2 + Vector3::new(0.0, 0.0, self.gravity_m_per_s2);
        let thrust = felt + velocity_m_per_s * AIR_DRAG_PER_S;
        let thrust_rate = jerk + acceleration_m_per_s2 * AIR_DRAG_PER_S;
        let thrust_norm = thrust.norm();
        let z_axis = thrust / thrust_norm;
        let z_rate = (thrust_rate - z_axis * z_axis.dot(&thrust_rate)) / thrust_norm;
        let (sine, cosine) = heading_rad.sin_cos();
        let ahead = Vector3::new(cosine, sine, 0.0);
        let ahead_rate = Vector3::new(-sine, cosine, 0.0) * heading_rate;
        let side = z_axis.cross(&ahead);
        let side_rate = z_rate.cross(&ahead) + z_axis.cross(&ahead_rate);
        let side_norm = side.norm();
        let y_axis = side / side_norm;
        let x_axis = y_axis.cross(&z_axis);

        // Columns are the body axes, so dR/dt = R·[ω]^ gives ω from the axes' rates.
        let angular_velocity_rad_per_s =
            Vector3::new(-z_rate.dot(&y_axis), z_rate.dot(&x_axis), -x_axis.dot(&side_rate) / side_norm);
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x_axis, y_axis, z_axis]));
        Kinematics {
            world_from_imu: RigidTransform::new(UnitQuaternion::from_rotation_matrix(&rotation), position_m),
            velocity_m_per_s,
            acceleration_m_per_s2,
            angular_velocity_rad_per_s,
            specific_force_m_per_s2: Vector3::new(x_axis.dot(&felt), y_axis.dot(&felt), z_axis.dot(&felt)),
            heading_rad,
        }
    }

    /// Length of the path until `time_s`, in metres.
    pub fn length_m(&self, time_s: f64) -> f64 {
        let steps = (time_s / CHECK_STEP_S).round().max(1.0) as usize;
        let step_s = time_s / steps as f64;
        (0..steps).map(|step| self.position_m.derivative((step as f64 + 0.5) * step_s, 1).norm() * step_s).sum()
    }

    /// Time in seconds at which the path has this length, at most the duration; a multiple of 0.05 s.
    pub fn time_of_length(&self, length_m: f64) -> f64 {
        const STEP_S: f64 = 0.05;
        let mut length = 0.0;
        let mut step = 0_u32;
        while length < length_m && f64::from(step) * STEP_S < self.duration_s {
            length += self.position_m.derivative((f64::from(step) + 0.5) * STEP_S, 1).norm() * STEP_S;
            step += 1;
        }
        f64::from(step) * STEP_S
    }

    /// Ends the flight earlier.
    pub fn cut(mut self, duration_s: f64) -> Self {
        self.duration_s = self.duration_s.min(duration_s);
        self
    }
}

impl VehicleLimits {
    /// Checks a flight every 0.02 s.
    ///
    /// # Errors
    /// The first time at which the flight exceeds a limit, with the value there.
    pub fn admit_flight(&self, trajectory: &Trajectory) -> Result<(), String> {
        let steps = (trajectory.duration_s / CHECK_STEP_S).floor() as usize;
        let mut times_s = (0..=steps).map(|step| step as f64 * CHECK_STEP_S);
        let exceeded = |time_s: f64| {
            let value = self.exceeded(&trajectory.at(time_s))?;
            Some(format!("at {time_s:.2} s the vehicle would need {value}"))
        };
        times_s.find_map(exceeded).map_or(Ok(()), Err)
    }

    /// True if the state is within the limits.
    pub fn admit(&self, state: &Kinematics) -> bool {
        self.exceeded(state).is_none()
    }

    /// Value of a state beyond its limit, in words.
    fn exceeded(&self, state: &Kinematics) -> Option<String> {
        let thrust = state.specific_force_m_per_s2.z;
        let upright = (state.world_from_imu.rotation * Vector3::z()).z;
        let rate_rad_per_s = state.angular_velocity_rad_per_s.amax();
        let speed = state.velocity_m_per_s.norm();
        let is_upright = upright >= self.tilt_rad.cos();
        if !is_upright {
            let tilt_deg = upright.clamp(-1.0, 1.0).acos().to_degrees();
            return Some(format!("a tilt of {tilt_deg:.0}° (at most {:.0}°)", self.tilt_rad.to_degrees()));
        }
        let (least, largest) = (self.min_thrust_m_per_s2, self.largest_thrust_m_per_s2);
        if !(least..=largest).contains(&thrust) {
            return Some(format!("a thrust of {thrust:.1} m/s² ({least:.1} to {largest:.1} m/s²)"));
        }
        let turns_slowly = rate_rad_per_s <= self.rate_rad_per_s;
        if !turns_slowly {
            let [rate, largest] = [rate_rad_per_s, self.rate_rad_per_s].map(f64::to_degrees);
            return Some(format!("an angular rate of {rate:.0}°/s (at most {largest:.0}°/s)"));
        }
        let is_slow = speed <= self.speed_m_per_s;
        (!is_slow).then(|| format!("a speed of {speed:.1} m/s (at most {:.1} m/s)", self.speed_m_per_s))
    }
}
