//! IMU on the gimbal: its samples against the true motion, accuracy without encoders, directions that it leaves
//! unobservable.

use std::collections::BTreeSet;

use nalgebra::{DVector, Vector3};

use super::fixture;
use super::flight::{chain_error, run_flight, trajectory_error_m};
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::factors::kind::{FactorKind, FactorLabel};
use crate::estimator::report::StepReport;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::estimator::state::preintegration::Preintegration;
use crate::geometry::{RigidTransform, seconds_from_ns, so3, wrap_angle};
use crate::gimbal::{ParameterNames, Parameterization};
use crate::sensors::ImuNoise;
use crate::simulation::{SyntheticFlight, SyntheticOptions, synthetic_tracks};

const NOISE: ImuNoise = ImuNoise {
    accelerometer_noise_density: 0.004,
    accelerometer_random_walk: 0.006,
    gyroscope_noise_density: 3e-4,
    gyroscope_random_walk: 4e-5,
};

fn options(seed: u64) -> SyntheticOptions {
    SyntheticOptions { seed, duration_s: 12.0, features: 100, gimbal_imu: true, ..SyntheticOptions::default() }
}

fn config(flight: &SyntheticFlight) -> EstimatorConfig {
    fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default())
}

/// Samples without noise integrate to the true motion of the camera and its IMU, joints and lever arm included.
#[test]
fn ideal_samples_integrate_to_the_true_motion() {
    let flight = synthetic_tracks(&SyntheticOptions { imu_noise_scale: 0.0, duration_s: 8.0, ..options(3) });
    let camera_from_imu = flight.true_rig.gimbal_imu.as_ref().unwrap().camera_from_imu;
    let pose = |frame: usize| -> RigidTransform { flight.frames[frame].true_world_from_camera * camera_from_imu };
    let gravity = crate::estimator::gravity_in_world(9.81);
    for first in (60..140).step_by(10) {
        let samples: Vec<_> =
            flight.frames[first + 1..=first + 10].iter().flat_map(|frame| &frame.gimbal_imu).copied().collect();
        let motion = Preintegration::from_samples(NOISE, ImuBias::default(), &samples);
        let t = motion.duration_s();
        assert!((t - 0.5).abs() < 1e-6, "{t} s");
        // The velocity at the start follows from the true displacement.
        let (from, to) = (pose(first), pose(first + 10));
        let start = NavigationState { world_from_imu: from, ..NavigationState::default() };
        let predicted = motion.predict(&start, &gravity);
        let velocity = (to.translation_m - predicted.world_from_imu.translation_m) / t;
        let middle = pose(first + 5);
        let half: Vec<_> =
            flight.frames[first + 1..=first + 5].iter().flat_map(|frame| &frame.gimbal_imu).copied().collect();
        let half = Preintegration::from_samples(NOISE, ImuBias::default(), &half);
        let halfway = half.predict(&NavigationState { velocity_m_per_s: velocity, ..start }, &gravity);
        let shift = (halfway.world_from_imu.translation_m - middle.translation_m).norm();
        let angle = predicted.world_from_imu.rotation.angle_to(&to.rotation);
        assert!(shift < 5e-4 && angle < 2e-4, "frame {first}: {shift} m, {angle} rad");
    }
}

/// Root mean square error of the joint angles without their mean, which free joint offsets absorb, in radians.
fn joint_error_rad(flight: &SyntheticFlight, reports: &[StepReport]) -> f64 {
    let errors: Vec<Vec<f64>> = reports
        .iter()
        .zip(&flight.frames)
        .filter_map(|(report, frame)| {
            let estimated = &report.newest()?.joint_angles_rad;
            let pairs = estimated.iter().zip(&frame.true_joint_angles_rad);
            Some(pairs.map(|(estimated, truth)| wrap_angle(estimated - truth)).collect())
        })
        .collect();
    let count = errors.len() as f64;
    let of_joint = |joint: usize| {
        let mean = errors.iter().map(|errors| errors[joint]).sum::<f64>() / count;
        errors.iter().map(|errors| (errors[joint] - mean).powi(2)).sum::<f64>() / count
    };
    (0..3).map(of_joint).sum::<f64>().sqrt()
}

/// Errors of position (m), chain (rad) and joint angles (rad), and the last report.
fn run(flight: &SyntheticFlight, config: EstimatorConfig) -> (f64, f64, f64, StepReport) {
    let (estimator, mut reports) = run_flight(&flight.frames, config);
    assert_eq!(estimator.restarts, 0);
    let (error_m, _) = trajectory_error_m(&flight.frames, &reports);
    let joints_rad = joint_error_rad(flight, &reports);
    (error_m, chain_error(flight, &estimator).1, joints_rad, reports.pop().expect("a flight has frames"))
}

