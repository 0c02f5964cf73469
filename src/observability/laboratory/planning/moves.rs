//! Moves with words: those of the suggested excitation, and the same with a second joint.

use super::super::Situation;
use super::super::advice::{candidates, words};
use super::search::{CHECK_STEP_S, MARGIN, SearchProblem};
use super::starts;
use crate::simulation::{Exercise, JointSwing};

/// Time of the second joint relative to the first: its swings are slower, so that the two are not correlated.
const SECOND_JOINT_TIME: f64 = 0.7;

/// Step at which swings are compared with the ranges of the limits, in seconds.
const RANGE_STEP_S: f64 = 0.05;

/// Swing of the vehicle with swings of up to two joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HandMove {
    pub(super) exercise: Exercise,
    /// Second joint, which swings in the same way but more slowly.
    pub(super) second: Option<JointSwing>,
}

impl HandMove {
    /// Change of a joint's angle from the start, in radians.
    pub(super) fn joint_rad(&self, joint: usize, time_s: f64) -> f64 {
        let second = Exercise { joint: self.second, ..self.exercise };
        self.exercise.joint_rad(joint, time_s) + second.joint_rad(joint, SECOND_JOINT_TIME * time_s)
    }

    /// Change of a channel (joints, forward, left, up, heading) from the start, in radians or metres.
    pub(super) fn change(&self, channel: usize, joints: usize, time_s: f64) -> f64 {
        match channel.checked_sub(joints) {
            None => self.joint_rad(channel, time_s),
            Some(axis @ 0..3) => self.exercise.shift_m(time_s)[axis],
            Some(_) => self.exercise.heading_change_rad(time_s),
        }
    }

    /// The move with amplitudes at which its swings over a time are within the limits, each for itself.
    fn within_limits(mut self, problem: &SearchProblem<'_>, duration_s: f64) -> Self {
        let joints = problem.situation.joints.len();
        let rest = &problem.situation.joints_rad;
        let limits = problem.limits;
        let by_range = |choice: &Self, channel: usize| {
            let (low, high) = limits.range(channel);
            let middle = rest.get(channel).copied().unwrap_or(0.0);
            let times_s = (0..=(duration_s / RANGE_STEP_S) as usize).map(|step| step as f64 * RANGE_STEP_S);
            let largest = times_s.map(|time_s| choice.change(channel, joints, time_s).abs()).fold(0.0, f64::max);
            largest / (high - middle).min(middle - low)
        };
        self.scale(joints, by_range);
        let motion = starts::as_described(problem, duration_s, &[self]);
        let reduced = limits.reduced(MARGIN);
        self.scale(joints, |_, channel| reduced.load(&motion, channel, [0.0, duration_s], CHECK_STEP_S));
        self
    }

    /// Divides the amplitude of each swing by the largest excess of its channels, if that is above 1.
    fn scale(&mut self, joints: usize, excess: impl Fn(&Self, usize) -> f64) {
        let before = *self;
        let ratio = |channel: usize| 1.0 / excess(&before, channel).max(1.0);
        self.exercise.vehicle_ratio *= (joints..joints + 4).map(ratio).fold(1.0, f64::min);
        for swing in [&mut self.exercise.joint, &mut self.second].into_iter().flatten() {
            swing.amplitude_rad *= ratio(swing.joint);
        }
    }

    /// The move as an instruction.
    pub(super) fn words(&self, situation: &Situation) -> String {
        let one = words(&self.exercise, &situation.joints);
        let Some(second) = self.second else { return one };
        let name = situation.joints.get(second.joint).map_or("a joint", |joint| joint.name.as_str());
        format!("{one}, and more slowly {name} ±{:.0}°", second.amplitude_rad.to_degrees())
    }
}

/// The listed motions: each swing of the vehicle with none or one of the joints, continued over a time within the limits.
pub(super) fn listed(problem: &SearchProblem<'_>, duration_s: f64) -> Vec<HandMove> {
    let all = candidates(problem.situation).into_iter().map(|exercise| HandMove { exercise, second: None });
    all.map(|choice| choice.within_limits(problem, duration_s)).collect()
}

/// The listed motions, and their combinations with a second joint.
pub(super) fn combined(problem: &SearchProblem<'_>, duration_s: f64) -> Vec<HandMove> {
    let one = listed(problem, duration_s);
    let mut moves = one.clone();
    for first in &one {
        let Some(swing) = first.exercise.joint else { continue };
        let others = one.iter().filter(|other| other.exercise.vehicle == first.exercise.vehicle);
        let seconds = others.filter_map(|other| other.exercise.joint).filter(|second| second.joint > swing.joint);
        moves.extend(seconds.map(|second| HandMove { second: Some(second), ..*first }));
    }
    moves
}
