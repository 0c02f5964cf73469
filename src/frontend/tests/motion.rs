//! Outliers and the rotation prediction.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::homography::Dice;
use crate::frontend::outliers::{BearingPair, OutlierOptions, estimate_motion, fit_rotation};
use crate::frontend::prediction::RowRotations;
use crate::frontend::{ChainOrientation, PredictedRotation, PredictionNoise, camera_rates, predict_camera_rotation};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{ClassicalChain, DhLink};
use crate::sensors::ImuSample;

const FOCAL_PX: f64 = 450.0;

/// Simulated pair of images of scattered points.
struct View {
    rotation: Vector3<f64>,
    translation: Vector3<f64>,
    /// Error of the predicted rotation, in radians.
    prediction_error: Vector3<f64>,
    predicted: bool,
    outlier_ratio: f64,
    /// Range of the depths, in the unit of the translation.
    depths: (f64, f64),
}

impl Default for View {
    fn default() -> Self {
        Self {
            rotation: Vector3::new(0.02, -0.03, 0.01),
            translation: Vector3::new(0.1, -0.05, 0.2),
            prediction_error: Vector3::zeros(),
            predicted: true,
            outlier_ratio: 0.15,
            depths: (3.0, 15.0),
        }
    }
}

/// Classifies 120 tracks and checks the kept ratios of inliers and outliers.
fn check(name: &str, view: &View, min_inliers_kept: f64, max_outliers_kept: f64) {
    for seed in 1..20 {
        let mut dice = Dice(seed * 7919);
        let rotation = so3::exp(&view.rotation);
        let mut ground_truth = Vec::new();
        let mut pairs = Vec::new();
        while pairs.len() < 120 {
            let depth = view.depths.0 + (view.depths.1 - view.depths.0) * dice.uniform();
            let point = Vector3::new(1.4 * dice.uniform() - 0.7, dice.uniform() - 0.5, 1.0) * depth;
            let mut observed = rotation * point + view.translation;
            observed /= observed.z;
            observed += Vector3::new(dice.normal(), dice.normal(), 0.0) * (0.15 / FOCAL_PX);
            let right = dice.uniform() >= view.outlier_ratio;
            if !right {
                let angle = std::f64::consts::TAU * dice.uniform();
                observed += Vector3::new(angle.cos(), angle.sin(), 0.0) * ((8.0 + 40.0 * dice.uniform()) / FOCAL_PX);
            }
            ground_truth.push(right);
            pairs.push(BearingPair { previous: point.normalize(), now: observed.normalize() });
        }
        let predicted = PredictedRotation::isotropic(so3::exp(&view.prediction_error) * rotation, 0.05);
        let predicted = view.predicted.then_some(&predicted);
        let start = predicted.map_or_else(UnitQuaternion::identity, |predicted| predicted.rotation);
        let motion = estimate_motion(&pairs, &start, predicted, FOCAL_PX, &OutlierOptions::default());
        let count = |kind: bool| ground_truth.iter().filter(|right| **right == kind).count().max(1) as f64;
        let kept = |kind: bool| {
            ground_truth.iter().zip(&motion.is_inlier).filter(|(right, inlier)| **right == kind && **inlier).count()
                as f64
        };
        let (right, wrong) = (kept(true) / count(true), kept(false) / count(false));
        assert!(right >= min_inliers_kept, "{name}, seed {seed}: keeps {right} of the right ones");
        assert!(wrong <= max_outliers_kept, "{name}, seed {seed}: keeps {wrong} of the wrong ones");
    }
}

#[test]
fn a_good_prediction_separates_outliers() {
    check("general", &View::default(), 0.97, 0.3);
    check("sideways", &View { translation: Vector3::new(0.2, 0.0, 0.0), ..View::default() }, 0.97, 0.3);
    check("many outliers", &View { outlier_ratio: 0.4, ..View::default() }, 0.95, 0.35);
}

#[test]
fn a_prediction_with_degrees_of_error_does_no_harm() {
    for error in [Vector3::new(0.05, 0.0, 0.0), Vector3::new(0.0, -0.07, 0.03), Vector3::new(0.02, 0.02, -0.1)] {
        check("wrong prediction", &View { prediction_error: error, ..View::default() }, 0.9, 0.35);
    }
    check("no prediction", &View { predicted: false, ..View::default() }, 0.9, 0.35);
    let spin = Vector3::new(0.1, 0.25, -0.1);
    check("no prediction, fast", &View { predicted: false, rotation: spin, ..View::default() }, 0.9, 0.35);
}

