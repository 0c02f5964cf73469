//! Local search over the control values of a motion.
//!
//! A trial adds a bump to the control values of one or two channels, within the limits, and is accepted if the criterion
//! falls. Only the windows that the bump changes are linearized again.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nalgebra::DMatrix;

use super::super::Situation;
use super::limits::MotionLimits;
use super::objective::Objective;
use super::windows::{WindowLayout, WindowRows, joined, rows_of_window, trajectory};
use crate::geometry::SplitMix64;
use crate::simulation::MotionSplines;

/// Step at which rates and accelerations are compared with the limits during the search.
pub(super) const CHECK_STEP_S: f64 = 0.04;
/// Ratio of the limits within which the search stays, for extremes between its steps.
pub(super) const MARGIN: f64 = 0.97;
/// Knots on either side of a control value on which it has an effect.
const REACH_KNOTS: f64 = 6.0;
/// Half widths of bumps, in knots.
const WIDTHS_KNOTS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Ratio of trials that change two channels.
const TWO_CHANNELS: f64 = 0.3;
/// Factors on the size of bumps in a channel after an accepted and after a rejected trial.
const SIZE_FACTORS: [f64; 2] = [1.3, 0.97];
/// Smallest and largest size of bumps, as ratios of a channel's range.
const SIZES: [f64; 2] = [0.02, 0.6];
/// Times that a bump beyond the limits is halved before the trial is given up.
const HALVINGS: usize = 3;

/// Time of a trial with fine windows in trials with coarse ones.
pub(super) const FINE_WEIGHT: usize = 4;

/// Progress of searches on several threads, which can be stopped.
pub(super) struct SearchProgress {
    /// Number of coarse trials of all searches together.
    total: usize,
    done: AtomicUsize,
    is_stopped: AtomicBool,
}

impl SearchProgress {
    pub(super) fn new(total: usize) -> Self {
        Self { total, done: AtomicUsize::new(0), is_stopped: AtomicBool::new(false) }
    }

    /// Counts a trial and passes the ratio that is done to `watch`; true if it has stopped the searches.
    pub(super) fn step(&self, weight: usize, watch: impl FnOnce(f64) -> ControlFlow<()>) -> bool {
        let done = self.done.fetch_add(weight, Ordering::Relaxed) + weight;
        if watch(done as f64 / self.total.max(1) as f64).is_break() {
            self.is_stopped.store(true, Ordering::Relaxed);
        }
        self.is_stopped()
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }
}

/// Inputs of a search, the same for all its starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchProblem<'a> {
    pub(super) situation: &'a Situation,
    pub(super) objective: &'a Objective,
    pub(super) limits: &'a MotionLimits,
    pub(super) layout: WindowLayout,
}

/// A motion with the rows of its windows.
#[derive(Clone, Debug)]
pub(super) struct SearchedMotion {
    pub(super) motion: MotionSplines,
    pub(super) windows: Vec<WindowRows>,
    /// Value that the search minimizes.
    pub(super) value: f64,
}

/// Change of the control values of a channel: centre and half width as indices, height in the channel's unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bump {
    pub(super) channel: usize,
    pub(super) centre: usize,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Bump {
    /// Part of the height that is added to a control value.
    pub(super) fn weight(&self, index: usize) -> f64 {
        let distance = index.abs_diff(self.centre) as f64;
        if distance <= extent(self) { (-0.5 * (distance / self.width).powi(2)).exp() } else { 0.0 }
    }
}

