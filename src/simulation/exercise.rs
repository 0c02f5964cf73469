//! Exercises: swings of the vehicle and of one joint, for flights with a defined excitation.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::geometry::smooth_step;

/// Swing of the vehicle; a multirotor tilts to accelerate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum VehicleSwing {
    Hover,
    Forward,
    Sideways,
    UpDown,
    /// Quickly left and right, so that it rolls.
    Roll,
    /// Quickly forward and back, so that it pitches.
    Pitch,
    /// Rotation about the vertical.
    Yaw,
}

impl VehicleSwing {
    pub const ALL: [Self; 7] =
        [Self::Hover, Self::Forward, Self::Sideways, Self::UpDown, Self::Roll, Self::Pitch, Self::Yaw];
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSwing {
    /// Index of the joint, from 0.
    pub joint: usize,
    /// Amplitude to each side of the initial angle.
    pub amplitude_rad: f64,
    pub period_s: f64,
}

/// Simultaneous swings of the vehicle and of a joint, the other joints fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exercise {
    pub vehicle: VehicleSwing,
    /// Ratio of the vehicle's swing to its full amplitude.
    pub vehicle_ratio: f64,
    pub joint: Option<JointSwing>,
}

/// Amplitude of slow swings, to each side.
const SWING_M: f64 = 0.75;
/// Period of slow swings.
const SWING_PERIOD_S: f64 = 4.0;
/// Amplitude of quick swings, to each side.
const ROCK_M: f64 = 0.12;
/// Period of quick swings: 3 m/s² and 17° of tilt at the turning points.
pub const ROCK_PERIOD_S: f64 = 1.25;
/// Amplitude of the vehicle's yaw.
const YAW_SWING_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Period of the vehicle's yaw.
const YAW_PERIOD_S: f64 = 3.3;
/// Period of a joint's swing in the suggested excitation; in no simple ratio to the vehicle's periods, so that the two are not correlated.
pub const JOINT_PERIOD_S: f64 = 2.6;
/// Time in which a swing grows to its amplitude.
pub const GROWTH_S: f64 = 1.0;

fn swing(time_s: f64, period_s: f64) -> f64 {
    let fraction = (time_s / GROWTH_S).clamp(0.0, 1.0);
    smooth_step(fraction) * (TAU * time_s / period_s).sin()
}

impl Exercise {
    /// Exercise with the full amplitude of the vehicle's swing.
    pub const fn full(vehicle: VehicleSwing, joint: Option<JointSwing>) -> Self {
        Self { vehicle, vehicle_ratio: 1.0, joint }
    }

    /// Amplitude of the vehicle's swing, to each side: in metres, of the yaw in radians.
    pub fn vehicle_amplitude(&self) -> f64 {
        let full = match self.vehicle {
            VehicleSwing::Hover => 0.0,
            VehicleSwing::Forward | VehicleSwing::Sideways | VehicleSwing::UpDown => SWING_M,
            VehicleSwing::Roll | VehicleSwing::Pitch => ROCK_M,
            VehicleSwing::Yaw => YAW_SWING_RAD,
        };
        full * self.vehicle_ratio
    }

    /// Displacement of the vehicle from its start: forward, left, up, in metres.
    pub fn shift_m(&self, time_s: f64) -> Vector3<f64> {
        let slow = self.vehicle_amplitude() * swing(time_s, SWING_PERIOD_S);
        let quick = self.vehicle_amplitude() * swing(time_s, ROCK_PERIOD_S);
        match self.vehicle {
            VehicleSwing::Hover | VehicleSwing::Yaw => Vector3::zeros(),
            VehicleSwing::Forward => Vector3::new(slow, 0.0, 0.0),
            VehicleSwing::Sideways => Vector3::new(0.0, slow, 0.0),
            VehicleSwing::UpDown => Vector3::new(0.0, 0.0, slow),
            VehicleSwing::Roll => Vector3::new(0.0, quick, 0.0),
            VehicleSwing::Pitch => Vector3::new(quick, 0.0, 0.0),
        }
    }

    /// Rotation of the vehicle about the vertical, in radians.
    pub fn heading_change_rad(&self, time_s: f64) -> f64 {
        if self.vehicle == VehicleSwing::Yaw { self.vehicle_amplitude() * swing(time_s, YAW_PERIOD_S) } else { 0.0 }
    }

    /// Change of a joint's angle from its start, in radians.
    pub fn joint_rad(&self, joint: usize, time_s: f64) -> f64 {
        let swung = self.joint.filter(|swung| swung.joint == joint);
        swung.map_or(0.0, |swung| swung.amplitude_rad * swing(time_s, swung.period_s))
    }
}
