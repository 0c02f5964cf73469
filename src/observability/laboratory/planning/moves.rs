//! Moves with words: those of the suggested excitation, and the same with a second joint.

use super::super::Situation;
use super::super::advice::{candidates, words};
use crate::simulation::{Exercise, JointSwing};

/// Time of the second joint relative to the first: its swings are slower, so that the two are not correlated.
const SECOND_JOINT_TIME: f64 = 0.7;

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

    /// The move as an instruction.
    pub(super) fn words(&self, situation: &Situation) -> String {
        let one = words(&self.exercise, &situation.joints);
        let Some(second) = self.second else { return one };
        let name = situation.joints.get(second.joint).map_or("a joint", |joint| joint.name.as_str());
        format!("{one}, and more slowly {name} ±{:.0}°", second.amplitude_rad.to_degrees())
    }
}

/// The listed motions: each swing of the vehicle with none or one of the joints.
pub(super) fn listed(situation: &Situation) -> Vec<HandMove> {
    candidates(situation).into_iter().map(|exercise| HandMove { exercise, second: None }).collect()
}

/// The listed motions, and their combinations with a second joint.
pub(super) fn combined(situation: &Situation) -> Vec<HandMove> {
    let one = listed(situation);
    let mut moves = one.clone();
    for first in &one {
        let Some(swing) = first.exercise.joint else { continue };
        let others = one.iter().filter(|other| other.exercise.vehicle == first.exercise.vehicle);
        let seconds = others.filter_map(|other| other.exercise.joint).filter(|second| second.joint > swing.joint);
        moves.extend(seconds.map(|second| HandMove { second: Some(second), ..*first }));
    }
    moves
}
