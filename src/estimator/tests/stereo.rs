//! A stereo pair: start without motion, scale, calibration.

use super::fixture;
use super::flight::trajectory_error_m;
use crate::estimator::config::EstimatorOptions;
use crate::estimator::report::StepReport;
use crate::estimator::{Estimator, EventKind, Phase};
use crate::geometry::{median, seconds_from_ns};
use crate::simulation::{SyntheticFlight, SyntheticMotion, SyntheticOptions};

fn options(motion: SyntheticMotion, seed: u64, duration_s: f64) -> SyntheticOptions {
    SyntheticOptions { motion, seed, duration_s, features: 80, outlier_ratio: 0.02, ..SyntheticOptions::default() }
}

/// Runs a flight of a stereo pair; with `alone`, of its first camera.
fn run(flights: &[SyntheticFlight; 2], alone: bool) -> (Estimator, Vec<StepReport>) {
    let mut config = fixture::stereo_config(flights, EstimatorOptions::default());
    if alone {
        config.further_cameras.clear();
    }
    let mut estimator = Estimator::new(config);
    let [flight, right] = flights;
    let frames = flight.frames.iter().zip(&right.frames);
    let reports = frames
        .map(|(frame, beside)| {
            let further: &[_] = if alone { &[] } else { &[&beside.tracks] };
            fixture::step(&mut estimator, frame, &frame.tracks, further)
        })
        .collect();
    (estimator, reports)
}

/// Median ratio of estimated to true distances of the landmarks of the first camera in a step.
fn scale(flight: &SyntheticFlight, report: &StepReport) -> f64 {
    let newest = report.newest().expect("a window");
    let camera_m = (newest.world_from_imu * newest.imu_from_camera).translation_m;
    let frame = flight.frames.iter().find(|frame| frame.index == newest.frame_index).expect("its frame");
    let true_camera_m = frame.true_world_from_camera.translation_m;
    let ratio = |landmark: &crate::estimator::LandmarkReport| {
        let truth_m = flight.landmarks.get(&landmark.id)?;
        Some((landmark.position_m - camera_m).norm() / (truth_m - true_camera_m).norm())
    };
    median(report.landmarks.iter().filter(|landmark| landmark.id.camera() == 0).filter_map(ratio)).expect("landmarks")
}

#[test]
fn a_pair_starts_within_half_a_second_with_and_without_motion() {
    for motion in [SyntheticMotion::StationaryThenAggressive, SyntheticMotion::Hover, SyntheticMotion::Aggressive] {
        for seed in 1..4 {
            let flights = fixture::stereo_flights(&options(motion, seed, 1.9));
            let (_, reports) = run(&flights, false);
            let first = reports.iter().find(|report| report.phase == Phase::Tracking);
            let first = first.unwrap_or_else(|| panic!("{motion:?}, seed {seed}: never initialized"));
            let started_s = seconds_from_ns(first.stamp_ns);
            let event = first.events.iter().find(|event| event.kind == EventKind::InitializedFromMotion);
            assert!(event.is_some_and(|event| event.message.contains("a stereo pair")), "{:?}", first.events);
            let errors = [first, reports.last().unwrap()].map(|report| scale(&flights[0], report) - 1.0);
            assert!(started_s < 0.5, "{motion:?}, seed {seed}: {started_s} s");
            assert!(errors.iter().all(|error| error.abs() < 0.1), "{motion:?}, seed {seed}: {errors:?}");
            if motion != SyntheticMotion::Aggressive {
                let (_, alone) = run(&flights, true);
                assert!(alone.iter().all(|report| report.phase == Phase::Initializing), "{motion:?}: one camera waits");
            }
        }
    }
}

#[test]
fn a_pair_is_more_accurate_than_its_first_camera_and_its_calibration_consistent() {
    let (mut ratios, mut squares, mut count) = (Vec::new(), 0.0, 0);
    for seed in 1..6 {
        let flights = fixture::stereo_flights(&options(SyntheticMotion::HoverThenAggressive, seed, 14.0));
        let (_, alone) = run(&flights, true);
        let (_, reports) = run(&flights, false);
        let error_m = |reports: &[StepReport]| trajectory_error_m(&flights[0].frames, reports).0;
        ratios.push(error_m(&reports) / error_m(&alone));
        let calibration = &reports.last().unwrap().calibration;
        let [right] = calibration.further_cameras.as_slice() else { panic!("one further camera") };
        let truth = flights[1].true_rig.base_from_camera(Some("cam0"), "cam1").unwrap();
        let error = right.base_from_camera.minus(&truth);
        let columns = calibration.parameters.len() - 6..calibration.parameters.len();
        for (error, sigma) in error.iter().zip(&calibration.sigmas[columns]) {
            squares += (error / sigma).powi(2);
            count += 1;
        }
    }
    let mean = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
    let normalized = (squares / f64::from(count)).sqrt();
    assert!(mean < 0.9, "{ratios:?}");
    assert!(normalized < 1.6, "{normalized}");
}
