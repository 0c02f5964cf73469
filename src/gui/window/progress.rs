//! Progress and remaining time of the estimation of all runs.

use crate::session::Recording;

/// Seconds of computation before a remaining time is shown.
const MIN_MEASURED_S: f64 = 1.5;

#[derive(Clone, Copy, Debug, Default)]
pub struct ProgressMeter {
    /// Wall clock in seconds and fraction at the first reading.
    start: Option<(f64, f64)>,
    /// Fraction at the last reading.
    last: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    pub runs: usize,
    /// Processed fraction of the log, 0 to 1.
    pub fraction: f64,
    /// Remaining seconds at the present speed.
    pub left_s: Option<f64>,
    /// Log time by which the last run is behind a log that is being written.
    pub behind_s: Option<f64>,
    /// Reason why no messages of a log come that is being received.
    pub interruption: Option<String>,
}

impl ProgressMeter {
    /// Reads a recording at a time of the wall clock; `None` when all steps are computed.
    pub fn read(&mut self, recording: &Recording, now_s: Option<f64>) -> Option<Progress> {
        let open = recording.runs.iter().filter(|run| !run.has_ended());
        let fractions: Vec<f64> = open.map(|run| run.computed_fraction(recording.duration_ns)).collect();
        if fractions.is_empty() {
            *self = Self::default();
            return None;
        }
        let fraction = fractions.iter().sum::<f64>() / fractions.len() as f64;
        // A new run reduces the fraction; the measurement restarts.
        if fraction < self.last {
            self.start = None;
        }
        self.last = fraction;
        let left_s = now_s.and_then(|now_s| {
            let (begun_s, start_fraction) = *self.start.get_or_insert((now_s, fraction));
            let (elapsed_s, done) = (now_s - begun_s, fraction - start_fraction);
            (elapsed_s >= MIN_MEASURED_S && done > 0.0).then(|| elapsed_s * (1.0 - fraction) / done)
        });
        if recording.is_being_written {
            let open = recording.runs.iter().filter(|run| !run.has_ended());
            let behind_s = open.map(|run| run.behind_s(recording.duration_ns)).max_by(f64::total_cmp);
            let interruption = recording.interruption.clone();
            return Some(Progress { runs: fractions.len(), fraction, left_s: None, behind_s, interruption });
        }
        Some(Progress { runs: fractions.len(), fraction, left_s, behind_s: None, interruption: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn the_remaining_time_follows_the_speed() {
        let mut recording = sample_recording_of(60, &["auto", "classical"]);
        let whole = recording.runs.clone();
        let mut meter = ProgressMeter::default();
        assert_eq!(meter.read(&recording, Some(0.0)), None, "all is computed");
        let mut at = |frames: usize, now_s: Option<f64>| {
            for (run, whole) in recording.runs.iter_mut().zip(&whole) {
                run.finished = false;
                run.steps = whole.steps[..frames].to_vec();
            }
            recording.duration_ns = whole[0].steps[50].report.stamp_ns;
            meter.read(&recording, now_s).unwrap()
        };
        let begun = Progress { runs: 2, fraction: 0.0, left_s: None, behind_s: None, interruption: None };
        assert_eq!(at(1, Some(10.0)), begun);
        let half = at(26, Some(20.0));
        assert!((half.fraction - 0.5).abs() < 1e-9 && (half.left_s.unwrap() - 10.0).abs() < 1e-6, "{half:?}");
        assert_eq!(at(11, Some(30.0)).left_s, None, "another run has come");
        assert_eq!(at(26, None).left_s, None, "screenshots show no times");
    }
}
