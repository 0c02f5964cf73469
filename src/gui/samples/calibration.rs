//! Calibration and rank of the artificial recording.

use super::yard::{FIRST_TRACKED_FRAME, RandomNumbers};
use crate::estimator::CalibrationEstimate;
use crate::geometry::{Dimension, RigidTransform, so3};
use crate::gimbal::{ClassicalChain, DhLink, ParameterId, ParameterPart, Quantity, Singularity};
use crate::observability::{CalibrationDirection, RankReport};

/// Singularity margins of the artificial calibration.
const MARGINS: [(Singularity, f64); 3] =
    [(Singularity::Base, 0.98), (Singularity::End, 0.93), (Singularity::ParallelAxes(1), 0.99)];

/// The calibration at a frame: the given chain at first, then converging to the ground truth, faster for angles than
/// for lengths, with a decreasing σ.
pub(crate) fn calibration_at(
    name: &str,
    index: usize,
    given: &ClassicalChain,
    ground_truth: &ClassicalChain,
) -> CalibrationEstimate {
    let age_s = index.saturating_sub(FIRST_TRACKED_FRAME) as f64 * 0.05;
    let mixed = mix(given, ground_truth, (-age_s / 2.0).exp());
    let (parameters, values): (Vec<ParameterId>, Vec<f64>) =
        if name == "classical" { classical_values(&mixed) } else { minimal_values(&mixed) }.into_iter().unzip();
    let is_angle = |parameter: &ParameterId| parameter.dimension() == Dimension::Angle;
    let prior_sigmas: Vec<f64> =
        parameters.iter().map(|parameter| if is_angle(parameter) { 0.015 } else { 0.0035 }).collect();
    let mut random_numbers = RandomNumbers::new(index as u64 + 100);
    let waiting = index < FIRST_TRACKED_FRAME;
    let sigmas: Vec<f64> = prior_sigmas
        .iter()
        .zip(&parameters)
        .map(|(prior, parameter)| {
            let speed = if is_angle(parameter) { 2.5 } else { 0.5 };
            if waiting { f64::NAN } else { prior / (1.0 + speed * age_s).sqrt() }
        })
        .collect();
    let values = values
        .iter()
        .zip(&sigmas)
        .map(|(value, sigma)| value + if waiting { 0.0 } else { 0.15 * sigma * random_numbers.normal() })
        .collect();
    CalibrationEstimate {
        parameterization: if name == "auto" { "minimal".to_owned() } else { name.to_owned() },
        parameters,
        values,
        sigmas,
        prior_sigmas,
        classical: mixed,
        margins: MARGINS.to_vec(),
        rigid_cameras: Vec::new(),
    }
}

/// The rank at a frame: structural rank at once, informed directions one after the other.
pub(crate) fn rank_at(parameters: &[ParameterId], index: usize) -> RankReport {
    let columns = parameters.len();
    let redundant = if columns == 24 { 6 } else { 0 };
    let structural = columns - redundant;
    let age_s = index.saturating_sub(FIRST_TRACKED_FRAME) as f64 * 0.05;
    let reference = 420.0;
    let singular_values: Vec<f64> = (0..columns)
        .map(|rank| {
            if rank >= structural {
                return 1e-14 * (columns - rank) as f64;
            }
            60.0 * (-0.45 * rank as f64).exp() * (0.25 + 0.3 * age_s)
        })
        .collect();
    let informed = singular_values.iter().filter(|value| **value >= 1.0).count();
    let directions = (informed..columns)
        .rev()
        .map(|rank| {
            let mut weights = vec![0.0; columns];
            let mut random_numbers = RandomNumbers::new(rank as u64 * 977);
            for entry in 0..3 {
                weights[(rank * 5 + entry * 7) % columns] =
                    if entry == 0 { 1.0 } else { 1.4 * random_numbers.unit() - 0.7 };
            }
            let norm = weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
            CalibrationDirection {
                singular_value: singular_values[rank],
                structural: rank >= structural,
                weights: weights.iter().map(|weight| weight / norm).collect(),
            }
        })
        .collect();
    RankReport {
        parameters: parameters.to_vec(),
        fixed_parameters: Vec::new(),
        singular_values_with_priors: singular_values.iter().map(|value| (value * value + 1.0).sqrt()).collect(),
        singular_values,
        reference,
        structural_threshold: 3e-11 * reference,
        informed_threshold: 1.0,
        rank_structural: structural,
        rank_informed: informed,
        deficit_parameterization: redundant,
        deficit_joints: 0,
        deficit_absorbed: 0,
        deficit_motion: 0,
        directions,
        known: Vec::new(),
        posterior: crate::observability::PackedFactor::default(),
        joint_count: parameters.iter().filter(|parameter| parameter.quantity == Quantity::A).count(),
        margins: MARGINS.to_vec(),
    }
}

