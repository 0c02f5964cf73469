//! Limits of a planned motion, and the largest values that a motion reaches.

use nalgebra::Vector3;
use serde::Serialize;

use super::super::Situation;
use crate::simulation::MotionSplines;

/// Largest acceleration of the rotation about the vertical, in degrees/s².
const HEADING_ACCELERATION_DEG_PER_S2: f64 = 120.0;

/// Limits of joints and vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionLimits {
    /// Lower and upper angle of each joint.
    pub joints_rad: Vec<(f64, f64)>,
    pub joint_rate_rad_per_s: f64,
    pub joint_acceleration_rad_per_s2: f64,
    pub speed_m_per_s: f64,
    pub acceleration_m_per_s2: f64,
    /// Largest distance from the start: forward or back, to either side, up or down.
    pub reach_m: Vector3<f64>,
    /// Largest rotation about the vertical to either side.
    pub heading_rad: f64,
    pub heading_rate_rad_per_s: f64,
    pub heading_acceleration_rad_per_s2: f64,
}

/// Limits in the units in which they are entered.
#[derive(Clone, Debug, PartialEq)]
pub struct EnteredLimits {
    /// Largest rotation of a joint to either side of its start angle.
    pub joint_range_deg: f64,
    pub joint_rate_deg_per_s: f64,
    pub joint_acceleration_deg_per_s2: f64,
    pub speed_m_per_s: f64,
    pub acceleration_m_per_s2: f64,
    /// Largest distance from the start: forward or back, to either side, up or down.
    pub reach_m: [f64; 3],
    /// Largest rotation about the vertical to either side.
    pub heading_deg: f64,
    pub heading_rate_deg_per_s: f64,
}

impl EnteredLimits {
    /// Limits that suit a small multirotor, or a person with the rig in the hand.
    pub const SLOW: Self = Self {
        joint_range_deg: 60.0,
        joint_rate_deg_per_s: 60.0,
        joint_acceleration_deg_per_s2: 180.0,
        speed_m_per_s: 1.5,
        acceleration_m_per_s2: 3.0,
        reach_m: [1.5, 1.5, 1.0],
        heading_deg: 60.0,
        heading_rate_deg_per_s: 45.0,
    };

    /// Limits for the joints of a situation, which also keep within their stops.
    pub fn around(&self, situation: &Situation) -> MotionLimits {
        let range_rad = self.joint_range_deg.to_radians();
        let joints = situation.joints.iter().zip(&situation.joints_rad);
        let ranges = joints.map(|(joint, start_rad)| {
            let (low, high) = joint.limits_rad;
            (low.max(start_rad - range_rad), high.min(start_rad + range_rad))
        });
        self.of_joints(ranges.collect())
    }

    /// Limits for joints with these ranges.
    pub fn of_joints(&self, joints_rad: Vec<(f64, f64)>) -> MotionLimits {
        MotionLimits {
            joints_rad,
            joint_rate_rad_per_s: self.joint_rate_deg_per_s.to_radians(),
            joint_acceleration_rad_per_s2: self.joint_acceleration_deg_per_s2.to_radians(),
            speed_m_per_s: self.speed_m_per_s,
            acceleration_m_per_s2: self.acceleration_m_per_s2,
            reach_m: self.reach_m.into(),
            heading_rad: self.heading_deg.to_radians(),
            heading_rate_rad_per_s: self.heading_rate_deg_per_s.to_radians(),
            heading_acceleration_rad_per_s2: HEADING_ACCELERATION_DEG_PER_S2.to_radians(),
        }
    }
}

impl MotionLimits {
    /// These limits, lower by a ratio except the ranges, as a margin for a check at other times.
    pub(super) fn reduced(&self, ratio: f64) -> Self {
        Self {
            joint_rate_rad_per_s: self.joint_rate_rad_per_s * ratio,
            joint_acceleration_rad_per_s2: self.joint_acceleration_rad_per_s2 * ratio,
            speed_m_per_s: self.speed_m_per_s * ratio,
            acceleration_m_per_s2: self.acceleration_m_per_s2 * ratio,
            heading_rate_rad_per_s: self.heading_rate_rad_per_s * ratio,
            heading_acceleration_rad_per_s2: self.heading_acceleration_rad_per_s2 * ratio,
            ..self.clone()
        }
    }

    /// Smallest and largest control value of a channel. A spline stays within the range of its control values.
    pub fn range(&self, channel: usize) -> (f64, f64) {
        match channel.checked_sub(self.joints_rad.len()) {
            None => self.joints_rad[channel],
            Some(axis @ 0..3) => (-self.reach_m[axis], self.reach_m[axis]),
            Some(_) => (-self.heading_rad, self.heading_rad),
        }
    }

