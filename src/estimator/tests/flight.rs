//! Complete synthetic flights: accuracy, calibration, replay, faults.

use nalgebra::Vector3;

use super::fixture;
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::report::{EventKind, StepReport};
use crate::estimator::{Estimator, Phase};
use crate::geometry::so3;
use crate::gimbal::Parameterization;
use crate::simulation::{SyntheticFlight, SyntheticFrame, SyntheticMount, SyntheticOptions, synthetic_tracks};

/// Estimated and true position.
type Pair = (Vector3<f64>, Vector3<f64>);

fn options(mount: SyntheticMount) -> SyntheticOptions {
    SyntheticOptions {
        mount,
        seed: 5,
        duration_s: 10.0,
        pixel_sigma_px: 0.5,
        outlier_ratio: 0.02,
        features: 100,
        ..SyntheticOptions::default()
    }
}

pub(super) fn step(estimator: &mut Estimator, frame: &SyntheticFrame) -> StepReport {
    fixture::step(estimator, frame, &frame.tracks, &[])
}

pub(super) fn run_flight(frames: &[SyntheticFrame], config: EstimatorConfig) -> (Estimator, Vec<StepReport>) {
    let mut estimator = Estimator::new(config);
    let reports = frames.iter().map(|frame| step(&mut estimator, frame)).collect();
    (estimator, reports)
}

/// [`run_flight`] with the IMU samples after each stamp.
pub(super) fn run_flight_by_rows(frames: &[SyntheticFrame], config: EstimatorConfig) -> (Estimator, Vec<StepReport>) {
    let mut estimator = Estimator::new(config);
    let following = frames.iter().skip(1).map(Some).chain([None]);
    let reports = frames
        .iter()
        .zip(following)
        .map(|(frame, next)| fixture::step_before(&mut estimator, frame, next, &frame.tracks, &[]))
        .collect();
    (estimator, reports)
}

/// Root mean square position error after alignment of yaw and position with the ground truth, and length of
/// the trajectory, in metres.
pub(super) fn trajectory_error_m(frames: &[SyntheticFrame], reports: &[StepReport]) -> (f64, f64) {
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = reports
        .iter()
        .zip(frames)
        .filter_map(|(report, frame)| {
            Some((report.newest()?.world_from_imu.translation_m, frame.true_world_from_imu.translation_m))
        })
        .collect();
    assert!(pairs.len() > 100, "estimated {} of {} frames", pairs.len(), reports.len());
    let count = pairs.len() as f64;
    let middle = |pick: fn(&Pair) -> Vector3<f64>| pairs.iter().map(pick).sum::<Vector3<f64>>() / count;
    let (estimated, ground_truth) = (middle(|pair| pair.0), middle(|pair| pair.1));
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (e, t) in pairs.iter().map(|pair| (pair.0 - estimated, pair.1 - ground_truth)) {
        cosine += e.x * t.x + e.y * t.y;
        sine += e.x * t.y - e.y * t.x;
    }
    let yaw_alignment = so3::exp(&Vector3::new(0.0, 0.0, sine.atan2(cosine)));
    let squares: f64 =
        pairs.iter().map(|pair| (yaw_alignment * (pair.0 - estimated) - (pair.1 - ground_truth)).norm_squared()).sum();
    let length = pairs.windows(2).map(|two| (two[1].1 - two[0].1).norm()).sum();
    ((squares / count).sqrt(), length)
}

/// Mean error of the chain over the joint angles of the flight, in metres and radians.
pub(super) fn chain_error(flight: &SyntheticFlight, estimator: &Estimator) -> (f64, f64) {
    let (estimated, ground_truth) = (estimator.classical_chain(), flight.true_rig.chain_of_camera("cam0").unwrap());
    let count = flight.frames.len() as f64;
    flight.frames.iter().fold((0.0, 0.0), |(shift, angle_rad), frame| {
        let angles = &frame.true_joint_angles_rad;
        let error = estimated.imu_from_camera(angles).inverse() * ground_truth.imu_from_camera(angles);
        (shift + error.translation_m.norm() / count, angle_rad + so3::log(&error.rotation).norm() / count)
    })
}

