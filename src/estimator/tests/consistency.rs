//! Start and end of the warnings about inconsistent residuals.

use super::fixture;
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::factors::FactorKind;
use crate::estimator::report::ResidualSummary;
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::estimator::window::consistency::ConsistencyMonitor;
use crate::gimbal::Parameterization;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

fn encoder(mean_square: f64) -> [ResidualSummary; 1] {
    [ResidualSummary { factor: FactorKind::Encoder, count: 33, chi2_before: 900.0, chi2_after: 33.0 * mean_square }]
}

fn config() -> EstimatorConfig {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 1.0, ..SyntheticOptions::default() });
    fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default())
}

/// Indices of the steps, at 20 Hz, that give a warning; asserts that all give the same one.
fn reported(mean_squares: impl IntoIterator<Item = f64>) -> Vec<usize> {
    let config = config();
    let mut watch = ConsistencyMonitor::default();
    let (mut reported, mut first) = (Vec::new(), None);
    for (step, value) in mean_squares.into_iter().enumerate() {
        let warnings =
            watch.observe(step as i64 * 50_000_000, (&encoder(value), &GimbalImuNoise::OF_RIG), &config, Vec::new);
        if let [warning] = warnings.as_slice() {
            let text = warning.to_string();
            assert!(text.starts_with("Encoder readings inconsistent"), "{text}");
            assert!(text.contains("> 1.60 over 4 s") && text.ends_with("which compares the causes"), "{text}");
            assert_eq!(*first.get_or_insert_with(|| warning.clone()), *warning, "one message per inconsistency");
            reported.push(step);
        }
    }
    reported
}

#[test]
fn consistent_residuals_give_no_warning() {
    assert_eq!(reported((0..400).map(|step| if step % 2 == 0 { 0.6 } else { 1.8 })), [0_usize; 0]);
}

#[test]
fn a_short_residual_peak_gives_no_warning() {
    assert_eq!(reported((0..400).map(|step| if (200..206).contains(&step) { 6.0 } else { 0.9 })), [0_usize; 0]);
}

#[test]
fn inconsistent_residuals_warn_after_four_seconds_until_they_end() {
    let steps = reported((0..400).map(|step| if step < 200 { 3.0 } else { 0.9 }));
    assert_eq!(steps.first(), Some(&80));
    assert_eq!(steps.len(), steps.last().unwrap() - 79, "without a pause");
    // The mean falls from 3 towards 0.9 with a time constant of four seconds: below 0.8 of 1.6 after about 135 steps.
    assert!((330..340).contains(steps.last().unwrap()), "{:?}", steps.last());
}

#[test]
fn an_inconsistency_without_a_suspect_names_no_cause() {
    let mut watch = ConsistencyMonitor::default();
    let config = config();
    let warning = (0..100).find_map(|step| {
        watch.observe(step * 50_000_000, (&encoder(5.0), &GimbalImuNoise::OF_RIG), &config, Vec::new).pop()
    });
    let cause = warning.unwrap().cause;
    assert!(cause.starts_with("cause unknown") && !cause.contains("try "), "{cause}");
}
