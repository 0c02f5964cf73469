use std::ops::ControlFlow;

use nalgebra::DMatrix;

use super::super::{LaboratoryJoint, Mechanism, Situation};
use super::objective::Objective;
use super::windows::{WindowLayout, information_of_frames, information_of_window, sum, trajectory};
use super::{MotionLimits, MotionPlan, MotionPlanError, PlanCriterion, PlanOptions, plan_by_hand, plan_motion, starts};
use crate::camera::CameraModel;
use crate::estimator::EstimatorConfig;
use crate::geometry::SplitMix64;
use crate::gimbal::Parameterization;
use crate::simulation::{MotionSplines, SyntheticOptions, synthetic_tracks};

/// Situation before a flight with a named mechanism, a prior of 3 cm and 10°, and encoders of this σ.
fn situation(mechanism: &str, encoder_sigma_rad: Option<f64>) -> Situation {
    let rig = synthetic_tracks(&SyntheticOptions { duration_s: 0.5, ..SyntheticOptions::default() }).given_rig;
    let mechanism = Mechanism::named(mechanism).unwrap();
    let config = EstimatorConfig {
        chain: mechanism.chain.clone(),
        chain_prior: Some((0.03, 10_f64.to_radians())),
        camera: CameraModel::pinhole([460.0, 460.0, 320.0, 240.0], [640, 480]).unwrap(),
        ..EstimatorConfig::for_camera(&rig, "cam0", Parameterization::Minimal).unwrap()
    };
    let joints: Vec<LaboratoryJoint> =
        mechanism.joints.into_iter().map(|joint| LaboratoryJoint { limits_rad: (-0.8, 0.8), ..joint }).collect();
    Situation::before_flight(&config, joints, mechanism.names, encoder_sigma_rad, vec![4.0, 6.0, 9.0]).unwrap()
}

fn options(situation: &Situation, trials: usize) -> PlanOptions {
    PlanOptions {
        duration_s: 8.0,
        criterion: PlanCriterion::Worst,
        parameters: Vec::new(),
        limits: MotionLimits::slow(situation.joints.iter().map(|joint| joint.limits_rad).collect()),
        starts: 3,
        trials,
        seed: 5,
    }
}

fn plan(situation: &Situation, options: &PlanOptions, threads: usize) -> MotionPlan {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| plan_motion(situation, options, &|_| ControlFlow::Continue(()))).unwrap()
}

fn values(motion: &MotionSplines) -> Vec<f64> {
    (0..motion.channel_count())
        .flat_map(|channel| (0..=80).map(move |step| (channel, step)))
        .map(|(channel, step)| motion.value(channel, 0.1 * f64::from(step), 0))
        .collect()
}

#[test]
fn a_planned_motion_beats_the_listed_ones_within_the_limits_on_any_number_of_threads() {
    let situation = situation("pan-tilt", Some(0.5_f64.to_radians()));
    let options = options(&situation, 60);
    let planned = plan(&situation, &options, 1);
    let again = plan(&situation, &options, 3);
    assert_eq!(values(&planned.motion), values(&again.motion));
    assert_eq!((planned.value, &planned.sigmas), (again.value, &again.sigmas));
    let listed = planned.listed.as_ref().unwrap();
    assert!(planned.value < 0.9 * listed.value, "{planned}");
    let best = &planned.starts[0];
    assert!(best.after < best.before && best.after == planned.value, "{planned}");
    assert!(planned.limits.iter().all(super::ReachedLimit::is_kept), "{planned}");
    // Limits of a motion that is as fast as allowed are tight.
    assert!(planned.limits.iter().any(|limit| limit.reached > 0.7 * limit.limit), "{planned}");
    // σ starts at the prior, ends at the plan's and never grows by more than the landmarks of a new window.
    let (first, last) = (planned.sigmas.first().unwrap(), planned.sigmas.last().unwrap());
    assert_eq!((first.time_s, last.time_s), (0.0, 8.0));
    assert!(first.sigmas.iter().all(|(_, ratio)| (ratio - 1.0).abs() < 1e-9));
    for (parameter, (sigma, _)) in planned.table.parameters.iter().zip(&last.sigmas) {
        assert!((parameter.sigma / sigma - 1.0).abs() < 1e-9);
    }
    for pair in planned.sigmas.windows(2) {
        for ((before, _), (after, _)) in pair[0].sigmas.iter().zip(&pair[1].sigmas) {
            assert!(after <= &(before * 1.02), "{before} {after} at {}", pair[1].time_s);
        }
    }
}

