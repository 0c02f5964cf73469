//! Complete attempts on synthetic flights.

use nalgebra::Vector3;

use super::flight::{FOCAL_PX, Flight, FlightOptions, GRAVITY, Motion, noise, simulate_flight};
use crate::estimator::initialization::bearing::angle_between;
use crate::estimator::initialization::{
    InitializationFrame, InitializationInput, InitializationOptions, InitializationOrigin, InitializationOutcome,
    InitializationSolution, StationaryEstimate, StationaryPolicy, WaitReason, try_initialize,
};
use crate::sensors::ChainPrior;

fn options_for(flight: &FlightOptions) -> InitializationOptions {
    let options = InitializationOptions::default().for_camera(FOCAL_PX, 1.0);
    if flight.gimbal {
        let prior = ChainPrior {
            translation_bound_m: flight.chain_translation_bound_m,
            rotation_bound_rad: flight.chain_rotation_bound_rad,
        };
        options.for_gimbal(&prior, 3, flight.encoders.then_some(flight.encoder_sigma_rad))
    } else {
        options.for_rigid_camera(
            (flight.chain_rotation_bound_rad * 1.2).max(0.003),
            (flight.chain_translation_bound_m * 1.2).max(0.001),
        )
    }
}

fn attempt(
    flight: &Flight,
    newest: usize,
    options: &InitializationOptions,
    stationary: Option<StationaryEstimate>,
) -> InitializationOutcome {
    let first = newest.saturating_sub((options.longest_window_s / 0.05) as usize);
    let frames: Vec<InitializationFrame<'_>> = flight.frames[first..=newest]
        .iter()
        .enumerate()
        .map(|(index, frame)| InitializationFrame {
            frame_index: first + index,
            stamp_ns: frame.stamp_ns,
            features: &frame.features,
            matched: &[],
            imu_from_camera: frame.imu_from_camera,
            imu: &frame.imu,
        })
        .collect();
    try_initialize(
        &InitializationInput {
            frames: &frames,
            gravity_m_per_s2: GRAVITY,
            imu_noise: noise(),
            stationary,
            bias: None,
            pair: None,
        },
        options,
    )
}

/// Attempts at every frame; returns the solution, or the last reasons for waiting.
fn run(flight: &Flight, options: &InitializationOptions) -> Result<(usize, InitializationSolution), Vec<WaitReason>> {
    let mut stationary = None;
    let mut last = Vec::new();
    for newest in 0..flight.frames.len() {
        match attempt(flight, newest, options, stationary) {
            InitializationOutcome::Initialized(solution) => return Ok((newest, *solution)),
            InitializationOutcome::Waiting { reasons, stationary: found, .. } => {
                stationary = found.or(stationary);
                last = reasons;
            }
        }
    }
    Err(last)
}

#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    since_motion_s: f64,
    scale: f64,
    gravity_deg: f64,
    velocity_m_per_s: f64,
    gyroscope_rad_per_s: f64,
    accelerometer_m_per_s2: f64,
    position_m: f64,
    extrinsics_deg: f64,
}

fn errors(flight: &Flight, hover_s: f64, newest: usize, solution: &InitializationSolution) -> Errors {
    let first = &flight.frames[solution.frames[0].frame_index];
    let (mut dot, mut square, mut extrinsics) = (0.0, 0.0, 0.0_f64);
    for frame in &solution.frames {
        let ground_truth = &flight.frames[frame.frame_index];
        let moved = first.true_world_from_imu.inverse().transform(&ground_truth.true_world_from_imu.translation_m);
        let estimated = solution.frames[0].world_from_imu.inverse().transform(&frame.world_from_imu.translation_m);
        dot += moved.dot(&estimated);
        square += moved.norm_squared();
        extrinsics = extrinsics
            .max((ground_truth.true_imu_from_camera.rotation.inverse() * frame.imu_from_camera.rotation).angle());
    }
    let last = solution.frames.last().unwrap();
    let ground_truth = &flight.frames[last.frame_index];
    assert_eq!(last.frame_index, newest);
    let up = last.world_from_imu.rotation.inverse() * Vector3::z();
    let true_up = ground_truth.true_world_from_imu.rotation.inverse() * Vector3::z();
    let velocity = last.world_from_imu.rotation.inverse() * last.velocity_m_per_s;
    let true_velocity = ground_truth.true_world_from_imu.rotation.inverse() * ground_truth.true_velocity;
    let moved = first.true_world_from_imu.inverse().transform(&ground_truth.true_world_from_imu.translation_m);
    let estimated = solution.frames[0].world_from_imu.inverse().transform(&last.world_from_imu.translation_m);
    Errors {
        since_motion_s: ground_truth.stamp_ns as f64 * 1e-9 - hover_s,
        scale: dot / square - 1.0,
        gravity_deg: angle_between(&up, &true_up).to_degrees(),
        velocity_m_per_s: (velocity - true_velocity).norm(),
        gyroscope_rad_per_s: (solution.bias.gyroscope_rad_per_s - flight.gyroscope_bias).norm(),
        accelerometer_m_per_s2: (solution.bias.accelerometer_m_per_s2 - flight.accelerometer_bias).norm(),
        position_m: (moved - estimated).norm(),
        extrinsics_deg: extrinsics.to_degrees(),
    }
}

