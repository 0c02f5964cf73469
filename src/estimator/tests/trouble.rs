//! Flights with faults: missing encoders and images, a saturated IMU.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::fixture::{self, TestWindow};
use super::flight::{chain_error, run_flight, step, trajectory_error_m};
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::estimator::PhaseState;
use crate::estimator::report::{EventKind, StepReport};
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::{Estimator, Phase};
use crate::frontend::FeatureId;
use crate::geometry::wrap_angle;
use crate::gimbal::{Chain, Parameterization, transport_covariance};
use crate::optimization::Cholesky;
use crate::sensors::ImuSample;
use crate::simulation::{
    Experiment, SyntheticFlight, SyntheticFrame, SyntheticMount, SyntheticOptions, synthetic_tracks,
};

fn options(mount: SyntheticMount, seed: u64) -> SyntheticOptions {
    SyntheticOptions {
        mount,
        seed,
        duration_s: 14.0,
        pixel_sigma_px: 0.5,
        outlier_ratio: 0.02,
        features: 100,
        ..SyntheticOptions::default()
    }
}

fn config(flight: &SyntheticFlight) -> EstimatorConfig {
    fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default())
}

fn kinds(reports: &[StepReport]) -> Vec<EventKind> {
    reports.iter().flat_map(|report| report.events.iter().map(|event| event.kind)).collect()
}

/// Gives a frame new feature ids, as after an image that no track survives.
fn renamed(frame: &mut SyntheticFrame) {
    for feature in &mut frame.tracks.features {
        feature.id = FeatureId(feature.id.0 + 1_000_000);
    }
}

#[test]
fn without_encoders_the_trajectory_is_tracked_and_the_calibration_stays_uncertain() {
    for seed in [5, 6, 8] {
        let flight =
            synthetic_tracks(&SyntheticOptions { encoder_sigma_rad: None, ..options(SyntheticMount::Gimbal, seed) });
        let config = EstimatorConfig { use_encoder: false, ..config(&flight) };
        let before = chain_error(&flight, &Estimator::new(config.clone()));
        let (estimator, reports) = run_flight(&flight.frames, config);
        assert_eq!(estimator.restarts, 0, "seed {seed}");
        let (error, length) = trajectory_error_m(&flight.frames, &reports);
        assert!(error < 0.01 * length, "seed {seed}: {error} m over {length} m");
        let last = &reports.last().unwrap().calibration;
        // 18 columns minus three offsets, which free joint angles absorb.
        assert_eq!(last.parameters.len(), 15);
        let learnt: Vec<f64> =
            last.sigmas.iter().zip(&last.prior_sigmas).map(|(after, before)| after / before).collect();
        assert!(learnt.iter().all(|ratio| *ratio > 0.05 && *ratio < 1.01), "seed {seed}: {learnt:?}");
        let after = chain_error(&flight, &estimator);
        assert!(after.1 < 1.5 * before.1, "seed {seed}: {before:?} to {after:?}");
        for report in &reports {
            let Some(newest) = report.newest() else { continue };
            assert!(newest.encoder_angles_rad.is_none());
            assert!(newest.joint_angles_rad.iter().all(|angle| angle.is_finite()));
        }
    }
}

/// Late or interrupted joint angles are no failure.
#[test]
fn late_and_interrupted_encoder_readings_are_handled() {
    let flight = synthetic_tracks(&options(SyntheticMount::Gimbal, 5));
    let mut frames = flight.frames.clone();
    for frame in &mut frames {
        if frame.index < 120 || (180..200).contains(&frame.index) {
            frame.joint_angles_rad = None;
        }
    }
    let (estimator, reports) = run_flight(&frames, config(&flight));
    assert_eq!(estimator.restarts, 0);
    let (error, length) = trajectory_error_m(&frames, &reports);
    assert!(error < 0.006 * length, "{error} m over {length} m");
}

