//! Pose loops with known solutions.

use nalgebra::{DVector, UnitQuaternion, Vector3, Vector6};

use super::random::Random;
use crate::calibration::ChainDistance;
use crate::calibration::border_prior::ChainTerm;
use crate::calibration::pose_loop::{LoopNoise, LoopState, PairedSegment, PoseLoops, PosePair, SegmentFrame};
use crate::geometry::{RigidTransform, so3, wrap_angle};
use crate::gimbal::{Chain, ClassicalChain, Parameterization, auto_parameterization};
use crate::optimization::RobustLoss;
use crate::sensors::{ChainPrior, JointAngles, JointMotionFit};
use crate::simulation::{SyntheticOptions, synthetic_tracks};

struct Example {
    ground_truth: ClassicalChain,
    given: ClassicalChain,
    segments: Vec<PairedSegment>,
    visited: Vec<Vec<f64>>,
}

/// Poses measured with errors `noise` of rotation and position; the given chain has errors of up to 10° and 3 cm.
fn example(seed: u64, encoder_sigma_rad: f64, noise: (f64, f64), still: bool) -> Example {
    let flight =
        synthetic_tracks(&SyntheticOptions { seed, duration_s: 0.2, features: 1, ..SyntheticOptions::default() });
    let ground_truth = flight.true_rig.gimbal.unwrap().chain;
    let mut random = Random::new(seed);
    let minimal = Chain::from_classical(&ground_truth, Parameterization::MinimalYx);
    let parameters = minimal.parameters();
    let error = DVector::from_fn(minimal.dof(), |k, _| random.next() * parameters[k].scale());
    let given = minimal.plus(&error).to_classical();
    let mut visited = Vec::new();
    let segments = (0..8)
        .map(|_| {
            let frame = SegmentFrame {
                world_from_segment: RigidTransform::new(so3::exp(&random.vector(2.0)), random.vector(5.0)),
                metres_per_unit: 0.5 + random.next().abs() * 3.0,
            };
            let start = random.vector(10.0);
            (0..10)
                .map(|step| {
                    let angles: Vec<f64> = if still {
                        vec![0.1, 0.0, -0.1]
                    } else {
                        vec![random.next(), 0.4 * random.next(), 0.5 * random.next()]
                    };
                    let world_from_imu = RigidTransform::new(
                        so3::exp(&random.vector(0.6)),
                        start + Vector3::new(0.4, 0.1, 0.0) * f64::from(step) + random.vector(0.2),
                    );
                    let camera = world_from_imu * ground_truth.imu_from_camera(&angles);
                    let mut seen = frame.world_from_segment.inverse() * camera;
                    let mut errors = || Vector3::from_fn(|_, _| random.normal(1.0));
                    let (rotation_error, shift) = (errors() * noise.0, errors() * noise.1);
                    seen = RigidTransform::new(seen.rotation * so3::exp(&rotation_error), seen.translation_m + shift);
                    seen.translation_m /= frame.metres_per_unit;
                    let readings = angles.iter().map(|angle| angle + random.normal(encoder_sigma_rad)).collect();
                    visited.push(angles);
                    PosePair {
                        world_from_imu,
                        segment_from_camera: RigidTransform::new(
                            UnitQuaternion::new_normalize(seen.rotation.into_inner()),
                            seen.translation_m,
                        ),
                        encoder: JointAngles {
                            angles_rad: readings,
                            sigmas_rad: vec![encoder_sigma_rad; 3],
                            lasting_sigmas_rad: vec![0.0; 3],
                            rates_rad_per_s: vec![0.0; 3],
                            motion_fits: vec![JointMotionFit::UNKNOWN; 3],
                        },
                    }
                })
                .collect()
        })
        .collect();
    Example { ground_truth, given, segments, visited }
}

fn prior() -> ChainPrior {
    ChainPrior { translation_bound_m: 0.03, rotation_bound_rad: 0.175 }
}

