//! Moves of the suggested excitation and moves of two joints, with the amplitudes that the limits admit.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::super::advice::{MIN_SWING_RAD, candidates};
use super::moves::HandMove;
use super::search::{CHECK_STEP_S, MARGIN, SearchProblem};
use super::starts;
use crate::simulation::{Exercise, JointSwing, MotionSplines, VehicleSwing};

/// Step at which swings are compared with the ranges of the limits, in seconds.
const RANGE_STEP_S: f64 = 0.05;
/// Distance that moves by hand keep from the stops of the joints, since their angles are measured with errors.
const STOP_DISTANCE_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;
/// Period of the swings of a second joint.
const SECOND_JOINT_PERIOD_S: f64 = 3.7;

/// The move with amplitudes at which its swings over a time are within the limits, each for itself.
fn admitted(mut choice: HandMove, problem: &SearchProblem<'_>, duration_s: f64) -> HandMove {
    let joints = problem.situation.joints.len();
    let rest = &problem.situation.joints_rad;
    let limits = problem.limits;
    choice.scale(joints, |choice, channel| {
        let (low, high) = limits.range(channel);
        let middle = rest.get(channel).copied().unwrap_or(0.0);
        let times_s = (0..=(duration_s / RANGE_STEP_S) as usize).map(|step| step as f64 * RANGE_STEP_S);
        let changes = times_s.map(|time_s| choice.change(channel, joints, time_s));
        changes.map(|change| (change / (high - middle)).max(change / (low - middle))).fold(0.0, f64::max)
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

/// The listed motions, and for each swing of the vehicle the moves of two joints: one turns to one side and back, another
/// one swings to both sides.
pub(super) fn with_two_joints(problem: &SearchProblem<'_>, duration_s: f64) -> Vec<HandMove> {
    let mut limits = problem.limits.clone();
    for ((low, high), start) in limits.joints_rad.iter_mut().zip(&problem.situation.joints_rad) {
        *low = (*low + STOP_DISTANCE_RAD).min(*start);
        *high = (*high - STOP_DISTANCE_RAD).max(*start);
    }
    let problem = &SearchProblem { limits: &limits, ..*problem };
    let mut moves = listed(problem, duration_s);
    let joints = 0..problem.situation.joints.len();
    let widest = |joint: usize, period_s: f64| -> Option<JointSwing> {
        let (low, high) = problem.limits.range(joint);
        // A turn goes to the side with more room.
        let start = problem.situation.joints_rad[joint];
        let amplitude_rad = if high - start < start - low { low - start } else { high - start };
        let swing = JointSwing { joint, amplitude_rad, period_s };
        let exercise = Exercise::full(VehicleSwing::Hover, Some(swing));
        let admitted = admitted(HandMove { exercise, second: None }, problem, duration_s).exercise.joint;
        admitted.filter(|swing| swing.amplitude_rad.abs() >= MIN_SWING_RAD)
    };
    let turns: Vec<JointSwing> = joints.clone().filter_map(|joint| widest(joint, 2.0 * duration_s)).collect();
    let swings: Vec<JointSwing> = joints.filter_map(|joint| widest(joint, SECOND_JOINT_PERIOD_S)).collect();
    let vehicles: Vec<Exercise> = moves.iter().map(|one| one.exercise).filter(|it| it.joint.is_none()).collect();
    for vehicle in vehicles {
        for turn in &turns {
            let seconds = swings.iter().filter(|second| second.joint != turn.joint);
            let exercise = Exercise { joint: Some(*turn), ..vehicle };
            moves.extend(seconds.map(|second| HandMove { exercise, second: Some(*second) }));
        }
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
