//! Times of samples in payloads of about a second, which have a time per payload but none per sample.

use crate::geometry::seconds_from_ns;

/// Largest residual of a line through the payloads of a sensor with constant rate.
const MAX_RESIDUAL_NS: f64 = 25e6;
/// Smallest number of payloads for a line; the first one does not count, because sensors start later than the video.
const MIN_PAYLOADS: usize = 4;

/// Payload with samples of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    /// Number of samples before the payload.
    pub(super) before: usize,
    pub(super) start_ns: i64,
    pub(super) end_ns: i64,
}

/// Times of `count` samples in nanoseconds, and true if they have a constant rate.
///
/// A line through the starts of the payloads gives the times of a constant rate; if it does not fit, the samples of a
/// payload are spread evenly over it.
pub(super) fn sample_times_ns(marks: &[Mark], count: usize) -> (Vec<i64>, bool) {
    if let Some(line) = line(marks) {
        return (
            (0..count).map(|index| (line.offset_ns + line.period_ns * index as f64).round() as i64).collect(),
            true,
        );
    }
    let mut times_ns = Vec::with_capacity(count);
    for (number, mark) in marks.iter().enumerate() {
        let behind = marks.get(number + 1).map_or(count, |next| next.before);
        let samples = behind.saturating_sub(mark.before);
        let duration_ns = mark.end_ns.saturating_sub(mark.start_ns);
        times_ns.extend((0..samples).map(|index| {
            mark.start_ns.saturating_add((duration_ns as f64 * index as f64 / samples as f64).round() as i64)
        }));
    }
    (times_ns, false)
}

struct Line {
    offset_ns: f64,
    period_ns: f64,
}

/// Least-squares line through the starts of the payloads without the first, `None` if it does not fit.
fn line(marks: &[Mark]) -> Option<Line> {
    let marks = marks.get(1..)?;
    if marks.len() < MIN_PAYLOADS {
        return None;
    }
    let count = marks.len() as f64;
    let mean_index = marks.iter().map(|mark| mark.before as f64).sum::<f64>() / count;
    let mean_ns = marks.iter().map(|mark| mark.start_ns as f64).sum::<f64>() / count;
    let (mut covariance, mut variance) = (0.0, 0.0);
    for mark in marks {
        let index = mark.before as f64 - mean_index;
        covariance += index * (mark.start_ns as f64 - mean_ns);
        variance += index * index;
    }
    let period_ns = covariance / variance;
    let offset_ns = mean_ns - period_ns * mean_index;
    let fits =
        |mark: &Mark| (offset_ns + period_ns * mark.before as f64 - mark.start_ns as f64).abs() < MAX_RESIDUAL_NS;
    (period_ns > 0.0 && seconds_from_ns(period_ns as i64) < 1.0 && marks.iter().all(fits))
        .then_some(Line { offset_ns, period_ns })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(before: usize, start_ms: i64) -> Mark {
        Mark { before, start_ns: start_ms * 1_000_000, end_ns: (start_ms + 1000) * 1_000_000 }
    }

    #[test]
    fn constant_rates_have_even_times() {
        // 200 Hz from 20 ms on; the payloads' boundaries deviate by up to one sample.
        let marks = [mark(0, 0), mark(196, 1000), mark(397, 2000), mark(596, 3000), mark(796, 4000), mark(996, 5000)];
        let (times_ns, constant) = sample_times_ns(&marks, 1196);
        assert!(constant && times_ns.len() == 1196);
        let steps: Vec<i64> = times_ns.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(steps.iter().all(|step| (step - 5_000_000).abs() < 20_000), "{:?}", &steps[..3]);
        assert!((times_ns[0] - 20_000_000).abs() < 4_000_000, "{}", times_ns[0]);
    }

    #[test]
    fn samples_of_other_rates_are_spread_over_their_payload() {
        let marks = [mark(0, 0), mark(10, 1000), mark(12, 2000), mark(20, 3000), mark(21, 4000), mark(40, 5000)];
        let (times_ns, constant) = sample_times_ns(&marks, 41);
        assert!(!constant && times_ns.len() == 41);
        assert_eq!(times_ns[9..13], [900_000_000, 1_000_000_000, 1_500_000_000, 2_000_000_000]);
        assert_eq!(sample_times_ns(&[], 0), (Vec::new(), false));
        let equal = [mark(5, 0); 8];
        assert_eq!(sample_times_ns(&equal, 5).0.len(), 0);
    }
}
