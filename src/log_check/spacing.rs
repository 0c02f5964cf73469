//! Spacing of the stamps of a topic: its period, and batches of messages that were stamped on arrival.

use super::statistics::{median, percentile};
use super::survey::TopicSurvey;
use crate::geometry::seconds_from_ns;

/// Steps shorter and longer than these ratios of the mean step occur together only in batches.
const SHORT_RATIO: f64 = 0.3;
const LONG_RATIO: f64 = 1.5;
/// Smallest share of short steps in batches.
const MIN_SHORT: f64 = 0.25;
/// Smallest share of long steps: the largest batch has a hundred messages.
const MIN_LONG: f64 = 0.01;
/// Largest relative difference between a sensor's period and the steps of one that loses messages.
const PERIOD_TOLERANCE: f64 = 0.2;

/// Stamps of a topic in their order, whatever the order of the messages.
pub(super) struct Spacing {
    /// Different stamps, ascending, in nanoseconds since the log began.
    stamps_ns: Vec<i64>,
    /// Differences of consecutive stamps in seconds.
    pub(super) steps_s: Vec<f64>,
    /// Time between two measurements: the median step, that by first stamp, last stamp and count for batches; 0 without
    /// steps.
    pub(super) period_s: f64,
    /// Batches, `None` for messages that are stamped one by one.
    pub(super) batches: Option<Batches>,
}

/// Messages that were stamped in batches.
pub(super) struct Batches {
    pub(super) count: usize,
    /// Median number of messages in a batch.
    pub(super) size: f64,
    /// Median step in a batch.
    pub(super) inner_s: f64,
    /// Median step between two batches.
    pub(super) pause_s: f64,
}

impl Spacing {
    pub(super) fn of(topic: &TopicSurvey, nominal_hz: Option<f64>) -> Self {
        let mut stamps_ns: Vec<i64> = topic.times.iter().map(|times| times.stamp_ns).collect();
        stamps_ns.sort_unstable();
        stamps_ns.dedup();
        let steps_s: Vec<f64> = stamps_ns.windows(2).map(|pair| seconds_from_ns(pair[1] - pair[0])).collect();
        let mean_s = steps_s.iter().sum::<f64>() / steps_s.len().max(1) as f64;
        let batches = Batches::of(&steps_s, mean_s, nominal_hz.filter(|rate| *rate > 0.0));
        let period_s = if batches.is_some() { mean_s } else { median(&steps_s) };
        Self { stamps_ns, steps_s, period_s, batches }
    }

    /// Stamp before a step, in seconds since the log began.
    pub(super) fn start_s(&self, step: usize) -> f64 {
        seconds_from_ns(self.stamps_ns[step])
    }

    /// Longest step without a missing message, in seconds; `tolerance` is a ratio of the usual step.
    pub(super) fn longest_s(&self, tolerance: f64) -> f64 {
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
        let in_batches = match nominal_hz {
            Some(rate_hz) => (inner_s * rate_hz - 1.0).abs() > PERIOD_TOLERANCE,
            None => percentile(whole, 0.9) - percentile(whole, 0.1) <= 1.0,
        };
        let (count, size, pause_s) = (sizes.len(), median(whole), median(&pauses));
        in_batches.then_some(Self { count, size, inner_s, pause_s })
    }
}