    /// Largest excess of a motion over the limits of a channel's rate and acceleration between two times, as a ratio: at
    /// most 1 within the limits. The three channels of the position are one.
    pub(super) fn load(&self, motion: &MotionSplines, channel: usize, [from_s, to_s]: [f64; 2], step_s: f64) -> f64 {
        let steps = ((to_s - from_s) / step_s).ceil().max(1.0) as usize;
        let times_s = (0..=steps).map(|step| (from_s + step as f64 * step_s).min(to_s));
        times_s.map(|time_s| self.load_at(motion, channel, time_s)).fold(0.0, f64::max)
    }

    /// Rate and acceleration of a channel at a time, as the larger ratio to their limits.
    pub fn load_at(&self, motion: &MotionSplines, channel: usize, time_s: f64) -> f64 {
        match channel.checked_sub(self.joints_rad.len()) {
            None => {
                let [rate, acceleration] = [1, 2].map(|order| motion.value(channel, time_s, order).abs());
                (rate / self.joint_rate_rad_per_s).max(acceleration / self.joint_acceleration_rad_per_s2)
            }
            Some(0..3) => {
                let [speed, acceleration] = [1, 2].map(|order| motion.position_m(time_s, order).norm());
                (speed / self.speed_m_per_s).max(acceleration / self.acceleration_m_per_s2)
            }
            Some(_) => {
                let [rate, acceleration] = [1, 2].map(|order| motion.heading_rad(time_s, order).abs());
                (rate / self.heading_rate_rad_per_s).max(acceleration / self.heading_acceleration_rad_per_s2)
            }
        }
    }

    /// Limits with the largest values that a motion reaches, at steps of 0.01 s.
    pub fn compare(&self, motion: &MotionSplines, joint_names: &[String]) -> Vec<ReachedLimit> {
        const STEP_S: f64 = 0.01;
        let steps = (motion.duration_s() / STEP_S).ceil() as usize;
        let largest = |of: &dyn Fn(f64) -> f64| {
            (0..=steps).map(|step| of((step as f64 * STEP_S).min(motion.duration_s()))).fold(f64::MIN, f64::max)
        };
        let row = |quantity: String, unit: &'static str, limit: f64, of: &dyn Fn(f64) -> f64| ReachedLimit {
            quantity,
            unit,
            limit,
            reached: largest(of),
        };
        let mut rows = Vec::new();
        for (joint, (low, high)) in self.joints_rad.iter().enumerate() {
            let name = joint_names.get(joint).map_or("joint", String::as_str);
            rows.push(row(format!("{name}, upper"), "rad", *high, &|time_s| motion.value(joint, time_s, 0)));
            rows.push(row(format!("{name}, lower"), "rad", -low, &|time_s| -motion.value(joint, time_s, 0)));
            let rate = self.joint_rate_rad_per_s;
            rows.push(row(format!("{name}, rate"), "rad/s", rate, &|time_s| motion.value(joint, time_s, 1).abs()));
            let limit = self.joint_acceleration_rad_per_s2;
            let acceleration = |time_s: f64| motion.value(joint, time_s, 2).abs();
            rows.push(row(format!("{name}, acceleration"), "rad/s²", limit, &acceleration));
        }
        for (axis, name) in ["forward or back", "sideways", "up or down"].into_iter().enumerate() {
            let of = |time_s: f64| motion.position_m(time_s, 0)[axis].abs();
            rows.push(row(name.to_owned(), "m", self.reach_m[axis], &of));
        }
        let speed = |time_s: f64| motion.position_m(time_s, 1).norm();
        rows.push(row("speed".to_owned(), "m/s", self.speed_m_per_s, &speed));
        let acceleration = |time_s: f64| motion.position_m(time_s, 2).norm();
        rows.push(row("acceleration".to_owned(), "m/s²", self.acceleration_m_per_s2, &acceleration));
        for (order, name, unit, limit) in [
            (0, "heading", "rad", self.heading_rad),
            (1, "heading, rate", "rad/s", self.heading_rate_rad_per_s),
            (2, "heading, acceleration", "rad/s²", self.heading_acceleration_rad_per_s2),
        ] {
            rows.push(row(name.to_owned(), unit, limit, &|time_s| motion.heading_rad(time_s, order).abs()));
        }
        rows
    }
}

/// A limit with the largest value that a motion reaches; a lower stop and its angle have the opposite sign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReachedLimit {
    pub quantity: String,
    pub unit: &'static str,
    pub limit: f64,
    pub reached: f64,
}

impl ReachedLimit {
    /// True if the value is within the limit up to rounding errors.
    pub fn is_kept(&self) -> bool {
        self.reached <= self.limit + 1e-9
    }
}