#[test]
fn without_encoders_the_second_imu_improves_trajectory_and_joint_angles() {
    let (mut with, mut without) = ([0.0; 2], [0.0; 2]);
    for seed in [5, 6] {
        let flight = synthetic_tracks(&SyntheticOptions { encoder_sigma_rad: None, ..options(seed) });
        let own = EstimatorConfig { use_encoder: false, ..config(&flight) };
        let (error_m, _, joints_rad, last) = run(&flight, own.clone());
        let summary = last.residuals.iter().find(|summary| summary.factor == FactorKind::GimbalImu).unwrap();
        let ratio = summary.chi2_after / summary.count as f64;
        assert!((0.1..1.6).contains(&ratio), "χ² per residual {ratio}");
        let sum = |errors: &mut [f64; 2], added: [f64; 2]| (0..2).for_each(|index| errors[index] += added[index]);
        sum(&mut with, [error_m, joints_rad]);
        let (error_m, _, joints_rad, last) = run(&flight, EstimatorConfig { gimbal_imu: None, ..own });
        assert!(last.residuals.iter().all(|summary| summary.factor != FactorKind::GimbalImu));
        sum(&mut without, [error_m, joints_rad]);
    }
    assert!(with[0] < without[0] && with[1] < without[1], "{with:?} with, {without:?} without");
}

#[test]
fn pose_and_time_offset_of_the_second_imu_are_estimated() {
    let flight = synthetic_tracks(&options(7));
    let turned = so3::exp(&Vector3::new(0.02, -0.015, 0.01));
    let mut given = config(&flight);
    let imu = given.gimbal_imu.as_mut().unwrap();
    imu.camera_from_imu.rotation *= turned;
    imu.camera_from_imu.translation_m += Vector3::new(0.02, 0.01, -0.03);
    let (wrong_m, ..) = run(&flight, given.clone());
    let (error_m, _, _, last) = run(&flight, EstimatorConfig { estimate_gimbal_imu: true, ..given });
    let calibration = &last.calibration;
    for (name, truth, within) in [
        ("imu1.rx", -0.02, 0.003),
        ("imu1.ry", 0.015, 0.003),
        ("imu1.rz", -0.01, 0.003),
        ("imu1.tx", -0.02, 0.002),
        ("imu1.ty", -0.01, 0.002),
        ("imu1.tz", 0.03, 0.002),
        ("imu1.timeshift", 0.0, 0.002),
    ] {
        let id = ParameterNames::default().parse(name).unwrap();
        let column = calibration.parameters.iter().position(|known| *known == id).unwrap();
        let (value, sigma) = (calibration.values[column], calibration.sigmas[column]);
        assert!((value - truth).abs() < f64::max(within, 4.0 * sigma), "{name}: {value} ± {sigma}, true {truth}");
        assert!(sigma < 0.3 * calibration.prior_sigmas[column], "{name}: σ {sigma}");
    }
    assert!(error_m < wrong_m, "{error_m} m, {wrong_m} m with the wrong axes");
}

#[test]
fn wrong_axes_of_the_second_imu_are_named_in_the_warning() {
    let flight = synthetic_tracks(&options(7));
    let warnings = |config: EstimatorConfig| {
        let (_, reports) = run_flight(&flight.frames, config);
        let all: BTreeSet<String> =
            reports.iter().flat_map(|report| &report.warnings).map(ToString::to_string).collect();
        all
    };
    let mut wrong = config(&flight);
    wrong.gimbal_imu.as_mut().unwrap().camera_from_imu.rotation *= so3::exp(&Vector3::new(0.05, -0.04, 0.03));
    let found = warnings(wrong.clone());
    assert!(found.iter().any(|warning| warning.contains("try gimbal-imu-axes=on")), "{found:?}");
    for right in [config(&flight), EstimatorConfig { estimate_gimbal_imu: true, ..wrong }] {
        let found = warnings(right);
        assert!(!found.iter().any(|warning| warning.contains("gimbal")), "{found:?}");
    }
}

/// Missing samples leave intervals without a factor, and the window goes on.
#[test]
fn missing_samples_leave_an_interval_without_a_factor() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 7.0, ..options(5) });
    let mut frames = flight.frames.clone();
    for frame in &mut frames {
        if (90..100).contains(&frame.index) {
            frame.gimbal_imu.clear();
        }
    }
    let (estimator, reports) = run_flight(&frames, config(&flight));
    assert_eq!(estimator.restarts, 0);
    let counts: Vec<usize> = reports
        .iter()
        .filter(|report| report.newest().is_some())
        .map(|report| report.residuals.iter().find(|it| it.factor == FactorKind::GimbalImu).map_or(0, |it| it.count))
        .collect();
    let most = counts.iter().copied().max().unwrap();
    assert!(counts.iter().any(|count| *count < most) && *counts.last().unwrap() > 0, "{counts:?}");
    assert!(reports.last().unwrap().newest().unwrap().gimbal_imu.is_some());
}

