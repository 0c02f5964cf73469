//! Complete synthetic flights against their ground truth.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::LazyLock;

use nalgebra::{UnitQuaternion, Vector3};

use super::fixture::{Flight, flight, true_states};
use crate::calibration::{
    CalibrationError, CalibrationInput, CalibrationOptions, CalibrationOutcome, ChainDistance, EarlierFlights,
    Statistics, TrackedView, calibrate, transform_distance,
};
use crate::geometry::{Dimension, RigidTransform, seconds_from_ns, vertical_angle, wrap_angle};
use crate::gimbal::{Chain, ClassicalChain, Parameterization};
use crate::sensors::ChainPrior;
use crate::simulation::SyntheticOptions;

fn options(seed: u64) -> SyntheticOptions {
    SyntheticOptions {
        seed,
        duration_s: 14.0,
        features: 60,
        pixel_sigma_px: 0.5,
        outlier_ratio: 0.02,
        encoder_sigma_rad: Some(2_f64.to_radians()),
        start_error: ChainPrior { translation_bound_m: 0.03, rotation_bound_rad: 10_f64.to_radians() },
        ..SyntheticOptions::default()
    }
}

/// Mean over the parameters of the squared error in standard deviations.
fn normalized_square(
    chain: &ClassicalChain,
    sigmas: &[f64],
    ground_truth: &ClassicalChain,
    form: Parameterization,
) -> f64 {
    let chain = Chain::from_classical(chain, form);
    let error = chain.minus(&Chain::from_classical(ground_truth, form));
    let parameters = chain.parameters();
    let square = |k: usize| {
        let is_angle = parameters[k].dimension() == Dimension::Angle;
        let error = if is_angle { wrap_angle(error[k]) } else { error[k] };
        (error / sigmas[k]).powi(2)
    };
    (0..sigmas.len()).map(square).sum::<f64>() / sigmas.len() as f64
}

/// Flights of seeds 1 to 3 with their calibrations, which have covariances of the poses.
fn calibrated_flights() -> &'static [(Flight, CalibrationOutcome)] {
    static FLIGHTS: LazyLock<Vec<(Flight, CalibrationOutcome)>> = LazyLock::new(|| {
        let asked = CalibrationOptions { pose_covariances: true, ..CalibrationOptions::default() };
        let of_seed = |seed| {
            let flight = flight(&options(seed));
            let outcome = calibrate(&flight.input, &asked, &mut |_| ControlFlow::Continue(())).unwrap();
            (flight, outcome)
        };
        (1..=3).map(of_seed).collect()
    });
    &FLIGHTS
}

#[test]
fn a_wrong_chain_is_found_within_its_sigmas() {
    let mut of_pixels = 0.0;
    for (seed, (flight, outcome)) in (1..).zip(calibrated_flights()) {
        let distance = |chain| {
            let distance = ChainDistance::over(chain, &flight.true_chain, &outcome.visited_rad).unwrap();
            (distance.translation_mean_m, distance.rotation_mean_rad)
        };
        let ((given_m, given_rad), (_, loop_rad)) =
            (distance(&outcome.given_chain), distance(&outcome.pose_loop.chain));
        let (found_m, found_rad) = distance(&outcome.chain);
        assert!(loop_rad < 0.2 * given_rad, "seed {seed}: loops leave {loop_rad} rad");
        assert!(found_rad < 0.2 * given_rad, "seed {seed}: {found_rad} rad");
        assert!(found_m < 0.5 * given_m, "seed {seed}: {found_m} of {given_m} m");
        let (shift_m, rotation_rad) = transform_distance(&outcome.extrinsics.imu_from_camera, &flight.true_extrinsics);
        assert!(shift_m < 0.005 && rotation_rad < 0.002, "seed {seed}: mount {shift_m} m, {rotation_rad} rad");
        let (shift_s, sigma_s) = outcome.extrinsics.time_shift_s;
        assert!(shift_s.abs() < 4.0 * sigma_s && sigma_s < 2e-4, "seed {seed}: {shift_s} ± {sigma_s} s");
        assert!(outcome.parameters.iter().all(|parameter| parameter.sigma < parameter.prior_sigma));
        assert_eq!(outcome.rank.as_ref().map(|rank| rank.rank_structural), Some(18));

        let form = outcome.parameterization;
        let sigmas: Vec<f64> = outcome.parameters.iter().map(|parameter| parameter.sigma).collect();
        of_pixels += normalized_square(&outcome.chain, &sigmas, &flight.true_chain, form) / 3.0;
    }
    // The parameters of one flight are correlated: they count as a third of their number.
    let tolerance = 4.0 * (2.0_f64 / (3.0 * 18.0 / 3.0)).sqrt();
    assert!((of_pixels - 1.0).abs() < tolerance, "pixels: mean square of error over sigma {of_pixels}");
}