#[test]
fn three_seconds_without_images_are_bridged() {
    for mount in [SyntheticMount::Gimbal, SyntheticMount::Static] {
        let flight = synthetic_tracks(&options(mount, 5));
        let mut frames: Vec<SyntheticFrame> = Vec::new();
        let mut waiting: Vec<ImuSample> = Vec::new();
        for frame in &flight.frames {
            let mut frame = frame.clone();
            if (160..220).contains(&frame.index) {
                waiting.extend(&frame.imu);
                continue;
            }
            if frame.index >= 220 {
                renamed(&mut frame);
            }
            waiting.append(&mut frame.imu);
            frame.imu = std::mem::take(&mut waiting);
            frames.push(frame);
        }
        let (estimator, reports) = run_flight(&frames, config(&flight));
        let last = reports.last().unwrap();
        assert_eq!(last.phase, Phase::Tracking, "{mount:?}: {:?}", last.events);
        // Three seconds of IMU-only propagation: centimetres to decimetres.
        let (error, length) = trajectory_error_m(&frames, &reports);
        assert!(error < 0.3, "{mount:?}: {error} m over {length} m, {} restarts", estimator.restarts);
    }
}

/// Frames of a flight with a period without features and new features after it.
fn blinded(flight: &SyntheticFlight, blind: std::ops::Range<usize>) -> Vec<SyntheticFrame> {
    let mut frames = flight.frames.clone();
    for frame in &mut frames {
        if blind.contains(&frame.index) {
            frame.tracks.features.clear();
        }
        if frame.index >= blind.end {
            renamed(frame);
        }
    }
    frames
}

#[test]
fn three_seconds_without_texture_are_bridged() {
    for mount in [SyntheticMount::Gimbal, SyntheticMount::Static] {
        let flight = synthetic_tracks(&options(mount, 5));
        let frames = blinded(&flight, 160..220);
        let (estimator, reports) = run_flight(&frames, config(&flight));
        assert_eq!(estimator.restarts, 0, "{mount:?}");
        let reported =
            |report: &StepReport| report.events.iter().any(|event| event.message.contains("IMU-only propagation"));
        assert!(
            reported(&reports[160]) && !reports[161..220].iter().any(reported),
            "{mount:?}: {:?}",
            reports[160].events
        );
        let (error, length) = trajectory_error_m(&frames, &reports);
        assert!(error < 0.3, "{mount:?}: {error} m over {length} m");
    }
}

#[test]
fn a_long_visual_outage_leads_to_a_successful_restart() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 23.0, ..options(SyntheticMount::Gimbal, 5) });
    let frames = blinded(&flight, 160..280);
    let (estimator, reports) = run_flight(&frames, config(&flight));
    let failed =
        reports.iter().position(|report| kinds(std::slice::from_ref(report)).contains(&EventKind::Failure)).unwrap();
    let event = reports[failed].events.iter().find(|event| event.kind == EventKind::Failure).unwrap();
    assert!((260..280).contains(&failed), "failed at {failed}");
    assert!(event.value.unwrap() > event.threshold.unwrap(), "{event:?}");
    assert_eq!(estimator.restarts, 1);
    let again = failed + reports[failed..].iter().position(|report| report.phase == Phase::Tracking).unwrap();
    assert!(again < 370, "tracking again at {again}");
    // Each part alone is as accurate as a normal flight.
    for range in [0..failed, again..frames.len()] {
        let (error, length) = trajectory_error_m(&frames[range.clone()], &reports[range]);
        assert!(error < 0.006 * length, "{error} m over {length} m");
    }
    // The second part starts near the end of the first one.
    let place = |index: usize| reports[index].newest().unwrap().world_from_imu.translation_m;
    assert!((place(again) - place(failed - 1)).norm() < 25.0);
}

