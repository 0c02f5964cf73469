//! Causes of rank loss in simulated windows (docs/mathematics.md, section 7).

use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

use super::window::{Landmark, Window};
use crate::camera::CameraModel;
use crate::estimator::Linearization;
use crate::geometry::{Dimension, RigidTransform, so3};
use crate::gimbal::tests::random::{Random, special_chains};
use crate::gimbal::{Chain, ClassicalChain, ParameterId, ParameterNames, Parameterization};
use crate::observability::{KnownLoss, RankReport, ScalingRule, analyse, analyse_with_scaling};

const FRAMES: usize = 10;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    Exciting,
    NeverRotates,
    Hover,
    CameraNeverRotates,
    JointFrozen,
    AllJointsFrozen,
}

/// Yaw, roll and pitch with an optical camera frame; the axes intersect, or miss each other by centimetres.
fn mechanism(offsets: bool) -> ClassicalChain {
    let (_, mut chain) = special_chains().remove(0);
    if offsets {
        let mut random = Random::new(41);
        for link in &mut chain.links {
            link.d_m += random.within(0.05);
            link.a_m += 0.04 + random.within(0.02);
            link.alpha_rad += random.within(0.05);
        }
        chain.imu_from_base = RigidTransform::new(so3::exp(&random.vector(0.05)), random.vector(0.1));
        chain.effector_from_camera = RigidTransform::new(
            chain.effector_from_camera.rotation * so3::exp(&random.vector(0.05)),
            random.vector(0.05),
        );
    }
    chain
}

fn window(classical: &ClassicalChain, motion: Motion) -> Window {
    let mut random = Random::new(42);
    let wave = |size: f64, frame: usize, rate: f64, phase: f64| size * (rate * frame as f64 + phase).sin();
    let camera = CameraModel::pinhole([460.0, 460.0, 0.0, 0.0], [640, 480]).unwrap();
    let joint_angles_rad: Vec<Vec<f64>> = (0..FRAMES)
        .map(|frame| {
            let mut angles = vec![wave(0.4, frame, 0.5, 0.1), wave(0.25, frame, 0.8, 1.0), wave(0.3, frame, 0.6, 2.0)];
            match motion {
                Motion::JointFrozen => angles[1] = 0.2,
                Motion::AllJointsFrozen => angles = vec![0.3, 0.2, -0.1],
                _ => {}
            }
            angles
        })
        .collect();
    let rotation_vector = |frame: usize| {
        Vector3::new(wave(0.2, frame, 0.7, 0.4), wave(0.25, frame, 0.5, 1.3), wave(0.3, frame, 0.4, 0.2))
    };
    let moved =
        |frame: usize| Vector3::new(wave(1.2, frame, 0.4, 0.0), wave(0.9, frame, 0.6, 0.7), wave(0.7, frame, 0.5, 1.9));
    let world_from_imu: Vec<RigidTransform> = (0..FRAMES)
        .map(|frame| {
            let rotation = match motion {
                Motion::NeverRotates | Motion::Hover => so3::exp(&rotation_vector(0)),
                Motion::CameraNeverRotates => classical.imu_from_camera(&joint_angles_rad[frame]).rotation.inverse(),
                _ => so3::exp(&rotation_vector(frame)),
            };
            let translation = if motion == Motion::Hover { moved(0) } else { moved(frame) };
            RigidTransform::new(UnitQuaternion::new_normalize(rotation.into_inner()), translation)
        })
        .collect();
    let cameras: Vec<_> = world_from_imu
        .iter()
        .zip(&joint_angles_rad)
        .map(|(world_from_imu, angles)| *world_from_imu * classical.imu_from_camera(angles))
        .collect();
    let (mut landmarks, mut observations) = (vec![], vec![]);
    for anchor in 0..6 {
        for _ in 0..12 {
            let bearing = Vector3::new(random.within(0.4), random.within(0.3), 1.0);
            let inverse_depth_per_m = 1.0 / (9.0 + random.within(5.0));
            let point_in_world = cameras[anchor].transform(&(bearing / inverse_depth_per_m));
            let index = landmarks.len();
            landmarks.push(Landmark { anchor, bearing, inverse_depth_per_m });
            for (observer, camera) in cameras.iter().enumerate() {
                let seen = camera.inverse().transform(&point_in_world).z > 1.0;
                if observer != anchor && seen {
                    observations.push([index, anchor, observer]);
                }
            }
        }
    }
    Window { camera, world_from_imu, joint_angles_rad, landmarks, observations }
}

