//! Motion that brings the parameters of a run to the required accuracy.

use super::answer::Answer;
use crate::log_check::Trust;
use crate::observability::laboratory::{EnteredLimits, Situation, SufficientMotion, sufficient_motion};
use crate::sensors::Rig;
use crate::session::record::StepRecord;
use crate::text::counted;

impl Answer {
    /// True if a motion can be asked for: the run is trusted and lacks accuracy.
    pub fn needs_motion(&self) -> bool {
        self.trust == Trust::Trusted && !self.meets_requirement()
    }
}

/// Motion after a step of a run with a rig's camera, within slow limits of joints and vehicle, after which the parameters of
/// the chain reach the required accuracy; `None` if they do, or if the step has no rank report.
///
/// Time offsets and intrinsics of sensors are not planned.
pub fn motion_after(step: &StepRecord, rig: &Rig, camera_key: &str) -> Option<SufficientMotion> {
    let situation = Situation::of_step(&step.report, step.rank.as_ref()?, rig, camera_key)?;
    sufficient_motion(&situation, &EnteredLimits::SLOW.around(&situation))
}

/// Number of moves that an instruction names.
const NAMED: usize = 2;

/// Instruction in few words: `Fly 12 s: 3 moves`, or the move if there is one.
pub fn short_motion_text(motion: &SufficientMotion, rig: &Rig) -> String {
    let moves = match motion.moves.as_slice() {
        [(words, _)] => words.clone(),
        moves => counted(moves.len(), "move"),
    };
    with_remaining(format!("Fly {:.0} s: {moves}", motion.duration_s()), motion, rig)
}

/// Instruction to fly a motion: `Fly 12 s: yaw gimbal ±16°, translate sideways ±0.46 m for 4 s, then … for 8 s`.
pub fn motion_text(motion: &SufficientMotion, rig: &Rig) -> String {
    let named = motion.moves.iter().take(NAMED).map(|(words, duration_s)| {
        if motion.moves.len() == 1 { words.clone() } else { format!("{words} for {duration_s:.0} s") }
    });
    let further = motion.moves.len().saturating_sub(NAMED);
    let further = (further > 0).then(|| counted(further, "further move"));
    let moves: Vec<String> = named.chain(further).collect();
    with_remaining(format!("Fly {:.0} s: {}", motion.duration_s(), moves.join(", then ")), motion, rig)
}

/// A text with the parameter that the motion leaves without the required accuracy.
fn with_remaining(text: String, motion: &SufficientMotion, rig: &Rig) -> String {
    match motion.remaining {
        Some((parameter, sigma)) => {
            let name = rig.parameter_names().name(parameter);
            format!("{text}; {name} then still has ± {}", parameter.shown().sigma(sigma))
        }
        None => text,
    }
}
