//! Motions from which searches start.

use std::f64::consts::TAU;

use super::super::Situation;
use super::limits::MotionLimits;
use super::moves::HandMove;
use super::search::SearchProblem;
use crate::geometry::{SplitMix64, smooth_step};
use crate::simulation::{GROWTH_S, MotionSplines};

/// Distance of the knots of a planned motion, in seconds.
pub const PLAN_KNOT_S: f64 = 0.5;
/// Distance of the knots of moves with words, in seconds: a spline with control values on a swing of 1.25 s, the shortest
/// one, then has 95 % of its amplitude.
const DESCRIBED_KNOT_S: f64 = 0.1;
/// Free control values at either end over which a random start grows to its size.
const GROWTH_POINTS: usize = 4;
/// Shortest and longest period of the waves of a random start, in seconds.
const PERIODS_S: [f64; 2] = [2.0, 7.0];

/// Motion at rest with the start angles of the joints and these distances of the knots.
pub(super) fn at_rest(situation: &Situation, duration_s: f64, knot_s: f64) -> MotionSplines {
    let intervals = (duration_s / knot_s).round().max(1.0) as usize;
    MotionSplines::at_rest(&situation.joints_rad, duration_s, intervals)
}

/// Sets each free control value to its value at rest plus a change, which grows and fades over a number of control values
/// at the ends, within the limits.
fn fill(motion: &mut MotionSplines, limits: &MotionLimits, growth: usize, mut change: impl FnMut(usize, f64) -> f64) {
    let free = motion.free_points();
    for channel in 0..motion.channel_count() {
        let (low, high) = limits.range(channel);
        let rest = motion.point(channel, 0);
        for index in free.clone() {
            let steps = (index - free.start + 1).min(free.end - index);
            let grown = (steps as f64 / (growth + 1) as f64).min(1.0);
            let value = rest + grown * change(channel, motion.time_of_point(index));
            motion.set_point(channel, index, value.clamp(low, high));
        }
    }
}

/// Moves one after the other, each for one window, as curves on which the search can start.
pub(super) fn of_moves(problem: &SearchProblem<'_>, duration_s: f64, moves: &[HandMove]) -> MotionSplines {
    curves(problem, duration_s, moves, PLAN_KNOT_S)
}

/// Moves one after the other as they are described; a single one continues.
pub(super) fn as_described(problem: &SearchProblem<'_>, duration_s: f64, moves: &[HandMove]) -> MotionSplines {
    curves(problem, duration_s, moves, DESCRIBED_KNOT_S)
}

/// Splines with these knots and the control values of the moves; every move fades out at its end as it grows at its
/// start.
fn curves(problem: &SearchProblem<'_>, duration_s: f64, moves: &[HandMove], knot_s: f64) -> MotionSplines {
    let mut motion = at_rest(problem.situation, duration_s, knot_s);
    let joints = motion.joint_count();
    let length_s = if moves.len() > 1 { problem.layout.length_s } else { duration_s };
    let Some(last) = moves.len().checked_sub(1) else { return motion };
    fill(&mut motion, problem.limits, 0, |channel, time_s| {
        let index = ((time_s / length_s) as usize).min(last);
        let since_s = time_s - index as f64 * length_s;
        let left = ((length_s - since_s) / GROWTH_S).clamp(0.0, 1.0);
        moves[index].change(channel, joints, since_s) * smooth_step(left)
    });
    motion
}

/// Two waves with random periods and phases in every channel.
pub(super) fn random(
    situation: &Situation,
    limits: &MotionLimits,
    duration_s: f64,
    random: &mut SplitMix64,
) -> MotionSplines {
    let mut motion = at_rest(situation, duration_s, PLAN_KNOT_S);
    let mut wave = || {
        let [short_s, long_s] = PERIODS_S;
        let period_s = short_s + (long_s - short_s) * random.next_unit();
        (period_s, TAU * random.next_unit())
    };
    let waves: Vec<[(f64, f64); 2]> = (0..motion.channel_count()).map(|_| [wave(), wave()]).collect();
    fill(&mut motion, limits, GROWTH_POINTS, |channel, time_s| {
        let (low, high) = limits.range(channel);
        let sine = |(period_s, phase_rad): (f64, f64)| (TAU * time_s / period_s + phase_rad).sin();
        0.25 * (high - low) * (sine(waves[channel][0]) + sine(waves[channel][1]))
    });
    motion
}