#[test]
fn a_saturated_imu_does_not_corrupt_the_window() {
    for mount in [SyntheticMount::Gimbal, SyntheticMount::Static] {
        let flight = synthetic_tracks(&options(mount, 5));
        let mut frames = flight.frames.clone();
        let limit = |value: f64, most: f64| value.clamp(-most, most);
        let mut clipped = 0;
        for sample in frames.iter_mut().filter(|frame| frame.index >= 150).flat_map(|frame| &mut frame.imu) {
            let before = *sample;
            sample.angular_velocity_rad_per_s = sample.angular_velocity_rad_per_s.map(|rate| limit(rate, 1.0));
            sample.specific_force_m_per_s2 = sample.specific_force_m_per_s2.map(|force| limit(force, 13.0));
            clipped += usize::from(before != *sample);
        }
        let (estimator, reports) = run_flight(&frames, config(&flight));
        let last = reports.last().unwrap();
        assert_eq!(last.phase, Phase::Tracking);
        let (error, length) = trajectory_error_m(&frames, &reports);
        let restarts = estimator.restarts;
        assert!(
            error < 0.02 * length,
            "{mount:?}: {error} m over {length} m, {clipped} samples clipped, {restarts} restarts"
        );
        let reported = reports[150..].iter().flat_map(|report| &report.events);
        assert!(reported.filter(|event| event.message.contains("saturated")).count() > 0);
    }
}

/// Covariance of the calibration at the current estimate, everything else marginalized.
fn calibration_covariance(estimator: &Estimator) -> DMatrix<f64> {
    let window = TestWindow::of(estimator);
    let active = window.active_tracks();
    let problem = window.problem(&active);
    let estimate = window.estimate(&active);
    let equations = problem.linearize(&estimate);
    let (hessian, _) = equations.reduced(&problem.layout, &equations.eliminate(0.0));
    Cholesky::new(&hessian).unwrap().trailing_covariance(problem.layout.calibration)
}

/// Switches as near a singularity: the configured parameterization stays.
fn switch(estimator: &mut Estimator, parameterization: Parameterization) {
    let PhaseState::Tracking(window) = &mut estimator.phase else { panic!("the estimator has no window") };
    window.state.switch_parameterization(parameterization);
}

/// Compares a flight with and without a switch of parameterization: the posterior is transformed, not only the values.
#[test]
fn a_switch_of_parameterization_keeps_the_window_estimate() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 9.0, ..options(SyntheticMount::Gimbal, 5) });
    let config = config(&flight);
    let mut stays = Estimator::new(config.clone());
    let half = 150;
    for frame in &flight.frames[..half] {
        step(&mut stays, frame);
    }
    assert!(TestWindow::of(&stays).window.prior.is_some() && stays.calibration().first_estimate_offset().is_some());
    let mut switches = stays.clone();
    switch(&mut switches, Parameterization::MinimalYx);
    let angles = &flight.frames[half].true_joint_angles_rad;
    let pose = |estimator: &Estimator| estimator.calibration().of(MAIN).imu_from_camera(angles);
    assert!(pose(&stays).minus(&pose(&switches)).norm() < 1e-12);

    // The posterior of the chain is the same in either parameterization.
    let chain = |estimator: &Estimator| estimator.calibration().of(MAIN).chain().clone();
    let expected = transport_covariance(&chain(&stays), &calibration_covariance(&stays), &chain(&switches));
    let found = calibration_covariance(&switches);
    for row in 0..18 {
        for column in 0..18 {
            let difference = (expected[(row, column)] - found[(row, column)]).abs();
            let scale = (expected[(row, row)] * expected[(column, column)]).sqrt();
            assert!(difference < 0.02 * scale, "{row}, {column}: {difference} of {scale}");
        }
    }

    for frame in &flight.frames[half..] {
        let (one, other) = (step(&mut stays, frame), step(&mut switches, frame));
        let (one, other) = (one.newest().unwrap(), other.newest().unwrap());
        let apart = one.world_from_imu.minus(&other.world_from_imu).norm();
        assert!(apart < 2e-3, "image {}: {apart}", frame.index);
        assert!(one.imu_from_camera.minus(&other.imu_from_camera).norm() < 1e-3);
    }
}