#[test]
fn pure_rotation_keeps_only_rotating_tracks() {
    let view = View { translation: Vector3::zeros(), ..View::default() };
    check("pure rotation", &view, 0.99, 0.02);
    let wrong = View { translation: Vector3::zeros(), prediction_error: Vector3::new(0.03, -0.05, 0.0), ..view };
    check("pure rotation, wrong prediction", &wrong, 0.99, 0.02);
}

#[test]
fn clean_scenes_keep_all_tracks() {
    check("clean", &View { outlier_ratio: 0.0, ..View::default() }, 0.99, 0.0);
    let far = View { outlier_ratio: 0.0, depths: (50.0, 300.0), ..View::default() };
    check("far", &far, 0.99, 0.0);
}

#[test]
fn random_matches_are_kept_rather_than_all_rejected() {
    let mut dice = Dice(5);
    let mut direction = || Vector3::new(dice.uniform() - 0.5, dice.uniform() - 0.5, 1.0).normalize();
    let pairs: Vec<_> = (0..60).map(|_| BearingPair { previous: direction(), now: direction() }).collect();
    let identity = UnitQuaternion::identity();
    let motion = estimate_motion(&pairs, &identity, None, FOCAL_PX, &OutlierOptions::default());
    let kept = motion.is_inlier.iter().filter(|inlier| **inlier).count();
    assert!(kept >= 24, "{kept}");
    for count in 0..8 {
        let motion = estimate_motion(&pairs[..count], &identity, None, FOCAL_PX, &OutlierOptions::default());
        assert_eq!(motion.is_inlier, vec![true; count]);
    }
}

#[test]
fn one_repeated_track_does_not_determine_a_rotation() {
    let pair = BearingPair { previous: Vector3::z(), now: Vector3::z() };
    let rotation = fit_rotation(&[pair; 20], &UnitQuaternion::identity(), 1e-3);
    assert!(rotation.angle() < 1e-9);
}

fn sample(stamp_ns: i64, angular_velocity: Vector3<f64>) -> ImuSample {
    ImuSample {
        stamp_ns,
        angular_velocity_rad_per_s: angular_velocity,
        specific_force_m_per_s2: Vector3::new(0.0, 0.0, 9.81),
        unmeasured_s: 0.0,
    }
}

const NOISE: PredictionNoise =
    PredictionNoise { gyroscope_bias_rad_per_s: 0.02, gyroscope_noise_density: 3e-4, chain_rotation_rad: 0.05 };

const JOINT_SIGMA_RAD: f64 = 0.03;

/// Gimbal with one joint, all of whose parameters differ from zero.
fn chain() -> ClassicalChain {
    let pose = |x, y, z| RigidTransform::new(so3::exp(&Vector3::new(x, y, z)), Vector3::new(0.1, 0.0, -0.1));
    ClassicalChain {
        imu_from_base: pose(3.0, 0.1, -0.2),
        links: vec![DhLink { theta_offset_rad: -1.5, d_m: 0.03, a_m: 0.02, alpha_rad: 0.7 }],
        effector_from_camera: pose(0.1, 1.5, 0.2),
    }
}

fn rigid(rotation: UnitQuaternion<f64>) -> ChainOrientation {
    let imu_from_base = RigidTransform::new(rotation, Vector3::zeros());
    ChainOrientation::new(&ClassicalChain { imu_from_base, ..ClassicalChain::default() }, &[], &[])
}

#[test]
fn the_predicted_rotation_is_that_of_the_chain_of_frames() {
    let (rate, bias) = (Vector3::new(0.5, -1.0, 2.0), Vector3::new(0.1, 0.2, -0.3));
    let imu: Vec<_> = (0..11).map(|k| sample(k * 5_000_000, rate + bias)).collect();
    let previous = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0);
    let now = UnitQuaternion::from_euler_angles(0.5, 0.1, 1.2);
    let rotation = predict_camera_rotation(&imu, &bias, &rigid(previous), &rigid(now), &NOISE).unwrap().rotation;
    // Direction fixed in the world: world = IMU at the first time.
    let world = Vector3::new(0.2, 0.7, -0.4);
    let world_from_imu_now = so3::exp(&(rate * 0.05));
    let in_previous = previous.inverse() * world;
    let in_now = now.inverse() * (world_from_imu_now.inverse() * world);
    assert!((rotation * in_previous - in_now).norm() < 1e-12);
}