/// Largest allowed errors.
struct Limits {
    since_motion_s: f64,
    scale: f64,
    gravity_deg: f64,
    velocity_m_per_s: f64,
    gyroscope_rad_per_s: f64,
}

/// Runs many seeds, prints the errors and compares them with the limits.
fn check(name: &str, seeds: u64, flight_of: impl Fn(u64) -> FlightOptions, limits: &Limits) {
    let mut all = Vec::new();
    for seed in 0..seeds {
        let flight_options = flight_of(seed);
        let flight = simulate_flight(&flight_options);
        let options = options_for(&flight_options);
        match run(&flight, &options) {
            Ok((newest, solution)) => {
                assert_eq!(solution.origin, InitializationOrigin::Motion);
                let errors = errors(&flight, flight_options.hover_s, newest, &solution);
                let d = &solution.diagnostics;
                println!(
                    "{name} {seed}: after {:.2} s, {} views, {} landmarks; scale {:+.2} % (σ {:.2}), gravity {:.2}° (σ {:.2}), velocity {:.3} m/s (σ {:.3}), \
                     bg {:.4} (σ {:.4}), ba {:.3} (σ {:.3}), position {:.3} m, mount {:.2}°, reprojection {:.2} px, imu {:.2}, {} rounds",
                    errors.since_motion_s,
                    solution.frames.len(),
                    solution.landmarks.len(),
                    100.0 * errors.scale,
                    100.0 * d.scale_sigma,
                    errors.gravity_deg,
                    d.gravity_sigma_rad.to_degrees(),
                    errors.velocity_m_per_s,
                    d.velocity_sigma_m_per_s,
                    errors.gyroscope_rad_per_s,
                    d.gyroscope_bias_sigma_rad_per_s,
                    errors.accelerometer_m_per_s2,
                    d.accelerometer_bias_sigma_m_per_s2,
                    errors.position_m,
                    errors.extrinsics_deg,
                    d.reprojection_rms_rad * FOCAL_PX,
                    d.imu_mean_square,
                    d.refinement_rounds,
                );
                all.push(errors);
            }
            Err(reasons) => panic!("{name} {seed}: not initialized: {reasons:?}"),
        }
    }
    for errors in &all {
        assert!(errors.since_motion_s < limits.since_motion_s, "{name}: {errors:?}");
        assert!(errors.scale.abs() < limits.scale, "{name}: {errors:?}");
        assert!(errors.gravity_deg < limits.gravity_deg, "{name}: {errors:?}");
        assert!(errors.velocity_m_per_s < limits.velocity_m_per_s, "{name}: {errors:?}");
        assert!(errors.gyroscope_rad_per_s < limits.gyroscope_rad_per_s, "{name}: {errors:?}");
    }
}

#[test]
fn rigid_camera_initializes() {
    // An accelerometer bias of 0.4 m/s², unobservable in hover, tilts gravity by 2.3° (1 σ) until the vehicle moves.
    let limits =
        Limits { since_motion_s: 3.5, scale: 0.1, gravity_deg: 4.5, velocity_m_per_s: 0.2, gyroscope_rad_per_s: 0.004 };
    check("rigid", 8, |seed| FlightOptions::new(seed, Motion::Flight).rigid(), &limits);
}

#[test]
fn gimbal_with_good_encoders_initializes() {
    let limits = Limits {
        since_motion_s: 3.5,
        scale: 0.1,
        gravity_deg: 4.5,
        velocity_m_per_s: 0.25,
        gyroscope_rad_per_s: 0.007,
    };
    check("gimbal", 8, |seed| FlightOptions::new(100 + seed, Motion::Flight), &limits);
}

#[test]
fn gimbal_with_poor_encoders_and_a_wrong_chain_initializes() {
    let limits = Limits {
        since_motion_s: 3.5,
        scale: 0.12,
        gravity_deg: 5.5,
        velocity_m_per_s: 0.45,
        gyroscope_rad_per_s: 0.008,
    };
    let hard = |seed| FlightOptions {
        encoder_sigma_rad: 7.0_f64.to_radians(),
        chain_rotation_bound_rad: 5.0_f64.to_radians(),
        chain_translation_bound_m: 0.015,
        ..FlightOptions::new(200 + seed, Motion::Flight)
    };
    check("hard", 8, hard, &limits);
}

