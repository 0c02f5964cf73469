//! Changes of a planned motion by hand.

use super::limits::MotionLimits;
use super::search::{Bump, add};
use crate::simulation::MotionSplines;

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
