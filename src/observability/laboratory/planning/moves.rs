//! Moves with words: the moves of the suggested excitation, and moves of two joints at once.

use super::super::Situation;
use super::super::advice::{joint_words, swing_words, vehicle_words, words};
use crate::simulation::{Exercise, JointSwing};

/// Swing of the vehicle with swings of up to two joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HandMove {
    pub(super) exercise: Exercise,
    /// Second joint, which swings to both sides while the first one turns to one side and back.
    pub(super) second: Option<JointSwing>,
}

impl HandMove {
    /// Change of a joint's angle from the start, in radians.
    pub(super) fn joint_rad(&self, joint: usize, time_s: f64) -> f64 {
        let second = Exercise { joint: self.second, ..self.exercise };
        self.exercise.joint_rad(joint, time_s) + second.joint_rad(joint, time_s)
    }

    /// Change of a channel (joints, forward, left, up, heading) from the start, in radians or metres.
    pub(super) fn change(&self, channel: usize, joints: usize, time_s: f64) -> f64 {
        match channel.checked_sub(joints) {
            None => self.joint_rad(channel, time_s),
            Some(axis @ 0..3) => self.exercise.shift_m(time_s)[axis],
            Some(_) => self.exercise.heading_change_rad(time_s),
        }
    }

    /// Divides the amplitude of each swing by the largest excess of its channels, if that is above 1.
    pub(super) fn scale(&mut self, joints: usize, excess: impl Fn(&Self, usize) -> f64) {
        let before = *self;
        let ratio = |channel: usize| 1.0 / excess(&before, channel).max(1.0);
        self.exercise.vehicle_ratio *= (joints..joints + 4).map(ratio).fold(1.0, f64::min);
        for swing in [&mut self.exercise.joint, &mut self.second].into_iter().flatten() {
            swing.amplitude_rad *= ratio(swing.joint);
        }
    }

    /// The move as an instruction.
    pub(super) fn words(&self, situation: &Situation) -> String {
        let joints = &situation.joints;
        let (Some(first), Some(second)) = (self.exercise.joint, self.second) else {
            return words(&self.exercise, joints);
        };
        let (name, turn_deg) = (joint_words(&first, joints), first.amplitude_rad.to_degrees());
        let sign = if turn_deg < 0.0 { '−' } else { '+' };
        let (swing, vehicle) = (swing_words(&second, joints), vehicle_words(&self.exercise));
        format!("{name} by {sign}{:.0}° and back, {swing}, {vehicle}", turn_deg.abs())
    }
}
