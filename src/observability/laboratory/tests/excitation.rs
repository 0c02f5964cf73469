use nalgebra::DVector;

use super::super::{
    Advice, LABORATORY_IMU, LaboratoryForm, LaboratoryMotion, LaboratorySetup, Mechanism, Situation, advise, excitation,
};
use crate::estimator::{Estimator, EstimatorConfig, EstimatorOptions, StepInput, StepReport};
use crate::geometry::seconds_from_ns;
use crate::gimbal::{Chain, Parameterization};
use crate::observability::{RankReport, analyse};
use crate::sensors::{ChainPrior, Rig};
use crate::simulation::{
    Exercise, SyntheticFlight, SyntheticFrame, SyntheticMotion, SyntheticOptions, VehicleSwing, synthetic_tracks,
};

/// Start of the motion, in seconds.
const START_S: f64 = 6.0;
/// Flights are equal up to this time: a spline depends on the next three knots.
const SHARED_S: f64 = START_S - 0.4;
/// Duration of the motion, equal to the duration of the candidates.
const MOTION_S: f64 = super::super::ADVICE_DURATION_S;

pub(super) fn flight(exercise: Exercise, seed: u64) -> SyntheticFlight {
    flight_from(exercise, seed, SyntheticOptions::default().start_error)
}

/// [`flight`] with another error of the given chain.
fn flight_from(exercise: Exercise, seed: u64, start_error: ChainPrior) -> SyntheticFlight {
    synthetic_tracks(&SyntheticOptions {
        seed,
        start_error,
        duration_s: START_S + MOTION_S,
        features: 80,
        motion: SyntheticMotion::Hover,
        look_around_rad: 0.3,
        exercise: Some((START_S, exercise)),
        ..SyntheticOptions::default()
    })
}

pub(super) fn estimator(rig: &Rig, parameterization: Parameterization, use_encoder: bool) -> Estimator {
    Estimator::new(EstimatorConfig {
        use_encoder,
        options: EstimatorOptions { keep_linearization: true, ..EstimatorOptions::default() },
        ..EstimatorConfig::for_camera(rig, "cam0", parameterization).unwrap()
    })
}

/// One step, with its ranks if the linearization is kept.
fn step(estimator: &mut Estimator, frame: &SyntheticFrame) -> (StepReport, Option<RankReport>) {
    let sigma = estimator.config().encoder_sigma_rad.unwrap();
    let joints = frame.encoder_angles(sigma).filter(|_| estimator.config().use_encoder);
    let report = estimator.step(&StepInput {
        frame_index: frame.index,
        stamp_ns: frame.stamp_ns,
        imu: &frame.imu,
        imu_after: &[],
        image_times_s: &[],
        gimbal_imu: &[],
        joint_angles: joints.as_ref(),
        tracks: &frame.tracks,
        further_tracks: &[],
    });
    let rank = report.linearization.as_ref().and_then(|linearization| {
        let angles: Vec<&[f64]> = report.window.iter().map(|frame| frame.joint_angles_rad.as_slice()).collect();
        let calibration = &report.calibration;
        let chain = Chain::from_classical(&calibration.classical, calibration.parameterization);
        let free = !estimator.config().use_encoder;
        let chain = if free { chain.without_joint_offsets() } else { chain };
        analyse(linearization, &chain, &angles, free)
    });
    (report, rank)
}

/// Processes the frames up to a time and returns the last report with its ranks.
pub(super) fn run_flight(
    estimator: &mut Estimator,
    flight: &SyntheticFlight,
    from_s: f64,
    to_s: f64,
) -> (StepReport, RankReport) {
    let time_s = |frame: &SyntheticFrame| seconds_from_ns(frame.stamp_ns);
    let is_inside = |frame: &&SyntheticFrame| time_s(frame) > from_s && time_s(frame) <= to_s;
    let frames: Vec<&SyntheticFrame> = flight.frames.iter().filter(is_inside).collect();
    let (last, before) = frames.split_last().expect("the flight has frames then");
    estimator.set_keep_linearization(false);
    for frame in before {
        step(estimator, frame);
    }
    estimator.set_keep_linearization(true);
    let (report, rank) = step(estimator, last);
    (report, rank.expect("the estimator tracks at the end"))
}

/// Standard deviation along a direction after a step.
fn sigma(rank: &RankReport, direction: &[f64]) -> f64 {
    let direction = DVector::from_column_slice(direction);
    let solved = rank.posterior.information().cholesky().unwrap().solve(&direction);
    direction.dot(&solved).sqrt()
}

/// Runs the chosen ones of the candidates, given with their places, from the same state; returns the advice and, for each
/// motion, the predicted and the estimated ratio of σ along the least observable direction.
fn run_advised(
    seed: u64,
    start_error: ChainPrior,
    is_chosen: impl Fn(usize, &str) -> bool,
) -> (Advice, Vec<(String, f64, f64)>) {
    let rest = Exercise::full(VehicleSwing::Hover, None);
    let warm_up = flight_from(rest, seed, start_error);
    let mut start = estimator(&warm_up.given_rig, Parameterization::Minimal, true);
    let (report, rank) = run_flight(&mut start, &warm_up, -1.0, SHARED_S);
    let situation = Situation::of_step(&report, &rank, &warm_up.given_rig, "cam0").unwrap();
    let advice = advise(&situation).unwrap();
    let before = sigma(&rank, &advice.least_observable.weights);
    assert!((before / advice.least_observable.sigma - 1.0).abs() < 1e-3, "{before} {}", advice.least_observable.sigma);
    let outcomes = advice
        .candidates
        .iter()
        .enumerate()
        .filter(|(place, candidate)| is_chosen(*place, &candidate.words))
        .map(|(_, candidate)| {
            let mut estimator = start.clone();
            let flight = flight_from(candidate.exercise, seed, start_error);
            let (_, rank) = run_flight(&mut estimator, &flight, SHARED_S, START_S + MOTION_S);
            (candidate.words.clone(), candidate.remaining, sigma(&rank, &advice.least_observable.weights) / before)
        })
        .collect();
    (advice, outcomes)
}