struct Case {
    report: RankReport,
    chain: Chain,
}

fn case(offsets: bool, motion: Motion, joints_free: bool, parameterization: Parameterization) -> Case {
    let classical = mechanism(offsets);
    let window = window(&classical, motion);
    let chain = Chain::from_classical(&classical, parameterization);
    let linearization = window.linearize(&chain, joints_free);
    let report = analyse(&linearization, &chain, &window.joint_angles_rad, joints_free).unwrap();
    Case { report, chain }
}

fn deficits(report: &RankReport) -> [usize; 4] {
    [report.deficit_parameterization, report.deficit_joints, report.deficit_absorbed, report.deficit_motion]
}

#[test]
fn every_rank_loss_is_attributed_to_its_cause() {
    // Offsets, motion, free joints; the deficits of the minimal parameterization. The classical one has six more of the
    // parameterization.
    let table = [
        (true, Motion::Exciting, false, [0, 0, 0, 0]),
        (true, Motion::Exciting, true, [0, 0, 3, 0]),
        (false, Motion::Exciting, false, [0, 0, 0, 0]),
        (false, Motion::Exciting, true, [0, 0, 9, 0]),
        (true, Motion::NeverRotates, false, [0, 0, 0, 3]),
        (true, Motion::Hover, false, [0, 0, 0, 7]),
        (true, Motion::CameraNeverRotates, false, [0, 0, 0, 3]),
        (true, Motion::JointFrozen, false, [0, 4, 0, 0]),
        (true, Motion::AllJointsFrozen, false, [0, 12, 0, 0]),
        (true, Motion::JointFrozen, true, [0, 4, 3, 0]),
    ];
    for (offsets, motion, joints_free, expected) in table {
        for parameterization in [Parameterization::Minimal, Parameterization::Poe, Parameterization::Classical] {
            let Case { report, chain } = case(offsets, motion, joints_free, parameterization);
            let redundant = chain.dof() - 18;
            let context = format!(
                "{motion:?}, free {joints_free}, offsets {offsets}, {parameterization}: {}",
                report.verdict(&ParameterNames::default())
            );
            assert_eq!(deficits(&report), [redundant, expected[1], expected[2], expected[3]], "{context}");
            assert_eq!(report.rank_structural, 18 - expected.iter().sum::<usize>(), "{context}");
            let structural = report.directions.iter().filter(|direction| direction.structural).count();
            assert_eq!(structural, chain.dof() - report.rank_structural, "{context}");
            let weak = report.directions.len() - structural;
            assert_eq!(weak, report.rank_structural - report.rank_informed, "{context}");
            for direction in &report.directions {
                let norm = direction.weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
                assert!((norm - 1.0).abs() < 1e-9, "{context}");
            }
        }
    }
}

#[test]
fn excluded_parameters_leave_the_null_directions() {
    let null_names = |case: &Case| -> Vec<String> {
        let parameters = &case.report.parameters;
        let structural = case.report.directions.iter().filter(|direction| direction.structural);
        let mut found: Vec<String> = structural
            .flat_map(|direction| parameters.iter().zip(&direction.weights).filter(|(_, weight)| weight.abs() > 1e-6))
            .map(|(parameter, _)| ParameterNames::default().name(*parameter))
            .collect();
        found.sort();
        found.dedup();
        found
    };
    let minimal = Parameterization::Minimal;
    let free = case(true, Motion::Exciting, true, minimal);
    assert_eq!(null_names(&free), ["L1.theta", "L2.theta", "L3.theta"]);
    for direction in free.report.directions.iter().filter(|direction| direction.structural) {
        assert_eq!(direction.weights.iter().filter(|weight| **weight != 0.0).count(), 1, "{direction:?}");
    }
    assert_eq!(null_names(&case(true, Motion::NeverRotates, false, minimal)), ["I.tx", "I.ty", "L1.d"]);
    assert_eq!(null_names(&case(true, Motion::CameraNeverRotates, false, minimal)), ["L3.a", "L3.d", "L3.y"]);
    // The summary of a weak window names its least observable parameter.
    let verdict = case(true, Motion::Exciting, false, Parameterization::Classical).report;
    let names = ParameterNames::default();
    let verdict = verdict.verdict(&names);
    assert_eq!(verdict, "structural rank 18 of 24; 6 redundant in the parameterization; informed rank 18");
    let hover = case(true, Motion::Hover, true, minimal).report;
    let weak = hover.rank_structural - hover.rank_informed;
    let expected = format!(
        "structural rank {} of 18; 3 absorbed by free joint angles; {} lost to the vehicle's motion; informed rank {}",
        hover.rank_structural, hover.deficit_motion, hover.rank_informed
    );
    let expected = match hover.least_observable() {
        Some(parameter) if weak > 0 => format!("{expected}; least observable {}", names.name(parameter)),
        _ => expected,
    };
    assert_eq!(hover.verdict(&names), expected);
}