/// Without encoders a change of a joint offset with the opposite change of the joint angle of every frame leaves all
/// measurements as they are, including the measurements of the second IMU.
#[test]
fn joint_offsets_stay_unobservable_without_encoders() {
    let test = fixture::gimbal_imu_window(EstimatorOptions::default(), |_| {});
    let problem = test.problem(&[]);
    let estimate = test.estimate(&[]);
    let parameters = estimate.calibration.of(MAIN).parameters();
    let residuals = |delta: &DVector<f64>| {
        let moved = problem.stepped(&estimate, delta, &[Vec::new()]);
        let rows = fixture::rows(&problem, &moved, |label| matches!(label, FactorLabel::GimbalImu(_)));
        rows.column(rows.ncols() - 1).into_owned()
    };
    let layout = problem.layout;
    let start = residuals(&DVector::zeros(layout.total()));
    assert_eq!(start.len(), 15 * (layout.frames - 1));
    for joint in 0..3 {
        let offset = parameters.iter().position(|id| id.is_joint_offset() && id.link() == Some(joint)).unwrap();
        let mut delta = DVector::zeros(layout.total());
        delta[layout.calibration().start + offset] = 0.1;
        let alone = (residuals(&delta) - &start).amax();
        for slot in 0..layout.frames {
            delta[layout.joints(slot).start + joint] = -0.1;
        }
        let together = (residuals(&delta) - &start).amax();
        assert!(alone > 1.0 && together < 1e-6 * alone, "joint {joint}: {alone} alone, {together} together");
    }
}

/// Chain, joint angles and attitude far from the linearization point of the prior: the derivatives of the second IMU by
/// chain and joint angles are the derivatives of its residuals.
#[test]
fn derivatives_of_the_second_imu_are_those_at_the_current_estimate() {
    let mut test = fixture::gimbal_imu_window(EstimatorOptions::default(), |_| {});
    fixture::marginalize_once(&mut test);
    let problem = test.problem(&[]);
    assert!(problem.prior.is_some_and(|prior| prior.holds_frame(0)), "a prior takes part");
    let layout = problem.layout;
    let wanted = |label| matches!(label, FactorLabel::GimbalImu(_));
    let moved = |at: &Estimate, delta: &DVector<f64>| problem.stepped(at, delta, &[Vec::new()]);
    let mut columns: Vec<usize> = layout.calibration().collect();
    (0..layout.frames).for_each(|slot| columns.extend(layout.joints(slot)));
    let mut far = DVector::zeros(layout.total());
    for (number, column) in columns.iter().enumerate() {
        far[*column] = if number % 2 == 0 { 0.04 } else { -0.03 };
    }
    (0..layout.frames).for_each(|slot| far[layout.pose(slot).start] = 0.005);
    let estimate = moved(&test.estimate(&[]), &far);
    let rows = fixture::rows(&problem, &estimate, wanted);
    let residuals = |delta: &DVector<f64>| {
        let rows = fixture::rows(&problem, &moved(&estimate, delta), wanted);
        rows.column(rows.ncols() - 1).into_owned()
    };
    for column in columns {
        const STEP: f64 = 1e-6;
        let mut delta = DVector::zeros(layout.total());
        delta[column] = STEP;
        let numeric = (residuals(&delta) - residuals(&-delta)) / (2.0 * STEP);
        let error = (rows.column(column) - &numeric).amax();
        assert!(error < 1e-4 * numeric.amax().max(1.0), "column {column}: {error} of {}", numeric.amax());
    }
}

/// Ripple of 200.3 Hz that an IMU without a filter samples at 200 Hz: 0.3 Hz in its samples.
#[test]
fn a_second_imu_with_aliased_vibration_is_named_and_does_little_harm() {
    let mut flight = synthetic_tracks(&options(7));
    for sample in flight.frames.iter_mut().flat_map(|frame| &mut frame.gimbal_imu) {
        let phase = std::f64::consts::TAU * 200.3 * seconds_from_ns(sample.stamp_ns);
        sample.angular_velocity_rad_per_s += Vector3::new(0.05, 0.1, -0.05) * phase.sin();
        sample.specific_force_m_per_s2 += Vector3::new(1.0, -0.5, 2.0) * phase.cos();
    }
    let (_, reports) = run_flight(&flight.frames, config(&flight));
    let named = |report: &StepReport| report.warnings.iter().any(|warning| warning.cause.starts_with("vibration"));
    assert!(reports.iter().any(named) && named(reports.last().unwrap()));
    let (with_m, with_rad, ..) = run(&flight, config(&flight));
    let (without_m, without_rad, ..) = run(&flight, EstimatorConfig { gimbal_imu: None, ..config(&flight) });
    assert!(with_m < 1.15 * without_m, "{with_m} m with it, {without_m} m without");
    assert!(with_rad < 1.15 * without_rad, "{with_rad} rad with it, {without_rad} rad without");
}
