//! Tests of bearing geometry and the small solvers.

use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

use super::flight::Random;
use crate::estimator::initialization::alignment::{quadratic_on_sphere, solve_with_gravity_norm};
use crate::estimator::initialization::bearing::{angle_between, fit_rotation, refine_camera_pose};
use crate::estimator::initialization::essential::{decompose, five_point};
use crate::estimator::initialization::polynomial::{evaluate, real_roots};
use crate::estimator::initialization::relative_pose::{RotationPrior, UnscaledPose, relative_poses};
use crate::geometry::{RigidTransform, so3};

fn random_pose(random: &mut Random) -> RigidTransform {
    RigidTransform::new(so3::exp(&random.vector(0.6)), random.vector(1.0))
}

/// Bearing pairs of points in front of both cameras, with noise in radians.
fn pairs_of(
    pose: &RigidTransform,
    count: usize,
    planar: bool,
    noise: f64,
    random: &mut Random,
) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    (0..count)
        .map(|_| {
            let mut point = random.vector(3.0) + Vector3::new(0.0, 0.0, 7.0);
            if planar {
                point.z = 7.0 + 0.4 * point.x;
            }
            let noisy = |bearing: Vector3<f64>, random: &mut Random| {
                (bearing.normalize() + random.normal_vector() * noise).normalize()
            };
            (noisy(point, random), noisy(pose.transform(&point), random))
        })
        .collect()
}

#[test]
fn roots_are_those_the_polynomial_was_built_from() {
    let roots = [-7.5, -1.0, -0.999, 0.0, 1e-3, 0.4, 2.0, 31.0];
    let mut coefficients = vec![1.0];
    for root in roots {
        let mut next = vec![0.0; coefficients.len() + 1];
        for (power, c) in coefficients.iter().enumerate() {
            next[power + 1] += c;
            next[power] -= root * c;
        }
        coefficients = next;
    }
    // Multiplied by x² + 1, which has no real root.
    let mut product = vec![0.0; coefficients.len() + 2];
    for (power, c) in coefficients.iter().enumerate() {
        product[power] += c;
        product[power + 2] += c;
    }
    let found = real_roots(&product);
    assert_eq!(found.len(), roots.len(), "{found:?}");
    for (found, root) in found.iter().zip(roots) {
        assert!((found - root).abs() < 1e-7, "{found} {root}");
    }
    assert!(real_roots(&[1.0, 0.0, 1.0]).is_empty());
    assert!(real_roots(&[0.0, 0.0]).is_empty());
    assert!(real_roots(&[f64::NAN, 1.0]).is_empty());
    assert_eq!(evaluate(&[1.0, 2.0, 3.0], 2.0), 17.0);
}

#[test]
fn five_points_give_the_true_essential_matrix() {
    let mut random = Random::new(1);
    let mut missed = 0;
    for _ in 0..200 {
        let pose = random_pose(&mut random);
        let pairs: [_; 5] = pairs_of(&pose, 5, false, 0.0, &mut random).try_into().unwrap();
        let mut ground_truth = so3::hat(&pose.translation_m) * pose.rotation_matrix();
        ground_truth /= ground_truth.norm();
        let found = five_point(&pairs);
        for essential in &found {
            for (first, second) in &pairs {
                assert!((second.transpose() * essential * first)[0].abs() < 1e-8);
            }
        }
        let nearest = found
            .iter()
            .map(|e| (e - ground_truth).norm().min((e + ground_truth).norm()))
            .fold(f64::INFINITY, f64::min);
        missed += usize::from(nearest > 1e-5);
        let poses = decompose(&ground_truth).unwrap();
        let nearest_rotation = poses
            .iter()
            .map(|(rotation, _)| (pose.rotation.inverse() * rotation).angle())
            .fold(f64::INFINITY, f64::min);
        assert!(nearest_rotation < 1e-9, "{nearest_rotation}");
    }
    assert!(missed <= 8, "{missed} of 200 missed");
}