#[test]
fn moving_along_a_redundant_direction_keeps_the_camera_pose() {
    let Case { report, chain } = case(true, Motion::Exciting, false, Parameterization::Classical);
    let parameters = chain.parameters();
    let mut random = Random::new(43);
    for direction in report.directions.iter().filter(|direction| direction.structural) {
        let step = DVector::from_fn(24, |index, _| direction.weights[index] * parameters[index].scale());
        let angles = random.angles(3);
        let shift = |scale: f64| {
            let moved = chain.plus(&(&step * scale)).imu_from_camera(&angles);
            moved.minus(&chain.imu_from_camera(&angles)).norm()
        };
        assert!(shift(1e-4) < 1e-8, "{}", shift(1e-4));
        // Each parameter alone moves the camera by much more.
        let leading = direction.leading(&report.parameters).unwrap();
        let index = report.parameters.iter().position(|parameter| *parameter == leading).unwrap();
        let mut alone = DVector::zeros(24);
        alone[index] = step[index] * 1e-4;
        let moved = chain.plus(&alone).imu_from_camera(&angles).minus(&chain.imu_from_camera(&angles)).norm();
        assert!(moved > 1e-7, "{leading:?}: {moved}");
    }
}

#[test]
fn known_and_measured_redundancy_agree() {
    let classical = mechanism(true);
    let window = window(&classical, Motion::Exciting);
    let chain = Chain::from_classical(&classical, Parameterization::Classical);
    let linearization = window.linearize(&chain, false);
    let report = analyse(&linearization, &chain, &window.joint_angles_rad, false).unwrap();
    assert_eq!((report.known.len(), report.known_agreeing()), (6, 6), "{:?}", report.known);
    let reasons: Vec<String> =
        report.known.iter().map(|known| known.loss.reason(3, &ParameterNames::default())).collect();
    assert_eq!(
        reasons[1],
        "L1.d and the translation of imu_from_base along that axis are the same motion (Eqs. 11–17)"
    );
    assert!(reasons[3].starts_with("L3.d and"), "{reasons:?}");
    // A linearization at two values of the calibration has spurious information.
    let elsewhere = chain.plus(&DVector::from_element(24, 0.02));
    let mixed = window.linearize(&elsewhere, false);
    let mut inconsistent = linearization.clone();
    let half = inconsistent.jacobian.nrows() / 2;
    inconsistent.jacobian.rows_mut(0, half).copy_from(&mixed.jacobian.rows(0, half));
    let report = analyse(&inconsistent, &chain, &window.joint_angles_rad, false).unwrap();
    assert!(report.rank_structural > 18, "{}", report.verdict(&ParameterNames::default()));
    let wrong: Vec<_> = report.known.iter().filter(|known| !known.agrees).collect();
    assert!(!wrong.is_empty() && wrong.iter().any(|known| known.response > 1e-6), "{:?}", report.known);
    // A prior linearized there adds spurious information; the rig's prior and one linearized here do not.
    let claimed = |prior_jacobian: &DMatrix<f64>, rig_prior_rows: usize| {
        let with_prior =
            Linearization { prior_jacobian: prior_jacobian.clone(), rig_prior_rows, ..linearization.clone() };
        analyse(&with_prior, &chain, &window.joint_angles_rad, false).unwrap().known
    };
    assert!(claimed(&linearization.jacobian, 0).iter().all(|known| known.spurious_gain < 1e-3));
    let spurious_gains = claimed(&mixed.jacobian, 0);
    assert!(spurious_gains.iter().filter(|known| known.is_claimed()).count() >= 3, "{spurious_gains:?}");
    let rig_prior = DMatrix::identity(24, mixed.jacobian.ncols()) * 100.0;
    assert!(claimed(&rig_prior, 24).iter().all(|known| known.spurious_gain < 1e-3));
    // The minimal parameterization has no null direction; without encoders it has the null directions of its offsets.
    let minimal = Chain::from_classical(&classical, Parameterization::Minimal);
    let known = |joints_free: bool| {
        let linearization = window.linearize(&minimal, joints_free);
        analyse(&linearization, &minimal, &window.joint_angles_rad, joints_free).unwrap().known
    };
    assert!(known(false).is_empty());
    let free = known(true);
    let losses: Vec<_> = free.iter().map(|known| known.loss).collect();
    assert_eq!(losses, [0, 1, 2].map(KnownLoss::FreeAngle));
    assert!(free.iter().all(|known| known.agrees), "{free:?}");
    // Without offsets and encoders all six directions of the classical parameterization remain, with encoders four.
    let without = Chain::from_classical(&classical, Parameterization::Classical).without_joint_offsets();
    for (joints_free, count) in [(true, 6), (false, 4)] {
        let linearization = window.linearize(&without, joints_free);
        let report = analyse(&linearization, &without, &window.joint_angles_rad, joints_free).unwrap();
        assert_eq!((report.known.len(), report.known_agreeing()), (count, count), "{:?}", report.known);
    }
}