#[test]
fn chosen_parameters_decide_the_plan() {
    let situation = situation("pan-tilt", Some(0.5_f64.to_radians()));
    let all = plan(&situation, &options(&situation, 60), 2);
    let names: Vec<&str> = all.table.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
    let column = names.iter().position(|name| *name == all.table.worst).unwrap();
    let chosen = PlanOptions { parameters: vec![situation.chain.parameters()[column]], ..options(&situation, 60) };
    let one = plan(&situation, &chosen, 2);
    assert!(one.table.parameters[column].ratio < all.table.parameters[column].ratio, "{all}\n{one}");
    assert_eq!(one.table.parameters.iter().filter(|parameter| parameter.matters).count(), 1);
    let determinant = PlanOptions { criterion: PlanCriterion::Determinant, ..options(&situation, 60) };
    let determinant = plan(&situation, &determinant, 2);
    assert!(determinant.value < determinant.table.worst_ratio, "{determinant}");
}

#[test]
fn redundant_and_absorbed_parameters_are_no_part_of_the_criterion() {
    // Without encoders the joints absorb nine directions of an ideal gimbal.
    let ideal = situation("yaw-roll-pitch-ideal", None);
    let objective = Objective::new(&ideal, PlanCriterion::Worst, &[]).unwrap();
    let nothing = DMatrix::zeros(ideal.information.nrows(), ideal.information.ncols());
    assert!((objective.value(&nothing).unwrap() - 1.0).abs() < 1e-9);
    let much = DMatrix::identity(ideal.information.nrows(), ideal.information.ncols()) * 1e6;
    assert!(objective.value(&much).unwrap() < 0.05);
    let (prior, _) = objective.sigmas(&nothing).unwrap();
    assert_eq!(prior.len(), ideal.chain.parameters().len());
}

#[test]
fn a_plan_that_cannot_be_made_says_why() {
    let situation = situation("pan-tilt", Some(0.01));
    let given = PlanOptions { duration_s: 3.0, ..options(&situation, 1) };
    assert_eq!(plan_by_hand(&situation, &given).unwrap_err(), MotionPlanError::Duration { given: 3.0 });
    let stopped = plan_motion(&situation, &options(&situation, 5), &|_| ControlFlow::Break(()));
    assert_eq!(stopped.unwrap_err(), MotionPlanError::Interrupted);
}

#[test]
fn moves_by_hand_lower_sigma_step_by_step() {
    let situation = situation("yaw-roll-pitch-offset", Some(0.5_f64.to_radians()));
    let options = PlanOptions { duration_s: 12.0, ..options(&situation, 1) };
    let by_hand = plan_by_hand(&situation, &options).unwrap();
    assert_eq!((by_hand.steps.len(), by_hand.sigmas.len()), (3, 4));
    assert!(by_hand.steps[0].value < 1.0);
    for pair in by_hand.steps.windows(2) {
        assert!(pair[1].value < pair[0].value, "{by_hand}");
    }
    assert!(by_hand.steps.iter().any(|step| step.words.contains("more slowly")), "{by_hand}");
    assert_eq!(by_hand.steps.last().unwrap().worst_ratio, by_hand.table.worst_ratio);
}

#[test]
fn the_information_of_consecutive_windows_adds_up() {
    let situation = situation("yaw-roll-pitch-offset", Some(0.5_f64.to_radians()));
    let limits = MotionLimits::slow(situation.joints.iter().map(|joint| joint.limits_rad).collect());
    let motion = starts::random(&situation, &limits, 8.0, &mut SplitMix64::new(1));
    let flight = trajectory(&situation, &motion);
    let layout = WindowLayout::fine(8.0);
    let windows: Vec<DMatrix<f64>> = (0..layout.count)
        .map(|window| information_of_window(&situation, &motion, &flight, &layout, window).unwrap())
        .collect();
    let added = sum(&windows, situation.information.ncols());
    let times_s: Vec<f64> = (0..layout.count).flat_map(|window| layout.times_s(window)).collect();
    let long = information_of_frames(&situation, &motion, &flight, &times_s, layout.landmarks).unwrap();
    let objective = Objective::new(&situation, PlanCriterion::Worst, &[]).unwrap();
    let (_, added) = objective.sigmas(&added).unwrap();
    let (_, long) = objective.sigmas(&long).unwrap();
    // One long window knows more: velocity and biases at the middle, landmarks on both sides of it.
    let excess: Vec<f64> = added.iter().zip(&long).map(|(added, long)| added / long - 1.0).collect();
    assert!(excess.iter().all(|excess| (0.0..0.5).contains(excess)), "{excess:.3?}");
    let mean = excess.iter().sum::<f64>() / excess.len() as f64;
    assert!(mean < 0.25, "{excess:.3?}");
}