fn mix(given: &ClassicalChain, ground_truth: &ClassicalChain, weight_of_given: f64) -> ClassicalChain {
    let pose = |given: &RigidTransform, ground_truth: &RigidTransform| {
        ground_truth.plus(&(given.minus(ground_truth) * weight_of_given))
    };
    let number = |given: f64, ground_truth: f64| ground_truth + (given - ground_truth) * weight_of_given;
    ClassicalChain {
        imu_from_base: pose(&given.imu_from_base, &ground_truth.imu_from_base),
        links: given
            .links
            .iter()
            .zip(&ground_truth.links)
            .map(|(given, ground_truth)| DhLink {
                theta_offset_rad: number(given.theta_offset_rad, ground_truth.theta_offset_rad),
                d_m: number(given.d_m, ground_truth.d_m),
                a_m: number(given.a_m, ground_truth.a_m),
                alpha_rad: number(given.alpha_rad, ground_truth.alpha_rad),
            })
            .collect(),
        effector_from_camera: pose(&given.effector_from_camera, &ground_truth.effector_from_camera),
    }
}

/// Parameters and values of the classical parameterization.
fn classical_values(chain: &ClassicalChain) -> Vec<(ParameterId, f64)> {
    let mut entries = pose_entries(ParameterPart::ImuFromBase, &chain.imu_from_base);
    for (number, link) in (0..).zip(&chain.links) {
        entries.extend(link_entries(number, link));
    }
    entries.extend(pose_entries(ParameterPart::EffectorFromCamera, &chain.effector_from_camera));
    entries
}

/// Parameters and values of the minimal parameterization (docs/mathematics.md, section 5), three links, away from
/// singularities.
fn minimal_values(chain: &ClassicalChain) -> Vec<(ParameterId, f64)> {
    let base = chain.imu_from_base.rotation_matrix();
    let (rx, ry) = ((-base[(1, 2)]).atan2(base[(2, 2)]), base[(0, 2)].atan2(base[(1, 2)].hypot(base[(2, 2)])));
    let psi = (-base[(0, 1)]).atan2(base[(0, 0)]);
    let tilt = so3::exp(&nalgebra::Vector3::new(rx, 0.0, 0.0)) * so3::exp(&nalgebra::Vector3::new(0.0, ry, 0.0));
    let shift = tilt.inverse() * chain.imu_from_base.translation_m;
    let mut links = chain.links.clone();
    links[0].theta_offset_rad += psi;
    links[0].d_m += shift.z;
    let end = links[2];
    let rotation = RigidTransform::new(
        so3::exp(&nalgebra::Vector3::new(0.0, 0.0, end.theta_offset_rad)),
        nalgebra::Vector3::new(0.0, 0.0, end.d_m),
    );
    let twist = RigidTransform::new(
        so3::exp(&nalgebra::Vector3::new(end.alpha_rad, 0.0, 0.0)),
        nalgebra::Vector3::new(end.a_m, 0.0, 0.0),
    );
    let last = rotation * twist * chain.effector_from_camera;
    let matrix = last.rotation_matrix();
    let cosine = matrix[(0, 1)].hypot(matrix[(1, 1)]);
    let theta = (-matrix[(0, 1)]).atan2(matrix[(1, 1)]);
    let alpha = matrix[(2, 1)].atan2(cosine);
    let beta = (-matrix[(2, 0)]).atan2(matrix[(2, 2)]);
    let lengths = so3::exp(&nalgebra::Vector3::new(0.0, 0.0, -theta)) * last.translation_m;
    let y = lengths.y / cosine;
    links[2] = DhLink { theta_offset_rad: theta, d_m: lengths.z - y * alpha.sin(), a_m: lengths.x, alpha_rad: alpha };
    let base = [(Quantity::Rx, rx), (Quantity::Ry, ry), (Quantity::Tx, shift.x), (Quantity::Ty, shift.y)];
    let mut entries: Vec<_> =
        base.map(|(quantity, value)| (ParameterId { part: ParameterPart::Base, quantity }, value)).into();
    for (number, link) in (0..).zip(&links) {
        entries.extend(link_entries(number, link));
    }
    for (quantity, value) in [(Quantity::Beta, beta), (Quantity::Y, y)] {
        entries.push((ParameterId { part: ParameterPart::Link(2), quantity }, value));
    }
    entries
}

fn link_entries(number: u8, link: &DhLink) -> impl Iterator<Item = (ParameterId, f64)> {
    let part = ParameterPart::Link(number);
    let values = [link.theta_offset_rad, link.d_m, link.a_m, link.alpha_rad];
    Quantity::LINK.map(|quantity| ParameterId { part, quantity }).into_iter().zip(values)
}

fn pose_entries(part: ParameterPart, pose: &RigidTransform) -> Vec<(ParameterId, f64)> {
    let (rotation, shift) = (so3::log(&pose.rotation), pose.translation_m);
    let values = [rotation.x, rotation.y, rotation.z, shift.x, shift.y, shift.z];
    Quantity::TRANSFORM.map(|quantity| ParameterId { part, quantity }).into_iter().zip(values).collect()
}