#[test]
fn relative_pose_survives_noise_outliers_and_planes() {
    let mut random = Random::new(2);
    let noise = 1.0 / 400.0 * 0.5;
    let mut worst = [(0.0_f64, 0.0_f64); 2];
    for trial in 0..40_u64 {
        let pose = random_pose(&mut random);
        let planar = trial % 2 == 0;
        let mut pairs = pairs_of(&pose, 80, planar, noise, &mut random);
        for pair in pairs.iter_mut().take(12) {
            pair.1 = (pair.1 + random.vector(0.3)).normalize();
        }
        let prior = RotationPrior { rotation: pose.rotation * so3::exp(&random.vector(0.1)), sigma_rad: 0.2 };
        let found = relative_poses(&pairs, &prior, 2.0 * noise, trial);
        assert!(found[0].inliers.len() >= 60);
        if pose.translation_m.norm() < 0.4 {
            continue;
        }
        let error = |found: &UnscaledPose| {
            let rotation_error = (found.camera_j_from_camera_i.rotation.inverse() * pose.rotation).angle();
            (rotation_error, angle_between(&found.camera_j_from_camera_i.translation_m, &pose.translation_m))
        };
        // A plane has two solutions: one of the poses must be the true one.
        let best = found.iter().map(error).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        let worst = &mut worst[usize::from(planar)];
        *worst = (worst.0.max(best.0), worst.1.max(best.1));
    }
    for (worst, rotation_error, heading) in [(worst[0], 0.02, 0.1), (worst[1], 0.05, 0.5)] {
        println!("worst rotation {:.3}°, worst heading {:.2}°", worst.0.to_degrees(), worst.1.to_degrees());
        assert!(worst.0 < rotation_error && worst.1 < heading);
    }
}

#[test]
fn rotation_fit_finds_rotation_and_parallax() {
    let mut random = Random::new(3);
    for _ in 0..50 {
        let rotation = so3::exp(&random.vector(0.8));
        let still = RigidTransform::new(rotation, Vector3::zeros());
        let guess = rotation * so3::exp(&random.vector(0.2));
        let fit = fit_rotation(&pairs_of(&still, 60, false, 0.001, &mut random), &guess).unwrap();
        assert!((fit.rotation.inverse() * rotation).angle() < 0.002);
        assert!(fit.median_parallax_rad < 0.003);
        let moved = RigidTransform::new(rotation, Vector3::new(0.7, 0.0, 0.0));
        let fit = fit_rotation(&pairs_of(&moved, 60, false, 0.001, &mut random), &guess).unwrap();
        assert!(fit.median_parallax_rad > 0.005);
    }
    assert!(fit_rotation(&[], &UnitQuaternion::identity()).is_none());
}

#[test]
fn camera_pose_is_refined_from_a_poor_guess_with_outliers() {
    let mut random = Random::new(5);
    let noise = 0.001;
    for _ in 0..40 {
        let pose = random_pose(&mut random);
        let points: Vec<_> = (0..40)
            .map(|index| {
                let point = pose.transform(&(random.vector(3.0) + Vector3::new(0.0, 0.0, 7.0)));
                let mut bearing = pose.inverse().transform(&point).normalize() + random.normal_vector() * noise;
                if index < 6 {
                    bearing += random.vector(0.3);
                }
                (point, bearing.normalize())
            })
            .collect();
        let guess = RigidTransform::new(
            pose.rotation * so3::exp(&random.vector(0.15)),
            pose.translation_m + random.vector(0.8),
        );
        let found = refine_camera_pose(&points, &guess, noise, 4.0).unwrap();
        assert!((found.world_from_camera.rotation.inverse() * pose.rotation).angle() < 0.003);
        assert!((found.world_from_camera.translation_m - pose.translation_m).norm() < 0.02);
        assert!(found.inliers.iter().filter(|inlier| **inlier).count() >= 32);
    }
}

#[test]
fn gravity_norm_is_exact_and_the_minimum_is_one() {
    let mut random = Random::new(8);
    for _ in 0..100 {
        let root = Matrix3::from_fn(|_, _| random.normal());
        let a = root * root.transpose() + Matrix3::identity() * 0.01;
        let b = random.normal_vector() * 20.0;
        let x = quadratic_on_sphere(&a, &b, 9.81).unwrap();
        assert!((x.norm() - 9.81).abs() < 1e-12);
        let value = |x: &Vector3<f64>| x.dot(&(a * x)) - 2.0 * b.dot(x);
        for _ in 0..50 {
            let other = random.normal_vector().normalize() * 9.81;
            assert!(value(&x) <= value(&other) + 1e-9);
        }
    }
}

#[test]
fn constrained_system_returns_the_solution_it_was_made_of() {
    let mut random = Random::new(9);
    let n = 16;
    let rows = DMatrix::from_fn(60, n, |_, _| random.normal());
    let mut ground_truth = DVector::from_fn(n, |_, _| random.normal());
    let gravity = Vector3::new(1.0, -2.0, 9.0).normalize() * 9.81;
    ground_truth.fixed_rows_mut::<3>(7).copy_from(&gravity);
    let side = &rows * &ground_truth;
    let found = solve_with_gravity_norm(&rows.tr_mul(&rows), &rows.tr_mul(&side), 9.81).unwrap();
    assert!((found - ground_truth).norm() < 1e-8);
}
