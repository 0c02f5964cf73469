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

/// Motion of at most `longest_s` after a step of a run with a rig's camera, within slow limits of joints and vehicle, after
/// which the parameters of the chain reach the required accuracy or are nearest to it; `None` if they do, or if the step has
/// no rank report.
///
/// The factor on the σ of the step holds for its information and for what the motion adds. Time offsets and intrinsics of
/// sensors are not planned.
pub fn motion_after(step: &StepRecord, rig: &Rig, camera_key: &str, longest_s: f64) -> Option<SufficientMotion> {
    let mut situation = Situation::of_step(&step.report, step.rank.as_ref()?, rig, camera_key)?;
    let factor = step.report.calibration.sigma_scale;
    situation.required = situation.required.divided(factor);
    let mut motion = sufficient_motion(&situation, &EnteredLimits::SLOW.around(&situation), longest_s)?;
    if let Some((_, sigma)) = &mut motion.remaining {
        *sigma *= factor;
    }
    Some(motion)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Dimension;
    use crate::observability::laboratory::LONGEST_MOTION_S;
    use crate::session::tests::memory::recorded;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    #[test]
    fn a_run_whose_sigmas_are_multiplied_needs_a_longer_motion() {
        let flight = synthetic_tracks(&SyntheticOptions::default());
        let mut rig = flight.given_rig.clone();
        let run = recorded(&flight, "auto");
        let mut step = (**run.steps.last().unwrap()).clone();
        // The motion of a run that nearly reaches the requirement is short.
        let largest = |of: Dimension| {
            let calibration = &step.report.calibration;
            let sigmas = calibration.parameters.iter().zip(&calibration.sigmas);
            sigmas.filter(|(it, _)| it.dimension() == of).map(|(_, sigma)| *sigma).fold(0.0, f64::max)
        };
        let required = &mut rig.required_accuracy;
        (required.translation_m, required.rotation_rad) =
            (0.95 * largest(Dimension::Length), 0.95 * largest(Dimension::Angle));
        let motion =
            |step: &StepRecord| motion_after(step, &rig, &run.camera_key, LONGEST_MOTION_S).expect("accuracy lacks");
        let short = motion(&step);
        assert!(short.remaining.is_none(), "{:?}", short.moves);
        step.report.calibration.sigma_scale = 3.0;
        let long = motion(&step);
        assert!(long.duration_s() > short.duration_s(), "{} and {} s", long.duration_s(), short.duration_s());
    }
}
