//! Bound on the processor time of a diagnosis, by what its trials compute, so that the result does not depend on the machine.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::estimator::StepReport;

/// Processor time of a solver iteration per observation, in seconds: 2.6 to 3.3 µs on flights of 320×240 and 640×480.
const ITERATION_S: f64 = 3e-6;
/// Processor time of a step without a window per tracked feature, in seconds: about 1 ms for 80 features where a window is
/// soon to follow, because most attempts end at their first checks, and 5 to 25 ms after a window was lost, or where none comes.
const WAITING_S: f64 = 2e-5;
const ATTEMPT_S: f64 = 1.2e-4;

/// Processor time that trials may use, and have used.
#[derive(Debug)]
pub(super) struct TrialBudget {
    limit_s: f64,
    used_ns: AtomicU64,
}

impl TrialBudget {
    pub(super) fn new(limit_s: f64) -> Self {
        Self { limit_s, used_ns: AtomicU64::new(0) }
    }

    /// Counts a step with a number of features in its image; `is_early` is true before a first window that is to follow. The
    /// order of the steps does not matter.
    pub(super) fn count(&self, report: &StepReport, features: usize, is_early: bool) {
        let time_s = if report.window.is_empty() {
            features as f64 * if is_early { WAITING_S } else { ATTEMPT_S }
        } else {
            let observations: usize = report.features.iter().map(|feature| feature.observations.len()).sum();
            ITERATION_S * (observations * report.iterations.len().max(1)) as f64
        };
        self.used_ns.fetch_add((time_s * 1e9) as u64, Ordering::Relaxed);
    }

    /// True if a ratio of the time has been used.
    pub(super) fn is_used(&self, ratio: f64) -> bool {
        self.used_s() >= ratio * self.limit_s
    }

    pub(super) fn used_s(&self) -> f64 {
        self.used_ns.load(Ordering::Relaxed) as f64 * 1e-9
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::session::engine::{RunEngine, estimator_config, input_of};
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    #[test]
    fn steps_with_and_without_a_window_use_time() {
        let flight = synthetic_tracks(&SyntheticOptions { duration_s: 4.0, ..SyntheticOptions::default() });
        let config = estimator_config(&flight.given_rig, &"auto:window=5".parse().unwrap()).unwrap();
        let mut engine = RunEngine::new(config, None);
        let (budget, of_attempts) = (TrialBudget::new(1.0), TrialBudget::new(1.0));
        let mut before_window_s = 0.0;
        for frame in &flight.frames {
            let input = Arc::new(input_of(frame, None));
            let report = engine.report_without_rank(&input);
            let features = input.main_tracks().features.len();
            budget.count(&report, features, true);
            of_attempts.count(&report, features, false);
            if report.window.is_empty() {
                before_window_s = budget.used_s();
            }
        }
        assert!(before_window_s > 0.0 && budget.used_s() > 1.5 * before_window_s, "{before_window_s} {budget:?}");
        let expected_s = before_window_s * (ATTEMPT_S / WAITING_S - 1.0);
        assert!((of_attempts.used_s() - budget.used_s() - expected_s).abs() < 1e-6, "{of_attempts:?} {budget:?}");
        assert!(budget.is_used(0.5 * budget.used_s()) && !budget.is_used(2.0 * budget.used_s()));
    }
}