#[test]
fn the_covariance_matches_predictions_from_perturbed_input() {
    let imu: Vec<_> = (0..11).map(|k| sample(k * 5_000_000, Vector3::new(0.9, -1.6, 6.0))).collect();
    let predict = |chain: &ClassicalChain, bias: &Vector3<f64>, angles: [f64; 2]| {
        let [previous, now] = angles.map(|angle| ChainOrientation::new(chain, &[angle], &[JOINT_SIGMA_RAD]));
        predict_camera_rotation(&imu, bias, &previous, &now, &NOISE).unwrap()
    };
    let angles = [0.4, -0.1];
    let given = predict(&chain(), &Vector3::zeros(), angles);
    let mut dice = Dice(11);
    let mut measured = Matrix3::zeros();
    let count = 20_000;
    // Small enough for the first order.
    let shrink = 0.1;
    for _ in 0..count {
        let mut vector = |sigma: f64| Vector3::from_fn(|_, _| shrink * sigma * dice.normal());
        let mut wrong = chain();
        let [base, effector, camera] = [0, 1, 2].map(|_| so3::exp(&vector(NOISE.chain_rotation_rad)));
        wrong.imu_from_base.rotation *= base;
        wrong.effector_from_camera.rotation = effector * wrong.effector_from_camera.rotation * camera;
        let bias = vector(NOISE.gyroscope_bias_rad_per_s);
        let error = vector(JOINT_SIGMA_RAD);
        let observed = predict(&wrong, &bias, [angles[0] + error.x, angles[1] + error.y]);
        let error = so3::log(&(observed.rotation * given.rotation.inverse())) / shrink;
        measured += error * error.transpose() / f64::from(count);
    }
    // The noise of the gyroscope is not included; it is negligible.
    let difference = (given.covariance_rad2 - measured).norm() / measured.norm();
    assert!(difference < 0.03, "{} instead of {measured}", given.covariance_rad2);
}

#[test]
fn no_rotation_is_predicted_from_broken_samples() {
    let extrinsics = rigid(UnitQuaternion::identity());
    let good = [sample(0, Vector3::x()), sample(5_000_000, Vector3::x())];
    assert!(predict_camera_rotation(&good, &Vector3::zeros(), &extrinsics, &extrinsics, &NOISE).is_some());
    for imu in [
        vec![],
        vec![good[0]],
        vec![good[1], good[0]],
        vec![good[0], sample(5_000_000, Vector3::new(f64::NAN, 0.0, 0.0))],
    ] {
        assert_eq!(predict_camera_rotation(&imu, &Vector3::zeros(), &extrinsics, &extrinsics, &NOISE), None);
    }
}

#[test]
fn rows_are_carried_to_the_middle_of_a_rolling_shutter() {
    let (rate, readout_s) = (Vector3::new(0.7, -1.1, 0.4), 0.03);
    let at = |time_s: f64, direction: &Vector3<f64>| so3::exp(&(rate * -time_s)) * direction;
    let first_rows = PredictedRotation::isotropic(so3::exp(&(rate * -0.05)), 0.01);
    assert_eq!(first_rows.with_readout(0.0, [rate; 2]), first_rows);
    let predicted = first_rows.with_readout(readout_s, [rate; 2]);
    let rows = predicted.rows.unwrap();
    for [previous, now] in [[0.1, 0.2], [0.9, 0.6], [0.5, 0.5]] {
        let direction = Vector3::new(0.3, -0.2, 1.0).normalize();
        let (before, after) = (at(previous * readout_s, &direction), at(0.05 + now * readout_s, &direction));
        let before_in_middle = RowRotations::to_middle(&rows.previous_rad, previous, &before);
        let after_in_middle = RowRotations::to_middle(&rows.now_rad, now, &after);
        assert!((predicted.rotation * before_in_middle - after_in_middle).norm() < 1e-9);
        assert!((RowRotations::from_middle(&rows.now_rad, now, &after_in_middle) - after).norm() < 1e-12);
    }
}

#[test]
fn the_rate_of_a_camera_is_that_of_imu_and_joints() {
    let (rate, joint_rate) = (Vector3::new(0.5, -1.0, 2.0), 0.8);
    let imu: Vec<_> = (0..11).map(|k| sample(k * 5_000_000, rate)).collect();
    let world_from_camera = |time_s: f64| {
        let chain = chain().imu_from_camera(&[0.4 + joint_rate * time_s]);
        so3::exp(&(rate * time_s)) * chain.rotation
    };
    let orientation = |time_s: f64| {
        ChainOrientation::new(&chain(), &[0.4 + joint_rate * time_s], &[0.01]).with_joint_rates(&[joint_rate])
    };
    let found = camera_rates(&imu, &Vector3::zeros(), &orientation(0.0), &orientation(0.05), 0.02);
    for (time_s, found) in [0.0, 0.05].into_iter().zip(found) {
        let turned = world_from_camera(time_s - 1e-5).inverse() * world_from_camera(time_s + 1e-5);
        assert!((so3::log(&turned) / 2e-5 - found).norm() < 1e-6, "{found}");
    }
}
