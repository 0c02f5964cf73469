//! Packed estimators.

use super::fixture;
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::step_input::StepMeasurements;
use crate::estimator::{Estimator, Phase};
use crate::frontend::TrackedFeature;
use crate::gimbal::Parameterization;
use crate::sensors::ImuSample;
use crate::simulation::{SyntheticFlight, SyntheticFrame, SyntheticOptions, synthetic_tracks};

impl StepMeasurements for SyntheticFrame {
    fn stamp_ns(&self) -> i64 {
        self.stamp_ns
    }

    fn imu(&self) -> &[ImuSample] {
        &self.imu
    }

    fn gimbal_imu(&self) -> &[ImuSample] {
        &self.gimbal_imu
    }

    fn features(&self, _: usize) -> &[TrackedFeature] {
        &self.tracks.features
    }

    fn matched(&self, _: usize) -> &[TrackedFeature] {
        &self.tracks.matched
    }
}

/// Packs and unpacks the estimator before each step, with the `past` steps before it, and returns the size of the
/// largest packed window in bytes.
fn check(
    flight: &SyntheticFlight,
    config: &EstimatorConfig,
    past: usize,
    alter: &dyn Fn(&mut SyntheticFrame),
) -> usize {
    let mut estimator = Estimator::new(config.clone());
    let mut largest = 0;
    for (number, frame) in flight.frames.iter().enumerate() {
        let steps: Vec<&dyn StepMeasurements> =
            flight.frames[number.saturating_sub(past)..number].iter().map(|frame| frame as _).collect();
        let packed = estimator.packed(&steps);
        let unpacked = packed.unpacked(&steps);
        // Debug output has all digits.
        assert_eq!(format!("{unpacked:?}"), format!("{estimator:?}"), "step {number}");
        if estimator.phase() == Phase::Tracking {
            largest = largest.max(packed.bytes());
        }
        let mut frame = frame.clone();
        alter(&mut frame);
        fixture::step(&mut estimator, &frame, &frame.tracks, &[]);
    }
    assert_eq!(estimator.phase(), Phase::Tracking);
    largest
}

#[test]
fn an_unpacked_estimator_equals_the_packed_one() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 6.0, ..SyntheticOptions::default() });
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let bytes = check(&flight, &config, 256, &|_| {});
    // The first window is twice as large as the later ones.
    assert!((40_000..200_000).contains(&bytes), "{bytes} bytes");
    let intrinsics = EstimatorConfig { estimate_imu_intrinsics: true, ..config };
    check(&flight, &intrinsics, 256, &|_| {});
    let flight =
        synthetic_tracks(&SyntheticOptions { duration_s: 6.0, gimbal_imu: true, ..SyntheticOptions::default() });
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    check(&flight, &config, 256, &|_| {});
}

#[test]
fn measurements_that_the_past_does_not_have_are_copied() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 5.0, features: 40, ..SyntheticOptions::default() });
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let whole = check(&flight, &config, 256, &|_| {});
    // A short past, and measurements that were changed before the step.
    let short = check(&flight, &config, 5, &|_| {});
    let altered = check(&flight, &config, 256, &|frame| {
        for feature in &mut frame.tracks.features {
            feature.uv_px.x += 0.01;
        }
        for sample in frame.imu.iter_mut().skip(1) {
            sample.specific_force_m_per_s2.z += 1e-3;
        }
    });
    assert!(whole < short && short < altered, "{whole}, {short}, {altered} bytes");
}