#[test]
fn gimbal_without_encoders_initializes() {
    let limits = Limits {
        since_motion_s: 3.5,
        scale: 0.12,
        gravity_deg: 5.5,
        velocity_m_per_s: 0.45,
        gyroscope_rad_per_s: 0.008,
    };
    let blind = |seed| FlightOptions { encoders: false, ..FlightOptions::new(300 + seed, Motion::Flight) };
    check("blind", 6, blind, &limits);
}

#[test]
fn hover_rotation_and_constant_velocity_wait_with_reasons() {
    for (motion, tests) in [
        (Motion::Hover, &["parallax", "excitation"][..]),
        (Motion::RotationOnly, &["parallax"][..]),
        (Motion::ConstantVelocity, &["excitation"][..]),
    ] {
        let flight_options = FlightOptions { duration_s: 5.0, ..FlightOptions::new(7, motion) };
        let flight = simulate_flight(&flight_options);
        let reasons = run(&flight, &options_for(&flight_options)).unwrap_err();
        println!("{motion:?}: {reasons:#?}");
        for test in tests {
            assert!(reasons.iter().any(|reason| reason.test == *test), "{motion:?} waits for {test}: {reasons:?}");
        }
    }
}

#[test]
fn a_stationary_estimate_is_kept_or_used_at_once() {
    let flight_options = FlightOptions { duration_s: 2.0, ..FlightOptions::new(3, Motion::Stationary) };
    let flight = simulate_flight(&flight_options);
    let options = options_for(&flight_options);
    let newest = flight.frames.len() - 1;
    let InitializationOutcome::Waiting { stationary: Some(found), reasons, .. } =
        attempt(&flight, newest, &options, None)
    else {
        panic!("a stationary vehicle waits for motion");
    };
    assert!(reasons.iter().any(|reason| reason.test == "parallax"), "{reasons:?}");
    assert!((found.gyroscope_bias_rad_per_s - flight.gyroscope_bias).norm() < 1e-3);

    let at_once = InitializationOptions { stationary_policy: StationaryPolicy::InitializeAtOnce, ..options };
    let InitializationOutcome::Initialized(solution) = attempt(&flight, newest, &at_once, None) else {
        panic!("the policy initializes a stationary vehicle at once");
    };
    assert_eq!(solution.origin, InitializationOrigin::Stationary);
    let errors = errors(&flight, 0.0, newest, &solution);
    // The accelerometer bias tilts the world by up to asin(0.5·√2/9.81) = 4.1°.
    assert!(errors.gravity_deg < 4.2 && errors.velocity_m_per_s < 1e-9, "{errors:?}");
    assert!(errors.gyroscope_rad_per_s < 1e-3);
    let ground_truth = flight.frames[newest].true_world_from_imu.rotation.inverse() * Vector3::z();
    let predicted = solution.frames[0].world_from_imu.rotation.inverse() * (Vector3::z() * GRAVITY)
        + solution.bias.accelerometer_m_per_s2;
    assert!((predicted - ground_truth * GRAVITY - flight.accelerometer_bias).norm() < 0.02);
}

#[test]
fn equal_input_gives_equal_bits() {
    let flight_options = FlightOptions::new(5, Motion::Flight);
    let flight = simulate_flight(&flight_options);
    let options = options_for(&flight_options);
    let (newest, _) = run(&flight, &options).unwrap();
    let InitializationOutcome::Initialized(first) = attempt(&flight, newest, &options, None) else {
        panic!("this flight has no stationary phase");
    };
    let InitializationOutcome::Initialized(second) = attempt(&flight, newest, &options, None) else {
        panic!("the same attempt succeeds again");
    };
    assert!(first == second);
}

#[test]
fn broken_input_waits_instead_of_failing() {
    let flight_options = FlightOptions { duration_s: 4.0, ..FlightOptions::new(9, Motion::Flight) };
    let options = options_for(&flight_options);
    let newest = 80;
    let mut no_imu = simulate_flight(&flight_options);
    for frame in &mut no_imu.frames {
        frame.imu.clear();
    }
    let mut not_finite = simulate_flight(&flight_options);
    for frame in &mut not_finite.frames {
        for sample in &mut frame.imu {
            sample.specific_force_m_per_s2.x = f64::NAN;
        }
        for feature in &mut frame.features {
            feature.bearing.x = f64::NAN;
        }
    }
    let mut no_features = simulate_flight(&flight_options);
    for frame in &mut no_features.frames {
        frame.features.clear();
    }
    for flight in [no_imu, not_finite, no_features] {
        assert!(matches!(attempt(&flight, newest, &options, None), InitializationOutcome::Waiting { .. }));
    }
}
