use std::ops::ControlFlow;

use nalgebra::{DMatrix, Vector3};

use super::super::{LaboratoryJoint, Mechanism, Situation};
use super::admitted::RepeatedMove;
use super::keyframes::keyframe_times_s;
use super::objective::Objective;
use super::search::SearchProblem;
use super::windows::{WindowLayout, WindowRows, joined, rows_of_interval, rows_of_keyframes, trajectory};
use super::{
    EnteredLimits, LONGEST_MOTION_S, MotionLimits, MotionPlan, MotionPlanError, MotionPredictor, MotionProblem,
    MotionStart, PlanCriterion, PlanOptions, SufficientMotion, move_point, plan_by_hand, plan_motion, starts,
    sufficient_motion,
};
use crate::camera::CameraModel;
use crate::estimator::EstimatorConfig;
use crate::geometry::SplitMix64;
use crate::gimbal::Parameterization;
use crate::observability::Determination;
use crate::sensors::RequiredAccuracy;
use crate::simulation::{MotionSplines, SyntheticOptions, synthetic_tracks};

/// Situation before a flight with a named mechanism, a prior of 3 cm and 10°, and encoders of this σ.
fn situation(mechanism: &str, encoder_sigma_rad: Option<f64>) -> Situation {
    situation_in(Parameterization::Minimal, mechanism, encoder_sigma_rad)
}

fn situation_in(form: Parameterization, mechanism: &str, encoder_sigma_rad: Option<f64>) -> Situation {
    let rig = synthetic_tracks(&SyntheticOptions { duration_s: 0.5, ..SyntheticOptions::default() }).given_rig;
    let mechanism = Mechanism::named(mechanism).unwrap();
    let config = EstimatorConfig {
        chain: mechanism.chain.clone(),
        chain_prior: Some((0.03, 10_f64.to_radians())),
        camera: CameraModel::pinhole([460.0, 460.0, 320.0, 240.0], [640, 480]).unwrap(),
        ..EstimatorConfig::for_camera(&rig, "cam0", form).unwrap()
    };
    let joints: Vec<LaboratoryJoint> =
        mechanism.joints.into_iter().map(|joint| LaboratoryJoint { limits_rad: (-0.8, 0.8), ..joint }).collect();
    Situation::before_flight(&config, joints, mechanism.names, encoder_sigma_rad, vec![4.0, 6.0, 9.0], 0.05).unwrap()
}

