//! Motions from which searches start.

use std::f64::consts::TAU;

use super::super::Situation;
use super::limits::MotionLimits;
use super::moves::HandMove;
use crate::geometry::SplitMix64;
use crate::simulation::MotionSplines;

/// Distance of the knots of a planned motion, in seconds.
pub const PLAN_KNOT_S: f64 = 0.5;
/// Free control values at either end over which a start grows to its size.
const GROWTH_POINTS: usize = 4;
/// Shortest and longest period of the waves of a random start, in seconds.
const PERIODS_S: [f64; 2] = [2.0, 7.0];

/// Motion at rest with the start angles of the joints.
pub(super) fn at_rest(situation: &Situation, duration_s: f64) -> MotionSplines {
    let intervals = (duration_s / PLAN_KNOT_S).round().max(1.0) as usize;
    MotionSplines::at_rest(&situation.joints_rad, duration_s, intervals)
}

/// Sets each free control value to its value at rest plus a change, which grows and fades at the ends, within the
/// limits.
fn fill(motion: &mut MotionSplines, limits: &MotionLimits, mut change: impl FnMut(usize, f64) -> f64) {
    let free = motion.free_points();
    for channel in 0..motion.channel_count() {
        let (low, high) = limits.range(channel);
        let rest = motion.point(channel, 0);
        for index in free.clone() {
            let steps = (index - free.start + 1).min(free.end - index);
            let grown = (steps as f64 / (GROWTH_POINTS + 1) as f64).min(1.0);
            let value = rest + grown * change(channel, motion.time_of_point(index));
            motion.set_point(channel, index, value.clamp(low, high));
        }
    }
}

/// Moves one after the other, each for `length_s` seconds; the last one continues.
pub(super) fn of_moves(
    situation: &Situation,
    limits: &MotionLimits,
    duration_s: f64,
    moves: &[HandMove],
    length_s: f64,
) -> MotionSplines {
    let mut motion = at_rest(situation, duration_s);
    let joints = motion.joint_count();
    let Some(last) = moves.len().checked_sub(1) else { return motion };
    fill(&mut motion, limits, |channel, time_s| {
        let index = ((time_s / length_s) as usize).min(last);
        // A single move continues; of several, each starts anew.
        let since_s = time_s - index as f64 * length_s;
        let exercise = moves[index].exercise;
        match channel.checked_sub(joints) {
            None => moves[index].joint_rad(channel, since_s),
            Some(axis @ 0..3) => exercise.shift_m(since_s)[axis],
            Some(_) => exercise.heading_change_rad(since_s),
        }
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
    let mut motion = at_rest(situation, duration_s);
    let mut wave = || {
        let [short_s, long_s] = PERIODS_S;
        let period_s = short_s + (long_s - short_s) * random.next_unit();
        (period_s, TAU * random.next_unit())
    };
    let waves: Vec<[(f64, f64); 2]> = (0..motion.channel_count()).map(|_| [wave(), wave()]).collect();
    fill(&mut motion, limits, |channel, time_s| {
        let (low, high) = limits.range(channel);
        let sine = |(period_s, phase_rad): (f64, f64)| (TAU * time_s / period_s + phase_rad).sin();
        0.25 * (high - low) * (sine(waves[channel][0]) + sine(waves[channel][1]))
    });
    motion
}