#[test]
fn the_same_flight_gives_the_same_numbers() {
    let flight = flight(&SyntheticOptions { duration_s: 10.0, ..options(4) });
    let once = || calibrate(&flight.input, &CalibrationOptions::default(), &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(once(), once());
}

#[test]
fn an_unusable_flight_is_refused_with_the_reason() {
    let mut flight = flight(&SyntheticOptions { duration_s: 8.0, ..options(5) });
    let options = CalibrationOptions::default();
    let more = CalibrationOptions { min_measurements: 1000, ..options };
    let error = calibrate(&flight.input, &more, &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(error, CalibrationError::TooFewMeasurements { needed: 1000, .. }), "{error}");
    for view in &mut flight.input.gimbal_camera.views {
        if let Some(angles) = &mut view.joint_angles {
            angles.angles_rad = vec![0.3, 0.0, -0.2];
        }
    }
    let error = calibrate(&flight.input, &options, &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(error, CalibrationError::NoJointMotion { .. }), "{error}");
    assert!(error.to_string().contains("yaw 0.0°"), "{error}");
    flight.input.static_camera.views.truncate(20);
    let error = calibrate(&flight.input, &options, &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(error, CalibrationError::NoTrajectory { .. }), "{error}");
}

#[test]
fn a_calibration_ends_at_the_stage_in_which_it_is_interrupted() {
    let flight = flight(&SyntheticOptions { duration_s: 8.0, ..options(5) });
    let stage_at = |last: usize| {
        let mut calls = 0;
        let outcome = calibrate(&flight.input, &CalibrationOptions::default(), &mut |_| {
            calls += 1;
            if calls > last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(calls, last + 1, "no work after the interrupt");
        outcome.unwrap_err()
    };
    let images = flight.input.static_camera.views.len();
    assert_eq!(stage_at(0), CalibrationError::Interrupted { stage: "processing the static camera" });
    assert_eq!(stage_at(images), CalibrationError::Interrupted { stage: "calibrating the static camera" });
}

/// The errors of the bundle's trajectory agree with its covariances, and the poses between the adjusted ones are as
/// accurate.
#[test]
fn the_batch_trajectory_is_within_its_sigmas() {
    let mut nees = Vec::new();
    for (seed, (flight, outcome)) in (1..).zip(calibrated_flights()) {
        let stamps_ns = flight.input.static_camera.views.iter().map(|view| view.stamp_ns);
        let truths: BTreeMap<i64, RigidTransform> =
            stamps_ns.zip(true_states(flight)).map(|(stamp_ns, state)| (stamp_ns, state.world_from_imu)).collect();
        let first = &outcome.trajectory[0];
        let true_first = truths[&first.stamp_ns];
        let turn = first.world_from_imu.rotation * true_first.rotation.inverse();
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), vertical_angle(&turn));
        let moved = first.world_from_imu.translation_m - yaw * true_first.translation_m;
        let world_from_true = RigidTransform::new(yaw, moved);
        let errors = outcome.trajectory.iter().filter_map(|pose| {
            let truth = world_from_true * *truths.get(&pose.stamp_ns)?;
            Some((pose, pose.world_from_imu.minus(&truth)))
        });
        let [mut adjusted_m, mut between_m] = [Vec::new(), Vec::new()];
        for (pose, error) in errors {
            let of = if pose.covariance.is_some() { &mut adjusted_m } else { &mut between_m };
            of.push(error.fixed_rows::<3>(3).norm());
            nees.extend(pose.covariance.and_then(|covariance| covariance.nees(&error)));
        }
        let [adjusted, between] = [&adjusted_m, &between_m].map(|errors| Statistics::of(errors).unwrap());
        let sigmas: Vec<f64> =
            outcome.trajectory.iter().filter_map(|pose| Some(pose.covariance?.position_sigma_m())).collect();
        let sigma_m = Statistics::of(&sigmas).unwrap().mean;
        assert!(adjusted.mean < 2.0 * sigma_m && sigma_m < 0.05, "seed {seed}: {} m, σ {sigma_m} m", adjusted.mean);
        assert!(
            (between.mean / adjusted.mean - 1.0).abs() < 0.05,
            "seed {seed}: {} and {} m",
            between.mean,
            adjusted.mean
        );
    }
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    assert!((2.0..14.0).contains(&mean), "NEES {mean} of {} poses", nees.len());
}

/// The part of a flight's images for which `keep` holds, by their stamps in seconds.
fn part(flight: &Flight, keep: impl Fn(f64) -> bool) -> CalibrationInput {
    let mut input = flight.input.clone();
    let kept = |view: &TrackedView| keep(seconds_from_ns(view.stamp_ns));
    input.static_camera.views.retain(kept);
    input.gimbal_camera.views.retain(kept);
    input
}

fn calibrated(mut input: CalibrationInput, earlier: Option<&CalibrationOutcome>) -> CalibrationOutcome {
    input.earlier = earlier.map(|earlier| EarlierFlights {
        posterior: earlier.posterior.clone(),
        places: [Some(1), Some(0)],
        given_shifts_s: [0.0; 2],
    });
    calibrate(&input, &CalibrationOptions::default(), &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn two_flights_add_up_in_either_order() {
    let flight = flight(&SyntheticOptions { duration_s: 18.0, ..options(6) });
    let halves = [part(&flight, |time_s| time_s < 9.0), part(&flight, |time_s| time_s >= 9.0)];
    let alone = halves.clone().map(|half| calibrated(half, None));
    let [first, second] = halves;
    let both = [calibrated(second, Some(&alone[0])), calibrated(first, Some(&alone[1]))];
    let sigmas = |outcome: &CalibrationOutcome| outcome.posterior.sigmas();
    for (k, (a, b)) in sigmas(&both[0]).into_iter().zip(sigmas(&both[1])).enumerate() {
        let least = sigmas(&alone[0])[k].min(sigmas(&alone[1])[k]);
        assert!(a < 1.02 * least && b < 1.02 * least, "column {k}: {a}, {b} from {least}");
        assert!((a / b).ln().abs() < 0.25, "column {k}: {a} and {b} by the order");
    }
    let form = both[0].parameterization;
    for outcome in &both {
        assert_eq!(outcome.parameterization, form);
        let sigmas: Vec<f64> = outcome.parameters.iter().map(|parameter| parameter.sigma).collect();
        let square = normalized_square(&outcome.chain, &sigmas, &flight.true_chain, form);
        assert!(square < 4.0, "mean square of error over sigma {square}");
        // The rig stays the reference of both flights.
        let (of_both, of_one) = (&outcome.parameters, &alone[0].parameters);
        for (one, both) in of_one.iter().zip(of_both) {
            assert!((one.prior_sigma / both.prior_sigma - 1.0).abs() < 1e-6 && one.initial == both.initial);
        }
    }
    let chains = both.each_ref().map(|outcome| Chain::from_classical(&outcome.chain, form));
    let difference = chains[0].minus(&chains[1]);
    for (k, parameter) in both[0].parameters.iter().enumerate() {
        assert!(difference[k].abs() < 1.5 * parameter.sigma, "column {k}: {} of {}", difference[k], parameter.sigma);
    }
}
