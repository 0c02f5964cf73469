//! Calibration and rank of the artificial recording.

use super::yard::{FIRST_TRACKED_FRAME, RandomNumbers};
use crate::estimator::CalibrationEstimate;
use crate::geometry::{Dimension, RigidTransform};
use crate::gimbal::{Chain, ClassicalChain, DhLink, ParameterId, Parameterization, Quantity, Singularity};
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
    let parameterization = if name == "classical" { Parameterization::Classical } else { Parameterization::Minimal };
    let chain = Chain::from_classical(&mixed, parameterization);
    let parameters = chain.parameters();
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
    let values = chain
        .values()
        .iter()
        .zip(&sigmas)
        .map(|(value, sigma)| value + if waiting { 0.0 } else { 0.15 * sigma * random_numbers.normal() })
        .collect();
    CalibrationEstimate {
        parameterization,
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
