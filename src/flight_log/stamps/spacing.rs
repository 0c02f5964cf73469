//! Spacing of the stamps of a topic: its period, and batches of messages that were stamped on arrival.

use crate::geometry::{self, seconds_from_ns};

/// Steps shorter and longer than these ratios of the mean step occur together only in batches.
const SHORT_RATIO: f64 = 0.3;
const LONG_RATIO: f64 = 1.5;
/// Smallest ratio of short steps in batches.
const MIN_SHORT: f64 = 0.25;
/// Smallest ratio of long steps: the largest batch has a hundred messages.
const MIN_LONG: f64 = 0.01;
/// Largest relative difference between a sensor's period and the steps of one that loses messages.
const PERIOD_TOLERANCE: f64 = 0.2;

/// Longer steps between images, as a ratio of the usual step, miss an image: each one counts.
const IMAGE_GAP: f64 = 1.75;
/// The same for other sensors, whose single samples do not count.
const SAMPLE_GAP: f64 = 2.5;

/// Stamps of a topic in their order, whatever the order of the messages.
pub(crate) struct Spacing {
    /// Different stamps, ascending, in nanoseconds since the log began.
    stamps_ns: Vec<i64>,
    /// Differences of consecutive stamps in seconds.
    pub(crate) steps_s: Vec<f64>,
    /// Time between two measurements: the median step, that by first stamp, last stamp and count for batches; 0 without
    /// steps.
    pub(crate) period_s: f64,
    /// Batches, `None` for messages that are stamped one by one.
    pub(crate) batches: Option<Batches>,
}

/// Messages that were stamped in batches.
pub(crate) struct Batches {
    pub(crate) count: usize,
    /// Median number of messages in a batch.
    pub(crate) size: f64,
    /// Median step in a batch.
    pub(crate) inner_s: f64,
    /// Median step between two batches.
    pub(crate) pause_s: f64,
}

impl Spacing {
    /// Spacing of stamps in any order; `nominal_hz` is the rate in the rig.
    pub(crate) fn of(stamps_ns: impl IntoIterator<Item = i64>, nominal_hz: Option<f64>) -> Self {
        let mut stamps_ns: Vec<i64> = stamps_ns.into_iter().collect();
        stamps_ns.sort_unstable();
        stamps_ns.dedup();
        let steps_s: Vec<f64> = stamps_ns.windows(2).map(|pair| seconds_from_ns(pair[1] - pair[0])).collect();
        let mean_s = steps_s.iter().sum::<f64>() / steps_s.len().max(1) as f64;
        let batches = Batches::of(&steps_s, mean_s, nominal_hz.filter(|rate| *rate > 0.0));
        let period_s = if batches.is_some() { mean_s } else { median(&steps_s) };
        Self { stamps_ns, steps_s, period_s, batches }
    }

    /// Stamp before a step, in seconds since the log began.
    pub(crate) fn start_s(&self, step: usize) -> f64 {
        seconds_from_ns(self.stamps_ns[step])
    }

    /// Longest step without a missing message, in seconds; `of_images` for the topic of a camera.
    pub(crate) fn longest_s(&self, of_images: bool) -> f64 {
        let tolerance = if of_images { IMAGE_GAP } else { SAMPLE_GAP };
        tolerance * self.batches.as_ref().map_or(self.period_s, |batches| batches.pause_s.max(self.period_s))
    }
}

impl Batches {
    /// Batches among steps of a mean length. A topic that loses messages has steps of its period or multiples of it;
    /// without a nominal rate it is told from batches by their size, which is constant.
    fn of(steps_s: &[f64], mean_s: f64, nominal_hz: Option<f64>) -> Option<Self> {
        let share = |is: &dyn Fn(f64) -> bool| {
            steps_s.iter().filter(|step| is(**step)).count() as f64 / steps_s.len().max(1) as f64
        };
        if share(&|step| step < SHORT_RATIO * mean_s) < MIN_SHORT
            || share(&|step| step > LONG_RATIO * mean_s) < MIN_LONG
        {
            return None;
        }
        let (inner, pauses): (Vec<f64>, Vec<f64>) = steps_s.iter().partition(|step| **step < mean_s);
        let sizes: Vec<f64> = steps_s.split(|step| *step >= mean_s).map(|batch| batch.len() as f64 + 1.0).collect();
        // The first and the last batch may be cut.
        let whole = sizes.get(1..sizes.len() - 1).filter(|whole| !whole.is_empty()).unwrap_or(&sizes);
        let inner_s = median(&inner);
        let quantile = |fraction: f64| geometry::quantile(whole, fraction).unwrap_or(0.0);
        let in_batches = match nominal_hz {
            Some(rate_hz) => (inner_s * rate_hz - 1.0).abs() > PERIOD_TOLERANCE,
            None => quantile(0.9) - quantile(0.1) <= 1.0,
        };
        let (count, size, pause_s) = (sizes.len(), median(whole), median(&pauses));
        in_batches.then_some(Self { count, size, inner_s, pause_s })
    }
}

/// Median; 0 without values.
fn median(values: &[f64]) -> f64 {
    geometry::median(values.iter().copied()).unwrap_or(0.0)
}