#[test]
fn a_parameterization_near_its_singularity_is_switched_once() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 8.0, ..options(SyntheticMount::Gimbal, 5) });
    let config = EstimatorConfig { auto_parameterize: true, ..config(&flight) };
    let mut estimator = Estimator::new(config);
    let mut switched = 0;
    for frame in &flight.frames {
        if frame.index == 130 {
            assert_eq!(estimator.phase(), Phase::Tracking);
            // Imitates a mechanism near the singularity: the swapped end block is singular on this gimbal.
            switch(&mut estimator, Parameterization::MinimalSwapped);
        }
        let report = step(&mut estimator, frame);
        for event in report.events.iter().filter(|event| event.kind == EventKind::ParameterizationSwitched) {
            switched += 1;
            assert_eq!(frame.index, 130);
            assert!(event.value.unwrap() < event.threshold.unwrap());
        }
    }
    assert_eq!(switched, 1);
    assert_eq!(estimator.calibration().of(MAIN).chain().parameterization(), Parameterization::Minimal);
    assert_eq!(estimator.restarts, 0);
}

/// Flight with the paper's T4 conditions: chain errors of up to 3 cm and 10°, encoder noise of 7°.
fn far_off(seed: u64, duration_s: f64) -> SyntheticFlight {
    synthetic_tracks(&SyntheticOptions {
        start_error: Experiment::T4.start_error(),
        encoder_sigma_rad: Some(Experiment::T4.encoder_sigma_rad()),
        duration_s,
        ..options(SyntheticMount::Gimbal, seed)
    })
}

/// With a poor initial chain, derivatives at poor first estimates and an early prior would prevent convergence.
#[test]
fn the_window_converges_from_poor_initial_values() {
    let errors_m = |options: EstimatorOptions| -> Vec<f64> {
        (1_u64..=3)
            .into_par_iter()
            .map(|seed| {
                let flight = far_off(seed, 12.0);
                let config = fixture::config(&flight.given_rig, Parameterization::Minimal, options);
                let (_, reports) = run_flight(&flight.frames, config);
                trajectory_error_m(&flight.frames, &reports).0
            })
            .collect()
    };
    let standard = EstimatorOptions::default();
    let held = EstimatorOptions {
        first_estimate_reach_rad: f64::INFINITY,
        first_window_factor: 1,
        inaccurate_first_window_factor: 1,
        ..standard
    };
    let (ours, theirs) = (errors_m(standard), errors_m(held));
    let product = |errors: &[f64]| errors.iter().product::<f64>();
    // The cube root of the product is the geometric mean of the three ratios.
    assert!((product(&ours) / product(&theirs)).cbrt() < 0.75, "{ours:?} against {theirs:?}");
}

/// Derivatives of some joint angles at first estimates and of others at current ones would together observe directions
/// that no measurement observes.
#[test]
fn sigma_covers_the_errors_of_a_chain_that_was_far_off() {
    let mean_square = |seed: u64| {
        let flight = far_off(seed, 15.0);
        let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
        let (_, reports) = run_flight(&flight.frames, config);
        let truth = flight.true_rig.chain_of_camera("cam0").unwrap();
        let truth = Chain::from_classical(&truth, Parameterization::Minimal);
        let found = &reports.last().unwrap().calibration;
        let errors = (DVector::from_column_slice(&found.values) - truth.values()).map(wrap_angle);
        errors.component_div(&DVector::from_column_slice(&found.sigmas)).norm_squared() / truth.dof() as f64
    };
    let mean_squares: Vec<f64> = (1_u64..=3).into_par_iter().map(mean_square).collect();
    let rms = (mean_squares.iter().sum::<f64>() / mean_squares.len() as f64).sqrt();
    assert!((0.6..1.3).contains(&rms), "{rms}: {mean_squares:?}");
}