#[test]
fn pose_loop_jacobians_meet_central_differences() {
    let example = example(3, 0.05, (0.0, 0.0), false);
    let term = ChainTerm::new(&example.given, &prior(), auto_parameterization(&example.given));
    let noise = LoopNoise { rotation_rad: 0.01, position_m: 0.02, loss: RobustLoss::None };
    let loops = PoseLoops { noise, ..PoseLoops::new(&example.segments, &term) };
    let state = LoopState {
        chain: term.given.clone(),
        joints_rad: example
            .segments
            .iter()
            .map(|pairs| pairs.iter().map(|pair| pair.encoder.angles_rad.clone()).collect())
            .collect(),
        frames: (0..example.segments.len())
            .map(|k| SegmentFrame {
                world_from_segment: RigidTransform::new(
                    so3::exp(&Vector3::new(0.3, 0.1 * k as f64, 0.2)),
                    Vector3::new(1.0, 2.0, 3.0),
                ),
                metres_per_unit: 1.3,
            })
            .collect(),
    };
    let rows = loops.rows(&state, 2, 4);
    let step = 1e-6;
    let check = |name: &str, column: nalgebra::Matrix6xX<f64>, move_by: &dyn Fn(&mut LoopState, usize, f64)| {
        for k in 0..column.ncols() {
            let at = |sign: f64| -> Vector6<f64> {
                let mut moved = state.clone();
                move_by(&mut moved, k, sign * step);
                loops.rows(&moved, 2, 4).residual
            };
            let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
            assert!((slope - column.column(k)).amax() < 1e-4, "{name} {k}");
        }
    };
    check("chain", rows.by_chain.clone(), &|state, k, step| {
        let delta = DVector::from_fn(state.chain.dof(), |row, _| if row == k { step } else { 0.0 });
        state.chain = state.chain.plus(&delta);
    });
    check("joints", rows.by_joints.clone(), &|state, k, step| state.joints_rad[2][4][k] += step);
    check("frame", rows.by_frame.clone(), &|state, k, step| {
        let mut delta = [0.0; 7];
        delta[k] = step;
        state.frames[2] = state.frames[2].plus(&delta);
    });
}

#[test]
fn exact_poses_recover_the_chain_up_to_encoder_noise() {
    for seed in 1..=4 {
        let example = example(seed, 1e-4, (0.0, 0.0), false);
        let term = ChainTerm::new(&example.given, &prior(), auto_parameterization(&example.given));
        let solution = PoseLoops::new(&example.segments, &term).solve().unwrap();
        let before = ChainDistance::over(&example.given, &example.ground_truth, &example.visited).unwrap();
        let after =
            ChainDistance::over(&solution.state.chain.to_classical(), &example.ground_truth, &example.visited).unwrap();
        assert!(before.translation_mean_m > 0.01, "seed {seed}: {before:?}");
        assert!(after.translation_mean_m < 5e-4 && after.rotation_mean_rad < 1e-3, "seed {seed}: {after:?}");
    }
}

#[test]
fn noisy_encoders_leave_the_chain_within_its_sigmas() {
    let (mut square, mut count) = (0.0, 0.0);
    for seed in 11..=16 {
        let example = example(seed, 0.1, (1e-3, 5e-3), false);
        let term = ChainTerm::new(&example.given, &prior(), auto_parameterization(&example.given));
        let solution = PoseLoops::new(&example.segments, &term).solve().unwrap();
        let ground_truth = Chain::from_classical(&example.ground_truth, solution.state.chain.parameterization());
        let error = solution.state.chain.minus(&ground_truth).map(wrap_angle);
        let information = solution.covariance.clone().try_inverse().unwrap();
        square += (error.transpose() * information * &error)[0];
        count += error.len() as f64;
    }
    // Mean of χ² over its degrees of freedom: within four standard deviations of one.
    let ratio: f64 = square / count;
    assert!((ratio - 1.0).abs() < 4.0 * (2.0 / count).sqrt(), "normalized square of the error {ratio}");
}

/// Stationary joints determine one rigid transform only: the parameters keep their prior uncertainty, the
/// transform is estimated.
#[test]
fn stationary_joints_leave_unobservable_directions_at_the_prior() {
    let moving = example(5, 0.01, (0.0, 0.0), false);
    let example = example(5, 0.01, (0.0, 0.0), true);
    let term = ChainTerm::new(&example.given, &prior(), auto_parameterization(&example.given));
    let solution = PoseLoops::new(&example.segments, &term).solve().unwrap();
    let moved = PoseLoops::new(&moving.segments, &term).solve().unwrap();
    let total = |covariance: &nalgebra::DMatrix<f64>| {
        (0..covariance.nrows()).map(|k| covariance[(k, k)] / term.prior_sigmas[k].powi(2)).sum::<f64>()
    };
    assert!(total(&solution.covariance) > 5.0 * total(&moved.covariance));
    let error =
        ChainDistance::over(&solution.state.chain.to_classical(), &example.ground_truth, &example.visited).unwrap();
    assert!(error.translation_mean_m < 0.01 && error.rotation_mean_rad < 0.02, "{error:?}");
}