#[test]
fn a_rigid_camera_follows_the_flight() {
    let flight = synthetic_tracks(&options(SyntheticMount::Static));
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let (estimator, reports) = run_flight(&flight.frames, config);
    let (error, length) = trajectory_error_m(&flight.frames, &reports);
    assert!(error < 0.003 * length, "{error} m over {length} m");
    assert_eq!(estimator.restarts, 0);
    let last = reports.last().unwrap();
    assert_eq!(last.calibration.parameters.len(), 6);
    assert!(last.calibration.sigmas.iter().zip(&last.calibration.prior_sigmas).all(|(after, before)| after < before));
    assert!(last.window.iter().all(|frame| frame.joint_angles_rad.is_empty()));
}

#[test]
fn a_gimbal_camera_follows_the_flight_and_calibrates_its_chain() {
    let flight = synthetic_tracks(&options(SyntheticMount::Gimbal));
    for parameterization in [Parameterization::Minimal, Parameterization::Classical, Parameterization::Poe] {
        let config = fixture::config(&flight.given_rig, parameterization, EstimatorOptions::default());
        let before = chain_error(&flight, &Estimator::new(config.clone()));
        let (estimator, reports) = run_flight(&flight.frames, config);
        let (error, length) = trajectory_error_m(&flight.frames, &reports);
        assert!(error < 0.003 * length, "{parameterization}: {error} m over {length} m");
        let after = chain_error(&flight, &estimator);
        assert!(after.1 < 0.5 * before.1, "{parameterization}: {before:?} to {after:?}");
        let last = reports.last().unwrap();
        assert_eq!(last.calibration.parameters.len(), estimator.calibration().dof());
    }
}

#[test]
fn a_fixed_chain_keeps_its_given_values() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 8.5, ..options(SyntheticMount::Gimbal) });
    let mut config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    config.calibrate = false;
    let given = Estimator::new(config.clone()).classical_chain();
    let (estimator, reports) = run_flight(&flight.frames, config);
    assert_eq!(estimator.classical_chain(), given);
    let last = reports.last().unwrap();
    assert_eq!(last.phase, Phase::Tracking);
    assert!(last.calibration.sigmas.iter().all(|sigma| *sigma == 0.0));
    assert_eq!(last.newest().unwrap().joint_angles_rad.len(), 3);
}

/// A clone continues exactly as the original, and a second run gives the same reports.
#[test]
fn replays_and_clones_give_the_same_bits() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 7.0, ..options(SyntheticMount::Gimbal) });
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let (_, reports) = run_flight(&flight.frames, config.clone());
    let mut estimator = Estimator::new(config);
    let half = flight.frames.len() / 2 + 10;
    let comparable = |report: &StepReport| format!("{report:?}");
    for (frame, report) in flight.frames[..half].iter().zip(&reports) {
        assert_eq!(comparable(&step(&mut estimator, frame)), comparable(report));
    }
    assert_eq!(estimator.phase(), Phase::Tracking);
    let mut copy = estimator.clone();
    for (frame, report) in flight.frames[half..].iter().zip(&reports[half..]) {
        assert_eq!(comparable(&step(&mut copy, frame)), comparable(report));
    }
}

#[test]
fn measurement_faults_are_reported_and_survived() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 14.0, ..options(SyntheticMount::Static) });
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let mut estimator = Estimator::new(config);
    let mut kinds = Vec::new();
    let mut last = None;
    for frame in &flight.frames {
        let mut frame = frame.clone();
        match frame.index {
            // A sample with NaN, and an image from the past.
            100 => frame.imu[3].specific_force_m_per_s2 = Vector3::repeat(f64::NAN),
            105 => frame.stamp_ns -= 400_000_000,
            // Half a second without images, then one and a half without IMU samples.
            120..130 => frame.tracks.features.clear(),
            140..170 => continue,
            170 => frame.imu.clear(),
            _ => {}
        }
        let report = step(&mut estimator, &frame);
        kinds.extend(report.events.iter().map(|event| event.kind));
        if let Some(newest) = report.newest() {
            assert!(newest.world_from_imu.translation_m.iter().all(|x| x.is_finite()), "image {}", frame.index);
        }
        last = Some(report);
    }
    assert!(kinds.contains(&EventKind::MeasurementMissing));
    assert!(kinds.contains(&EventKind::Failure));
    let last = last.unwrap();
    assert_eq!(last.restarts, 1);
    assert_eq!(last.phase, Phase::Tracking, "recovered after the gap: {:?}", last.events);
}
