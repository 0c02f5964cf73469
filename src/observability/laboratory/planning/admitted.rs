//! Moves of the suggested excitation, and the same with a second joint, with the amplitudes that the limits admit.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::super::advice::candidates;
use super::moves::HandMove;
use super::search::{CHECK_STEP_S, MARGIN, SearchProblem};
use super::starts;
use crate::simulation::MotionSplines;

/// Step at which swings are compared with the ranges of the limits, in seconds.
const RANGE_STEP_S: f64 = 0.05;

/// The move with amplitudes at which its swings over a time are within the limits, each for itself.
fn admitted(mut choice: HandMove, problem: &SearchProblem<'_>, duration_s: f64) -> HandMove {
    let joints = problem.situation.joints.len();
    let rest = &problem.situation.joints_rad;
    let limits = problem.limits;
    choice.scale(joints, |choice, channel| {
        let (low, high) = limits.range(channel);
        let middle = rest.get(channel).copied().unwrap_or(0.0);
        let times_s = (0..=(duration_s / RANGE_STEP_S) as usize).map(|step| step as f64 * RANGE_STEP_S);
        let largest = times_s.map(|time_s| choice.change(channel, joints, time_s).abs()).fold(0.0, f64::max);
        largest / (high - middle).min(middle - low)
    });
    let motion = starts::as_described(problem, duration_s, &[choice]);
    let reduced = limits.reduced(MARGIN);
    choice.scale(joints, |_, channel| reduced.load(&motion, channel, [0.0, duration_s], CHECK_STEP_S));
    choice
}

/// The listed motions: each swing of the vehicle with none or one of the joints, continued over a time within the limits.
pub(super) fn listed(problem: &SearchProblem<'_>, duration_s: f64) -> Vec<HandMove> {
    let all = candidates(problem.situation).into_iter().map(|exercise| HandMove { exercise, second: None });
    all.map(|choice| admitted(choice, problem, duration_s)).collect()
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

/// A listed motion that continues over a whole flight.
#[derive(Clone, Debug)]
pub(super) struct RepeatedMove {
    pub(super) choice: HandMove,
    pub(super) motion: MotionSplines,
    /// Information about the calibration at the end.
    pub(super) information: DMatrix<f64>,
}

impl RepeatedMove {
    /// All listed motions over a flight of this duration.
    pub(super) fn all(problem: &SearchProblem<'_>, duration_s: f64) -> Vec<Self> {
        let of = |choice: HandMove| {
            let flown = problem.evaluate(starts::as_described(problem, duration_s, &[choice]))?;
            Some(Self { choice, information: problem.total(&flown.windows), motion: flown.motion })
        };
        listed(problem, duration_s).into_par_iter().filter_map(of).collect()
    }
}