#[test]
fn parallel_neighbouring_axes_lose_the_predicted_directions() {
    for (name, expected) in [
        ("parallel axes", &[KnownLoss::ParallelD(0)][..]),
        ("coaxial axes", &[KnownLoss::ParallelD(0), KnownLoss::CoaxialTheta(0)]),
    ] {
        let (_, classical) = special_chains().into_iter().find(|(known, _)| *known == name).unwrap();
        let window = window(&classical, Motion::Exciting);
        let chain = Chain::from_classical(&classical, Parameterization::Minimal);
        let linearization = window.linearize(&chain, false);
        let report = analyse(&linearization, &chain, &window.joint_angles_rad, false).unwrap();
        let losses: Vec<_> = report.known.iter().map(|known| known.loss).collect();
        assert_eq!(losses, expected, "{name}");
        assert_eq!(report.known_agreeing(), losses.len(), "{name}: {:?}", report.known);
        assert_eq!(
            report.deficit_parameterization,
            losses.len(),
            "{name}: {}",
            report.verdict(&ParameterNames::default())
        );
    }
}

#[test]
fn priors_and_scales_add_up() {
    let classical = mechanism(true);
    let window = window(&classical, Motion::Hover);
    let chain = Chain::from_classical(&classical, Parameterization::Minimal);
    let mut linearization = window.linearize(&chain, false);
    let sigma = |parameter: &ParameterId| if parameter.dimension() == Dimension::Angle { 0.01 } else { 0.003 };
    let sigmas: Vec<f64> = chain.parameters().iter().map(sigma).collect();
    linearization.prior_jacobian =
        DMatrix::from_diagonal(&DVector::from_iterator(18, sigmas.iter().map(|sigma| 1.0 / sigma)));
    let scaling = ScalingRule::PriorSigmas(sigmas);
    let report = analyse_with_scaling(&linearization, &chain, &window.joint_angles_rad, false, &scaling).unwrap();
    assert_eq!(report.rank_structural, 11);
    // In units of the prior, the prior adds one to each squared singular value.
    for (with, without) in report.singular_values_with_priors.iter().zip(&report.singular_values) {
        assert!((with.powi(2) - without.powi(2) - 1.0).abs() < 1e-6 * with.powi(2), "{with} {without}");
    }
    let fixed = analyse(&linearization, &chain, &window.joint_angles_rad, false).unwrap();
    assert_eq!(fixed.rank_structural, report.rank_structural);
    assert!(fixed.rank_informed >= report.rank_informed);
}
