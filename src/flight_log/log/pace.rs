//! Choice of images where they come faster than they are processed.

use std::collections::BTreeMap;

use parking_lot::Mutex;

use crate::geometry::ns_from_seconds;

/// Time of stamps for which one choice holds, so that cameras that are triggered together keep the same images.
const CHOICE_NS: i64 = 250_000_000;
/// Part of the longest delay from which on images are left out.
const FIRST_LEFT_OUT: f64 = 0.5;
/// Largest interval between images that are kept, of the images that come: every fifth.
const LARGEST_STRIDE: i64 = 5;
/// Number of choices that are remembered, one minute of them.
const CHOICES: usize = 240;
/// Log time that a run catches up in one second of log, at least, while it works on what was written before it began.
const CATCH_UP: f64 = 0.25;

/// Images that a run leaves out to stay close to the newest message.
///
/// From half of the longest delay on every second image is left out, with a growing delay more of them, and beyond it
/// all, so that tracks are interrupted only where nothing else helps. What was written before the run began does not
/// count, as long as the run catches up.
#[derive(Debug)]
pub(super) struct Pace {
    longest_ns: i64,
    /// Length of the log when it was opened.
    first_ns: i64,
    /// One image in this many is kept, none for `None`, by number of [`CHOICE_NS`] since the start of the log.
    choices: Mutex<BTreeMap<i64, Option<i64>>>,
}

impl Pace {
    /// Longest delay, and length of the log at opening.
    pub(super) fn new(longest_delay_s: f64, opened_ns: u64) -> Self {
        let first_ns = i64::try_from(opened_ns).unwrap_or(i64::MAX);
        Self { longest_ns: ns_from_seconds(longest_delay_s).max(1), first_ns, choices: Mutex::default() }
    }

    /// True if an image is left out; `newest_ns` is the time of the newest message, both since the start of the log.
    pub(super) fn leaves_out(&self, stamp_ns: i64, newest_ns: i64, rate_hz: f64) -> bool {
        let mut choices = self.choices.lock();
        let stride = *choices
            .entry(stamp_ns.div_euclid(CHOICE_NS))
            .or_insert_with(|| self.stride(newest_ns.saturating_sub(stamp_ns), newest_ns));
        while choices.len() > CHOICES {
            choices.pop_first();
        }
        let interval_ns = if rate_hz > 0.0 { ns_from_seconds(1.0 / rate_hz).max(1) } else { 1 };
        let number = stamp_ns.saturating_add(interval_ns / 2).div_euclid(interval_ns);
        stride.is_none_or(|stride| number.rem_euclid(stride) != 0)
    }

    /// One image in this many is kept at a delay; `None` for none.
    fn stride(&self, delay_ns: i64, newest_ns: i64) -> Option<i64> {
        let since_ns = newest_ns.saturating_sub(self.first_ns).max(0);
        let before_ns = self.first_ns.saturating_sub((CATCH_UP * since_ns as f64) as i64);
        let longest_ns = self.longest_ns.max(before_ns.saturating_mul(2).saturating_add(self.longest_ns / 2));
        let part = delay_ns as f64 / longest_ns as f64;
        if part < FIRST_LEFT_OUT {
            return Some(1);
        }
        let beyond = (part - FIRST_LEFT_OUT) / (1.0 - FIRST_LEFT_OUT);
        let stride = 2 + (beyond * (LARGEST_STRIDE - 1) as f64) as i64;
        (part <= 1.0).then_some(stride.min(LARGEST_STRIDE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    /// Number of images that are kept of a second of 20 per second, at a delay.
    fn kept(pace: &Pace, from_ns: i64, delay_ns: i64) -> usize {
        (0..20)
            .filter(|image| !pace.leaves_out(from_ns + image * S / 20, from_ns + image * S / 20 + delay_ns, 20.0))
            .count()
    }

    #[test]
    fn more_images_are_left_out_the_larger_the_delay() {
        let pace = Pace::new(2.0, 0);
        assert_eq!(kept(&pace, 100 * S, S / 2), 20);
        assert_eq!(kept(&pace, 110 * S, 11 * S / 10), 10);
        assert_eq!(kept(&pace, 120 * S, 19 * S / 10), 4);
        assert_eq!(kept(&pace, 130 * S, 3 * S), 0);
        assert_eq!(kept(&pace, 140 * S, S / 5), 20);
    }

    #[test]
    fn cameras_that_are_triggered_together_keep_the_same_images() {
        let pace = Pace::new(2.0, 0);
        let of_one: Vec<bool> =
            (0..40).map(|image| pace.leaves_out(image * S / 20, image * S / 20 + 3 * S / 2, 20.0)).collect();
        // The other camera asks later, when the run has caught up.
        let of_other: Vec<bool> =
            (0..40).map(|image| pace.leaves_out(image * S / 20 + 100, image * S / 20, 20.0)).collect();
        assert_eq!(of_one, of_other);
        assert!(of_one.contains(&true) && of_one.contains(&false));
    }

    #[test]
    fn what_was_written_before_the_run_began_is_used() {
        let pace = Pace::new(1.0, 30 * S as u64);
        assert_eq!(kept(&pace, 0, 29 * S / 2), 20, "at the beginning");
        assert_eq!(kept(&pace, 60 * S, 8 * S), 20, "half of it, thirty seconds later");
        assert_eq!(kept(&pace, 200 * S, 2 * S), 0, "later");
    }
}