fn options(situation: &Situation, trials: usize) -> PlanOptions {
    PlanOptions {
        duration_s: 8.0,
        criterion: PlanCriterion::Worst,
        parameters: Vec::new(),
        limits: EnteredLimits::SLOW.of_joints(situation.joints.iter().map(|joint| joint.limits_rad).collect()),
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
    // σ starts at the prior, ends at the plan's and never grows.
    let (first, last) = (planned.sigmas.first().unwrap(), planned.sigmas.last().unwrap());
    assert_eq!((first.time_s, last.time_s), (0.0, 8.0));
    assert!(first.sigmas.iter().all(|(_, ratio)| (ratio - 1.0).abs() < 1e-9));
    for (parameter, (sigma, _)) in planned.table.parameters.iter().zip(&last.sigmas) {
        assert!((parameter.sigma / sigma - 1.0).abs() < 1e-9);
    }
    for pair in planned.sigmas.windows(2) {
        for ((before, _), (after, _)) in pair[0].sigmas.iter().zip(&pair[1].sigmas) {
            assert!(after <= &(before * (1.0 + 1e-6)), "{before} {after} at {}", pair[1].time_s);
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
    assert!(by_hand.steps.iter().any(|step| step.words.contains(" and back")), "{by_hand}");
    assert_eq!(by_hand.steps.last().unwrap().worst_ratio, by_hand.table.worst_ratio);
    let exceeded = |limits: &MotionLimits, motion: &MotionSplines| -> Vec<String> {
        let reached = limits.compare(motion, &situation.joint_names());
        reached.into_iter().filter(|limit| !limit.is_kept()).map(|limit| limit.quantity).collect()
    };
    assert_eq!(exceeded(&options.limits, &by_hand.motion), [""; 0], "{by_hand}");
    // In a small room and with slow joints the moves are smaller, and say so.
    let reach_m = Vector3::repeat(0.3);
    let limits = MotionLimits { reach_m, joint_rate_rad_per_s: 0.2, ..options.limits.clone() };
    let in_room = plan_by_hand(&situation, &PlanOptions { limits: limits.clone(), ..options.clone() }).unwrap();
    assert_eq!(exceeded(&limits, &in_room.motion), [""; 0], "{in_room}");
    assert!(in_room.table.worst_ratio > by_hand.table.worst_ratio, "{in_room}");
    assert!(in_room.steps.iter().all(|step| !step.words.contains("±20°")), "{in_room}");
    let problem = SearchProblem {
        situation: &situation,
        objective: &Objective::new(&situation, PlanCriterion::Worst, &[]).unwrap(),
        limits: &limits,
        layout: WindowLayout::fine(12.0),
    };
    for repeated in RepeatedMove::all(&problem, 12.0) {
        assert_eq!(exceeded(&limits, &repeated.motion), [""; 0], "{:?}", repeated.choice);
    }
}

#[test]
fn joined_windows_equal_one_long_window_but_for_the_landmarks_between_them() {
    let situation = situation("yaw-roll-pitch-offset", Some(0.5_f64.to_radians()));
    let limits = EnteredLimits::SLOW.of_joints(situation.joints.iter().map(|joint| joint.limits_rad).collect());
    let motion = starts::random(&situation, &limits, 8.0, &mut SplitMix64::new(1));
    let flight = trajectory(&situation, &motion);
    let layout = WindowLayout::fine(8.0);
    let columns = situation.information.ncols();
    let rows = |interval_s: [f64; 2]| rows_of_interval(&situation, &motion, &flight, &layout, interval_s).unwrap();
    let windows: Vec<WindowRows> = (0..layout.count).map(|window| rows(layout.interval_s(window))).collect();
    let keyframes = |window| keyframe_times_s(&situation, &motion, &flight, layout.interval_s(window));
    let times_s = [keyframes(0), keyframes(1)].concat();
    assert!((8..=64).contains(&times_s.len()), "{times_s:?}");
    let objective = Objective::new(&situation, PlanCriterion::Worst, &[]).unwrap();
    let sigmas = |information: &DMatrix<f64>| objective.sigmas(information).unwrap().1;
    let excess = |some: &[f64], all: &[f64]| -> Vec<f64> { some.iter().zip(all).map(|(a, b)| a / b - 1.0).collect() };
    let images = 8.0 / situation.image_period_s / times_s.len() as f64;
    let long = rows_of_keyframes(&situation, &motion, &flight, (&times_s, 8.0), (layout.features, images)).unwrap();
    let long = sigmas(&joined([&long], columns));
    let of_joined = excess(&sigmas(&joined(&windows, columns)), &long);
    assert!(of_joined.iter().all(|excess| (-0.1..0.4).contains(excess)), "{of_joined:.3?}");
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    // Without what the first window has measured of velocity and biases, the second one constrains less.
    let apart = joined([&windows[0]], columns) + joined([&windows[1]], columns);
    let of_apart = excess(&sigmas(&apart), &long);
    assert!(mean(&of_joined) < 0.12, "{of_joined:.3?}");
    assert!(mean(&of_joined) < 0.7 * mean(&of_apart), "{of_joined:.3?} {of_apart:.3?}");
    assert!(of_joined.iter().zip(&of_apart).all(|(joined, apart)| joined < apart), "{of_joined:.3?} {of_apart:.3?}");
}

/// Problem of 8 s with its limits, and waves.
fn waves(situation: &Situation) -> (MotionProblem, MotionLimits, MotionSplines) {
    let problem = MotionProblem::new(situation.clone(), 8.0).unwrap();
    let limits = EnteredLimits::SLOW.of_joints(situation.joints.iter().map(|joint| joint.limits_rad).collect());
    let motion = problem.start(MotionStart::Waves, &limits, 8.0);
    (problem, limits, motion)
}

#[test]
fn a_moved_point_moves_the_curve_there_and_linearizes_only_its_windows() {
    let situation = situation("pan-tilt", Some(0.5_f64.to_radians()));
    let (problem, limits, motion) = waves(&situation);
    let mut predictor = MotionPredictor::default();
    let before = predictor.predict(&problem, &motion).unwrap();
    for (index, width_s) in [(7, 0.0), (8, 1.0), (14, 2.0)] {
        let mut moved = motion.clone();
        let time_s = motion.time_of_point(index);
        let change = if motion.value(1, time_s, 0) > 0.0 { -0.1 } else { 0.1 };
        move_point(&mut moved, &limits, (1, index), change, width_s);
        let reached = moved.value(1, time_s, 0) - motion.value(1, time_s, 0);
        assert!((reached - change).abs() < 1e-9, "{reached} at {index}");
        let after = predictor.predict(&problem, &moved).unwrap();
        assert_ne!(before, after);
        // The same bits as without the windows of the last motion.
        assert_eq!(after, MotionPredictor::default().predict(&problem, &moved).unwrap());
        assert!([0, 2].iter().all(|channel| moved.value(*channel, time_s, 0) == motion.value(*channel, time_s, 0)));
    }
    let mut moved = motion.clone();
    moved.set_point(1, 7, moved.point(1, 7) + 0.1);
    let changed = |index: usize| motion.reach_of_point_s(index)[0]..motion.reach_of_point_s(index)[1];
    for step in 0..=160 {
        let time_s = 0.05 * f64::from(step);
        let is_moved = moved.value(1, time_s, 0) != motion.value(1, time_s, 0);
        assert!(changed(7).contains(&time_s) || !is_moved, "{time_s}");
    }
    // The range of the limits holds, and the ends stay at rest.
    move_point(&mut moved, &limits, (0, 8), 10.0, 1.0);
    move_point(&mut moved, &limits, (0, 0), 1.0, 1.0);
    assert!(values(&moved)[..81].iter().all(|angle| *angle <= limits.range(0).1 + 1e-12));
    assert_eq!(moved.value(0, 0.0, 0), motion.value(0, 0.0, 0));
}

#[test]
fn a_search_continues_from_a_motion_and_can_be_stopped() {
    let situation = situation("pan-tilt", Some(0.5_f64.to_radians()));
    let (problem, limits, motion) = waves(&situation);
    let worst =
        |motion: &MotionSplines| MotionPredictor::default().predict(&problem, motion).unwrap().result().worst_ratio;
    let improved = problem.improve(&motion, &limits, 60, &|_, _| ControlFlow::Continue(())).unwrap();
    assert!(worst(&improved) < 0.9 * worst(&motion), "{} {}", worst(&improved), worst(&motion));
    assert!(limits.compare(&improved, &[]).iter().all(super::ReachedLimit::is_kept));
    assert_eq!(improved, problem.improve(&motion, &limits, 60, &|_, _| ControlFlow::Continue(())).unwrap());
    let stopped = problem.improve(&motion, &limits, 60, &|_, _| ControlFlow::Break(())).unwrap();
    assert!(worst(&stopped) <= worst(&motion) + 1e-12);
    // Nothing is left of a motion that stands still.
    let rest = problem.start(MotionStart::AtRest, &limits, 8.0);
    assert!((worst(&rest) - 1.0).abs() < 0.05, "{}", worst(&rest));
}

#[test]
fn information_of_a_flight_adds_to_that_of_a_motion() {
    let situation = situation("pan-tilt", Some(0.5_f64.to_radians()));
    let (problem, _, motion) = waves(&situation);
    let gained = |motion: &MotionSplines| {
        let layout = WindowLayout::fine(8.0);
        let flight = trajectory(&situation, motion);
        let rows = |window| rows_of_interval(&situation, motion, &flight, &layout, layout.interval_s(window)).unwrap();
        let windows: Vec<WindowRows> = (0..layout.count).map(rows).collect();
        joined(&windows, situation.information.ncols())
    };
    let information = &situation.information + gained(&motion);
    let flown = Situation { information, ..situation.clone() };
    let after = problem.after_flight(&flown).unwrap();
    let prediction = MotionPredictor::default().predict(&after, &motion).unwrap();
    let (flight, both) = (prediction.flight.unwrap(), prediction.both.unwrap());
    for ((flight, alone), both) in flight.parameters.iter().zip(&prediction.motion.parameters).zip(&both.parameters) {
        // The flight was this very motion; both together have twice its information.
        assert!((flight.sigma / alone.sigma - 1.0).abs() < 1e-9, "{flight:?} {alone:?}");
        assert!(both.sigma < flight.sigma && both.sigma > 0.7 * flight.sigma, "{both:?}");
        assert_eq!(both.prior_sigma, alone.prior_sigma);
    }
    let other = self::situation("yaw-roll-pitch-offset", None);
    assert!(problem.after_flight(&other).is_none());
}

#[test]
fn parameters_that_a_parameterization_has_twice_are_called_redundant() {
    let verdicts = |form: Parameterization| {
        let situation = situation_in(form, "yaw-roll-pitch-offset", Some(0.5_f64.to_radians()));
        let problem = MotionProblem::new(situation.clone(), 8.0).unwrap();
        let limits = EnteredLimits::SLOW.of_joints(situation.joints.iter().map(|joint| joint.limits_rad).collect());
        let rest = problem.start(MotionStart::AtRest, &limits, 8.0);
        let table = MotionPredictor::default().predict(&problem, &rest).unwrap().motion;
        let count = |verdict| table.parameters.iter().filter(|parameter| parameter.verdict == verdict).count();
        (count(Determination::Redundant), count(Determination::NotDetermined))
    };
    let (redundant, open) = verdicts(Parameterization::Classical);
    assert!(redundant >= 6 && open > 0, "{redundant} redundant, {open} not determined");
    assert_eq!(verdicts(Parameterization::Minimal).0, 0);
}

#[test]
fn moves_end_when_every_parameter_is_as_accurate_as_required() {
    let situation = |translation_m: f64, rotation_deg: f64| Situation {
        required: RequiredAccuracy {
            translation_m,
            rotation_rad: rotation_deg.to_radians(),
            ..RequiredAccuracy::default()
        },
        ..situation("yaw-roll-pitch-offset", Some(0.5_f64.to_radians()))
    };
    let of =
        |situation: &Situation| sufficient_motion(situation, &EnteredLimits::SLOW.around(situation), LONGEST_MOTION_S);
    assert_eq!(of(&situation(1.0, 90.0)), None, "the prior is enough");
    let loose = of(&situation(0.02, 1.0)).expect("a motion");
    assert_eq!(loose.remaining, None, "{loose:?}");
    let strict = of(&situation(0.01, 0.4)).expect("a motion");
    let hopeless = situation(1e-6, 1e-4);
    let longest = of(&hopeless).expect("a motion");
    let durations_s = [&loose, &strict, &longest].map(SufficientMotion::duration_s);
    assert!(durations_s.is_sorted() && durations_s[0] < durations_s[2], "{durations_s:?}");
    assert_eq!(durations_s[2], 40.0);
    for motion in [&loose, &strict, &longest] {
        let sum: f64 = motion.moves.iter().map(|(_, duration_s)| duration_s).sum();
        assert!(sum <= motion.duration_s() + 1e-9 && motion.moves.windows(2).all(|two| two[0].0 != two[1].0));
    }
    let (worst, sigma) = longest.remaining.expect("one micrometre is too little");
    assert!(sigma > hopeless.required.of(worst), "{worst:?}: {sigma}");
}
