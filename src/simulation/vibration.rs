//! Vibration of the airframe by its rotors, and ripple of the gimbal's servos, as sampled by an IMU.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::imu::ImuRecord;
use super::random::RandomStream;
use super::route::Wave;
use super::trajectory::Trajectory;
use crate::geometry::seconds_from_ns;
use crate::sensors::ImuSample;
use crate::text::Numbers;

/// Number of rotors, each with its own speed.
const ROTORS: usize = 4;
/// Multiples of a rotor's frequency (imbalance, blades, their harmonics), with amplitudes relative to the first.
const HARMONICS: [(f64, f64); 4] = [(1.0, 1.0), (2.0, 0.5), (3.0, 0.25), (4.0, 0.12)];
/// Speed of idling rotors on the ground, relative to hovering.
const IDLE_RATIO: f64 = 0.6;
/// Time constant with which rotors follow the commanded thrust.
const ROTOR_S: f64 = 0.1;
/// Amplitude of random changes of a rotor's speed, as a ratio of the speed.
const WANDER_RATIO: f64 = 0.03;
/// Longest period of the random changes of a rotor's speed, in seconds.
const WANDER_S: f64 = 7.1;
/// Velocity from which the vehicle counts as airborne.
const AIRBORNE_M_PER_S: f64 = 0.2;
/// Corner of the sensor's low-pass filter (second order) as a ratio of the sample rate. Frequencies above half the rate
/// are aliased.
const FILTER_RATE_RATIO: f64 = 0.4;

/// Number of servos, each with its own frequency.
const SERVOS: usize = 3;
/// The ripple of a servo has no harmonics.
const RIPPLE: [(f64, f64); 1] = [(1.0, 1.0)];
/// Amplitude of random changes of a servo's frequency, as a ratio of the frequency.
const SERVO_WANDER_RATIO: f64 = 0.002;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vibration {
    /// Frequency of the rotors while hovering, or of the servos, in Hz. The rotors' thrust follows the flight and grows with the square of the
    /// speed; until the vehicle first moves they idle at 60 % of it.
    pub rotor_hz: f64,
    /// Amplitude of the angular rate at that frequency before the sensor's filter, root sum square over the rotors, in rad/s.
    pub rate_rad_per_s: f64,
    /// Amplitude of the specific force at that frequency before the sensor's filter, root sum square over the rotors, in
    /// m/s².
    pub force_m_per_s2: f64,
}

impl Numbers for Vibration {
    fn set(&mut self, numbers: &[f64]) -> bool {
        let [rotor_hz, rate_rad_per_s, force_m_per_s2] = *numbers else { return false };
        *self = Self { rotor_hz, rate_rad_per_s, force_m_per_s2 };
        true
    }

    fn get(&self) -> Vec<f64> {
        vec![self.rotor_hz, self.rate_rad_per_s, self.force_m_per_s2]
    }
}

/// One harmonic of one rotor: direction and phase in each sensor.
struct Line {
    multiple: f64,
    rate: (Vector3<f64>, f64),
    force: (Vector3<f64>, f64),
}

struct Rotor {
    wander: Wave,
    phase_rad: f64,
    lines: Vec<Line>,
}

impl Rotor {
    /// One of several rotors with random directions and phases of its harmonics.
    fn new(vibration: &Vibration, count: usize, harmonics: &[(f64, f64)], random: &mut RandomStream) -> Self {
        // Independent rotors add up as a root sum square.
        let per_rotor = (count as f64).sqrt().recip();
        let lines = harmonics.iter().map(|&(multiple, amplitude)| {
            let mut direction = |size: f64| {
                let vector = random.normal_vector(1.0);
                (vector * (per_rotor * amplitude * size / vector.norm().max(1e-9)), random.uniform(0.0, TAU))
            };
            Line { multiple, rate: direction(vibration.rate_rad_per_s), force: direction(vibration.force_m_per_s2) }
        });
        let lines = lines.collect();
        Self { wander: Wave::new(random, WANDER_S), phase_rad: random.uniform(0.0, TAU), lines }
    }

    /// Adds its harmonics to a sample; `gain` is the amplitude of the one with a multiple of the frequency.
    fn add_to(&self, sample: &mut ImuSample, gain: impl Fn(f64) -> f64) {
        for line in &self.lines {
            let gain = gain(line.multiple);
            let value = |(direction, phase): (Vector3<f64>, f64)| {
                direction * (gain * (line.multiple * self.phase_rad + phase).sin())
            };
            sample.angular_velocity_rad_per_s += value(line.rate);
            sample.specific_force_m_per_s2 += value(line.force);
        }
    }
}

/// Adds the ripple of the gimbal's servos to all samples, which no filter precedes.
pub fn ripple(record: &mut ImuRecord, vibration: &Vibration, random: &mut RandomStream) {
    let mut servos: Vec<Rotor> = (0..SERVOS).map(|_| Rotor::new(vibration, SERVOS, &RIPPLE, random)).collect();
    let mut last_s = 0.0;
    for sample in &mut record.samples {
        let time_s = seconds_from_ns(sample.stamp_ns);
        let step_s = time_s - last_s;
        last_s = time_s;
        for servo in &mut servos {
            let ratio = 1.0 + SERVO_WANDER_RATIO * servo.wander.at(time_s);
            servo.phase_rad += TAU * vibration.rotor_hz * ratio * step_s;
            servo.add_to(sample, |_| 1.0);
        }
    }
}

/// Adds the vibration to all samples of a flight.
pub fn shake(record: &mut ImuRecord, trajectory: &Trajectory, vibration: &Vibration, random: &mut RandomStream) {
    let mut rotors: Vec<Rotor> = (0..ROTORS).map(|_| Rotor::new(vibration, ROTORS, &HARMONICS, random)).collect();
    let gravity = trajectory.gravity_m_per_s2();
    let (mut airborne, mut speed_ratio, mut last_s) = (false, IDLE_RATIO, 0.0);
    let count = record.samples.len();
    let end_s = record.samples.last().map_or(0.0, |sample| seconds_from_ns(sample.stamp_ns));
    let rate_hz = count.saturating_sub(1).max(1) as f64 / end_s.max(1e-9);
    for sample in &mut record.samples {
        let time_s = seconds_from_ns(sample.stamp_ns);
        let (step_s, ground_truth) = (time_s - last_s, trajectory.at(time_s));
        last_s = time_s;
        airborne |= ground_truth.velocity_m_per_s.norm() > AIRBORNE_M_PER_S;
        let thrust_ratio = ground_truth.specific_force_m_per_s2.norm() / gravity;
        let wanted = if airborne { thrust_ratio.sqrt() } else { IDLE_RATIO };
        speed_ratio += (wanted - speed_ratio) * (step_s / ROTOR_S).min(1.0);
        for rotor in &mut rotors {
            let ratio = speed_ratio * (1.0 + WANDER_RATIO * rotor.wander.at(time_s));
            let rotor_hz = vibration.rotor_hz * ratio;
            rotor.phase_rad += TAU * rotor_hz * step_s;
            rotor.add_to(sample, |multiple| {
                let filtered = 1.0 / (1.0 + (multiple * rotor_hz / (FILTER_RATE_RATIO * rate_hz)).powi(4)).sqrt();
                ratio * ratio * filtered
            });
        }
    }
}