impl SearchProblem<'_> {
    /// Rows of every window of a motion; `None` when a number is not finite.
    pub(super) fn evaluate(&self, motion: MotionSplines) -> Option<SearchedMotion> {
        let flight = trajectory(self.situation, &motion);
        let of = |window| rows_of_window(self.situation, &motion, &flight, &self.layout, window);
        let windows: Vec<WindowRows> = (0..self.layout.count).map(of).collect::<Option<_>>()?;
        let value = self.objective.search_value(&self.total(&windows))?;
        Some(SearchedMotion { motion, windows, value })
    }

    /// Information of consecutive windows.
    pub(super) fn total(&self, windows: &[WindowRows]) -> DMatrix<f64> {
        joined(windows, self.situation.information.ncols())
    }

    /// Runs a number of trials from a motion; `stop` is asked after each, with the best motion so far.
    pub(super) fn improve(
        &self,
        start: SearchedMotion,
        trials: usize,
        random: &mut SplitMix64,
        stop: &(dyn Fn(&MotionSplines) -> bool + Sync),
    ) -> SearchedMotion {
        let limits = self.limits.reduced(MARGIN);
        let mut best = start;
        let mut sizes = vec![0.25; best.motion.channel_count()];
        for _ in 0..trials {
            let bumps = self.draw(&best.motion, &sizes, random);
            let better =
                bumped(&best.motion, &bumps, &limits).and_then(|motion| self.reevaluate(&best, motion, &bumps));
            let is_better = better.as_ref().is_some_and(|better| better.value < best.value);
            for bump in &bumps {
                let size = &mut sizes[bump.channel];
                *size = (*size * SIZE_FACTORS[usize::from(!is_better)]).clamp(SIZES[0], SIZES[1]);
            }
            if let Some(better) = better.filter(|_| is_better) {
                best = better;
            }
            if stop(&best.motion) {
                break;
            }
        }
        best
    }

    /// Draws the bumps of a trial.
    fn draw(&self, motion: &MotionSplines, sizes: &[f64], random: &mut SplitMix64) -> Vec<Bump> {
        let free = motion.free_points();
        let count = if random.next_unit() < TWO_CHANNELS { 2 } else { 1 };
        let index =
            |random: &mut SplitMix64, count: usize| ((random.next_unit() * count as f64) as usize).min(count - 1);
        (0..count)
            .map(|_| {
                let channel = index(random, motion.channel_count());
                let (low, high) = self.limits.range(channel);
                // About normal: the sum of three uniform numbers.
                let height = 2.0 * (random.next_unit() + random.next_unit() + random.next_unit() - 1.5);
                Bump {
                    channel,
                    centre: free.start + index(random, free.len()),
                    width: WIDTHS_KNOTS[index(random, WIDTHS_KNOTS.len())],
                    height: height * sizes[channel] * (high - low),
                }
            })
            .collect()
    }

    /// Linearizes the windows that bumps have changed.
    fn reevaluate(&self, before: &SearchedMotion, motion: MotionSplines, bumps: &[Bump]) -> Option<SearchedMotion> {
        let flight = trajectory(self.situation, &motion);
        let mut windows = before.windows.clone();
        let mut is_changed = vec![false; windows.len()];
        for bump in bumps {
            is_changed[self.layout.within(reach_s(&motion, bump))].fill(true);
        }
        for (window, _) in is_changed.iter().enumerate().filter(|(_, is_changed)| **is_changed) {
            windows[window] = rows_of_window(self.situation, &motion, &flight, &self.layout, window)?;
        }
        let value = self.objective.search_value(&self.total(&windows))?;
        Some(SearchedMotion { motion, windows, value })
    }

    /// Makes a motion slower and smaller until it is within the limits, each of its channels for itself.
    pub(super) fn within_limits(&self, mut motion: MotionSplines) -> MotionSplines {
        const ROUNDS: usize = 120;
        const FACTOR: f64 = 0.94;
        let limits = self.limits.reduced(MARGIN);
        let whole_s = [0.0, motion.duration_s()];
        for _ in 0..ROUNDS {
            let exceeded: Vec<usize> = (0..motion.channel_count())
                .filter(|channel| limits.load(&motion, *channel, whole_s, CHECK_STEP_S) > 1.0)
                .collect();
            if exceeded.is_empty() {
                break;
            }
            for channel in exceeded {
                let rest = motion.point(channel, 0);
                for index in motion.free_points() {
                    let value = motion.point(channel, index);
                    motion.set_point(channel, index, rest + (value - rest) * FACTOR);
                }
            }
        }
        motion
    }
}

/// Motion with these bumps, smaller ones if they exceed the limits; `None` if these still do.
fn bumped(motion: &MotionSplines, bumps: &[Bump], limits: &MotionLimits) -> Option<MotionSplines> {
    let mut factor = 1.0;
    for _ in 0..=HALVINGS {
        let mut changed = motion.clone();
        for bump in bumps {
            let range = limits.range(bump.channel);
            add(&mut changed, &Bump { height: bump.height * factor, ..*bump }, range);
        }
        let within = |bump: &Bump| limits.load(&changed, bump.channel, reach_s(motion, bump), CHECK_STEP_S) <= 1.0;
        if bumps.iter().all(within) {
            return Some(changed);
        }
        factor *= 0.5;
    }
    None
}

/// Time in which a bump changes a motion.
fn reach_s(motion: &MotionSplines, bump: &Bump) -> [f64; 2] {
    let middle_s = motion.time_of_point(bump.centre);
    let half_s = (REACH_KNOTS + extent(bump)) * motion.knot_s();
    [(middle_s - half_s).max(0.0), (middle_s + half_s).min(motion.duration_s())]
}

/// Knots on either side of its centre beyond which a bump is zero.
fn extent(bump: &Bump) -> f64 {
    (2.5 * bump.width).ceil()
}

/// Adds a bump to the free control values of its channel, limited to a range.
pub(super) fn add(motion: &mut MotionSplines, bump: &Bump, (low, high): (f64, f64)) {
    for index in motion.free_points() {
        let change = bump.height * bump.weight(index);
        if change != 0.0 {
            let value = motion.point(bump.channel, index) + change;
            motion.set_point(bump.channel, index, value.clamp(low, high));
        }
    }
}

/// Smallest half width of a change, in knots.
const MIN_WIDTH_KNOTS: f64 = 0.25;

/// Moves the curve of a channel by `change` (radians or metres) at the time of a control value, and less to both sides:
/// the control values around it move by a Gaussian of the half width `width_s`.
///
/// The motion stays within the ranges of the limits and at rest at its ends; rates and accelerations may exceed theirs. At
/// a control value that is not free nothing moves.
pub fn move_point(
    motion: &mut MotionSplines,
    limits: &MotionLimits,
    (channel, index): (usize, usize),
    change: f64,
    width_s: f64,
) {
    let free = motion.free_points();
    if !free.contains(&index) {
        return;
    }
    let width = (width_s / motion.knot_s()).max(MIN_WIDTH_KNOTS);
    let unit = Bump { channel, centre: index, width, height: 1.0 };
    // Change of the curve at that time for a bump of height one.
    let answer: f64 = free.map(|point| unit.weight(point) * MotionSplines::weight_at_knot(point.abs_diff(index))).sum();
    add(motion, &Bump { height: change / answer, ..unit }, limits.range(channel));
}
