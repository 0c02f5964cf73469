//! Sensors whose messages hold the last value: they are sent faster than the sensor measures, so that their stamps are late
//! by up to the time between two measurements.

use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Severity};

/// Smallest part of the messages of an interval that repeat the value before.
const MIN_REPEATED: f64 = 0.2;
/// Part of the runs of equal values whose lengths differ from their mean by at most one message: a coarse sensor repeats
/// values irregularly.
const REGULAR_RATIO: f64 = 0.9;
/// Minimum number of runs.
const MIN_RUNS: usize = 20;
/// Part of the log at an end that an interval of held values need not cover to hold in the whole log.
const END_RATIO: f64 = 0.05;
/// Longest time between two measurements whose late stamps are compared with other sensors, in seconds.
const COMPARED_S: f64 = 0.02;

/// Values that are held in an interval of the log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Held {
    /// Rate of new values and of messages, in Hz.
    new_hz: f64,
    message_hz: f64,
    /// Part of the messages that repeat the value before.
    repeated: f64,
    /// Seconds since the log began; `None` for the start and the end of the log.
    since_s: Option<f64>,
    until_s: Option<f64>,
}

impl Held {
    /// Held values among values with their stamps in nanoseconds, ordered by stamp; `None` if they change as they should, or
    /// repeat irregularly.
    pub(crate) fn of<T: PartialEq>(values: &[(i64, T)]) -> Option<Self> {
        let runs: Vec<&[(i64, T)]> = values.chunk_by(|one, other| one.1 == other.1).collect();
        let is_repeated = |run: &&[(i64, T)]| run.len() > 1;
        let (first, last) = (runs.iter().position(is_repeated)?, runs.iter().rposition(is_repeated)?);
        let inside = &runs[first..=last];
        let messages: usize = inside.iter().map(|run| run.len()).sum();
        let mean = messages as f64 / inside.len() as f64;
        let regular = inside.iter().filter(|run| (run.len() as f64 - mean).abs() <= 1.0).count();
        let repeated = (messages - inside.len()) as f64 / messages as f64;
        if inside.len() < MIN_RUNS || repeated < MIN_REPEATED || (regular as f64) < REGULAR_RATIO * inside.len() as f64
        {
            return None;
        }
        let [start_ns, end_ns] = [inside.first()?.first()?.0, inside.last()?.last()?.0];
        let [log_start_ns, log_end_ns] = [values.first()?.0, values.last()?.0];
        let tolerated_s = END_RATIO * seconds_from_ns(log_end_ns - log_start_ns);
        let beyond = |length_ns: i64| seconds_from_ns(length_ns) > tolerated_s;
        let duration_s = seconds_from_ns(end_ns - start_ns);
        Some(Self {
            new_hz: inside.len() as f64 / duration_s,
            message_hz: messages as f64 / duration_s,
            repeated,
            since_s: beyond(start_ns - log_start_ns).then(|| seconds_from_ns(start_ns)),
            until_s: beyond(log_end_ns - end_ns).then(|| seconds_from_ns(end_ns)),
        })
    }

    pub(crate) fn report(&self, area: Area, name: &str, verb: &str, findings: &mut Findings) {
        let Self { new_hz, message_hz, .. } = self;
        let title = format!("{name} {verb} values: {new_hz:.1} new ones per second in messages at {message_hz:.0} Hz");
        let evidence = format!(
            "{:.0} % of the messages have the value of the message before, regularly; values are late by up to {:.0} ms",
            100.0 * self.repeated,
            1e3 / new_hz
        );
        let remedy = "let the driver send each measurement once, with the stamp of the measurement";
        findings.add(Severity::Warning, area, title, evidence, remedy);
        findings.state_times(self.since_s, self.until_s);
    }

    /// True if the late stamps explain differences from other sensors.
    pub(crate) fn is_late(&self) -> bool {
        self.new_hz * COMPARED_S < 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of messages at 200 Hz, of which a new one comes when the number of measurements up to then changes.
    fn messages(count: i64, measured_by: impl Fn(f64) -> f64) -> Vec<(i64, i64)> {
        (0..count)
            .map(|number| (number * 5_000_000, (measured_by(number as f64 * 0.005) + 0.25).floor() as i64))
            .collect()
    }

    #[test]
    fn values_that_repeat_regularly_are_held() {
        let held = Held::of(&messages(2000, |time_s| 62.5 * time_s)).unwrap();
        assert!((held.new_hz - 62.5).abs() < 0.3 && (held.message_hz - 200.0).abs() < 1.0, "{held:?}");
        assert_eq!((held.since_s, held.until_s), (None, None));
        let later =
            Held::of(&messages(2000, |time_s| 200.0 * time_s.min(5.0) + 20.0 * (time_s - 5.0).max(0.0))).unwrap();
        assert!((later.since_s.unwrap() - 5.0).abs() < 0.06 && later.until_s.is_none(), "{later:?}");
        assert!(Held::of(&messages(2000, |time_s| 200.5 * time_s)).is_none());
        // A coarse encoder repeats its readings for as long as the joint turns slowly.
        assert!(Held::of(&messages(2000, |time_s| 60.0 * (1.3 * time_s).sin())).is_none());
    }
}