#[test]
fn the_suggested_excitation_lowers_the_largest_sigma_most() {
    for seed in [3, 5, 8] {
        check_advice(seed);
    }
}

/// Checks the suggested motion and every fifth of the others.
fn check_advice(seed: u64) {
    let start_error = SyntheticOptions::default().start_error;
    let (advice, outcomes) = run_advised(seed, start_error, |place, _| place % 5 == 0);
    let table: Vec<String> = outcomes
        .iter()
        .map(|(words, predicted, left)| format!("{predicted:.3} predicted, {left:.3} estimated: {words}"))
        .collect();
    let table = format!("seed {seed}: {}\n{}", advice.least_observable, table.join("\n"));
    assert_eq!(advice.candidates.len(), 28, "seven swings of the vehicle with none or one of three joints");
    let (_, first_predicted, best) = &outcomes[0];
    assert!(*best < 0.9, "{table}");
    for (words, predicted, left) in &outcomes {
        assert!((predicted - left).abs() < 0.1, "{words}\n{table}");
        // Predictions within three percent count as equal.
        assert!(*predicted < 1.03 * first_predicted || best < left, "{words}\n{table}");
    }
    let apart = outcomes.iter().filter(|(_, predicted, _)| *predicted >= 1.03 * first_predicted).count();
    assert!(apart >= 3, "{table}");
    assert!(advice.sentence().unwrap().starts_with(&advice.candidates[0].words));
}

#[test]
fn swinging_joints_are_suggested_for_what_they_give_an_inaccurate_chain() {
    // Moving joints make keyframes of a hovering camera if the chain is given inaccurately, and only then.
    let start_error = |rotation_bound_rad| ChainPrior { translation_bound_m: 0.01, rotation_bound_rad };
    let of = |rotation_bound_rad| {
        let (_, outcomes) = run_advised(3, start_error(rotation_bound_rad), |_, words| words.contains("hover"));
        outcomes
    };
    let (inaccurate, accurate) = (of(0.17), of(0.02));
    let table = format!("inaccurate {inaccurate:#?}, accurate {accurate:#?}");
    assert!(inaccurate.len() == 4 && accurate.len() == 4, "{table}");
    let least = |outcomes: &[(String, f64, f64)]| {
        outcomes.iter().fold([1.0_f64; 2], |[by_advice, by_run], (_, predicted, left)| {
            [by_advice.min(*predicted), by_run.min(*left)]
        })
    };
    assert!(least(&inaccurate).into_iter().all(|remaining| remaining < 0.95), "{table}");
    assert!(least(&accurate).into_iter().all(|remaining| remaining > 0.95), "{table}");
}

#[test]
fn advice_is_repeatable_and_rendered_as_text() {
    let mut setup = LaboratorySetup::new(Mechanism::named("yaw-roll-pitch-offset").unwrap());
    setup.motion = LaboratoryMotion::Hover;
    let form = LaboratoryForm::whole(Parameterization::Minimal);
    let situation = Situation::of_experiment(&setup, form, LABORATORY_IMU).unwrap();
    let advice = advise(&situation).unwrap();
    assert_eq!(advice, advise(&situation).unwrap());
    // Hover does not constrain lever arms on the IMU side, and a camera that does not translate makes no
    // keyframes: more hover gains nothing, a moving vehicle does.
    let hover = advice.candidates.iter().find(|candidate| candidate.words == "hover, gimbal fixed").unwrap();
    assert!(hover.remaining > 0.999, "{advice}");
    assert!(!advice.candidates[0].words.contains("hover"), "{advice}");
    assert!(advice.candidates[0].remaining < 0.9, "{advice}");
    // Redundant directions cannot be excited: for the classical parameterization the other directions get suggestions.
    let classical = LaboratoryForm::whole(Parameterization::Classical);
    let situation = Situation::of_experiment(&setup, classical, LABORATORY_IMU).unwrap();
    let advice = advise(&situation).unwrap();
    assert!(advice.candidates[0].remaining < 0.9, "{advice}");
}

#[test]
fn information_is_attributed_to_its_motion() {
    let setup = LaboratorySetup::new(Mechanism::named("yaw-roll-pitch-offset").unwrap());
    let form = LaboratoryForm::whole(Parameterization::Minimal);
    let chain = form.chain(&setup.mechanism);
    let reported = excitation(&setup.window(), &chain, &[], &setup.mechanism.names).unwrap();
    let gain = |parameter: &str, motion: &str| {
        let parameter = reported.parameters.iter().find(|it| it.name == parameter).unwrap();
        parameter.by_motion[reported.motions.iter().position(|name| name == motion).unwrap()]
    };
    assert_eq!(reported.motions.len(), 9);
    assert!(reported.parameters.iter().all(|parameter| parameter.bits_per_s > 0.0), "{reported}");
    // Only the joint of a link constrains the parameters that rotate with it: without its motion the link merges
    // with its neighbour.
    assert!(gain("L2.alpha", "joint 2") > 10.0 * gain("L2.alpha", "move x").abs(), "{reported}");
    assert!(gain("L3.alpha", "joint 3") > gain("L3.alpha", "move z"), "{reported}");
}
