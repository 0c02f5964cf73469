//! Calibrations of synthetic stills against their truth.

use std::ops::ControlFlow;

use crate::calibration::CalibrationProgress;
use crate::calibration::stills::{
    AngleKnowledge, AngleModel, EncoderErrorKind, ScoredChain, StillsError, StillsOptions, StillsOutcome,
    calibrate_stills, judge_stills,
};
use crate::gimbal::{Chain, Parameterization};
use crate::simulation::{SyntheticStills, SyntheticStillsOptions, synthetic_stills};
use crate::text::Named as _;

fn calibrated(made: &SyntheticStills, angles: AngleModel) -> StillsOutcome {
    let options = StillsOptions { angles, ..StillsOptions::default() };
    calibrate_stills(&made.stills, &options, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Errors of the reported parameters in units of their σ.
fn normalized_errors(made: &SyntheticStills, outcome: &StillsOutcome) -> Vec<f64> {
    let parameterization = Parameterization::from_name(outcome.parameterization).unwrap();
    let truth = Chain::from_classical(&made.truth.chain, Parameterization::Poe);
    let truth = truth.in_parameterization(parameterization).canonical().values();
    let parameters = &outcome.tables[0].parameters;
    assert_eq!(parameters.len(), truth.len());
    parameters.iter().zip(&truth).map(|(it, truth)| it.dimension.difference(it.value, *truth) / it.sigma).collect()
}

#[test]
fn errors_agree_with_their_standard_deviations() {
    let mut squares = Vec::new();
    for seed in 1..=8 {
        let made = synthetic_stills(&SyntheticStillsOptions { seed, ..SyntheticStillsOptions::default() });
        let outcome = calibrated(&made, AngleModel::Encoder);
        let errors = normalized_errors(&made, &outcome);
        assert!(errors.iter().all(|error| error.abs() < 5.0), "seed {seed}: {errors:?}");
        squares.extend(errors.iter().map(|error| error * error));
        let truth = SyntheticStillsOptions::default().encoder_sigma_rad;
        for (found, truth) in outcome.noise.encoder_rad.iter().zip(truth) {
            // 40 readings per joint: σ is known to about 12 %.
            assert!((found / truth - 1.0).abs() < 0.5, "seed {seed}: σ {found} instead of {truth}");
        }
        assert!(outcome.sets.iter().all(|set| !set.wrong) && outcome.warnings.is_empty(), "{:?}", outcome.warnings);
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((0.4..1.5).contains(&mean), "mean squared error in σ²: {mean}");
}

#[test]
fn wrong_readings_are_named_with_their_size() {
    let wrong_readings = vec![(5, 1, 0.3), (38, 2, -0.12), (39, 0, 0.4)];
    let made = synthetic_stills(&SyntheticStillsOptions {
        wrong_readings: wrong_readings.clone(),
        ..SyntheticStillsOptions::default()
    });
    let outcome = calibrated(&made, AngleModel::Encoder);
    let named: Vec<usize> =
        outcome.sets.iter().enumerate().filter(|(_, set)| set.wrong).map(|(index, _)| index).collect();
    assert_eq!(named, [5, 38, 39]);
    for (set, joint, error_rad) in wrong_readings {
        let correction_rad = outcome.sets[set].corrections_deg[joint].to_radians();
        assert!((correction_rad + error_rad).abs() < 0.04, "set {set}: {correction_rad} for {error_rad}");
    }
    let errors = normalized_errors(&made, &outcome);
    assert!(errors.iter().all(|error| error.abs() < 5.0), "{errors:?}");
}

#[test]
fn free_angles_are_degenerate_and_the_encoder_model_is_not() {
    let made = synthetic_stills(&SyntheticStillsOptions::default());
    let (encoder, free) = (calibrated(&made, AngleModel::Encoder), calibrated(&made, AngleModel::Free));
    let rank = |outcome: &StillsOutcome, name: &str, angles: AngleKnowledge| {
        let found = outcome.ranks.iter().find(|it| it.parameterization == name && it.angles == angles).unwrap();
        (found.rank_structural, found.columns, found.null_directions.clone())
    };
    for outcome in [&encoder, &free] {
        let (classical, columns, _) = rank(outcome, "classical", AngleKnowledge::Known);
        assert_eq!((classical, columns), (18, 24));
        let (minimal, columns, null) = rank(outcome, outcome.parameterization, AngleKnowledge::Known);
        assert_eq!((minimal, columns, null.len()), (18, 18, 0));
        assert_eq!(rank(outcome, outcome.parameterization, AngleKnowledge::Encoder).0, 18);
        let (free, _, mut null) = rank(outcome, outcome.parameterization, AngleKnowledge::Free);
        null.sort();
        assert_eq!((free, null.len()), (15, 3));
    }
    assert!(encoder.warnings.is_empty(), "{:?}", encoder.warnings);
    assert!(free.warnings.iter().any(|it| it.contains("with free angles; unobservable")), "{:?}", free.warnings);
    let as_read =
        |outcome: &StillsOutcome| outcome.score(ScoredChain::HoldOut, "front").unwrap().as_read.unwrap().mean_px;
    assert!(as_read(&free) > 2.0 * as_read(&encoder), "{} and {} px", as_read(&free), as_read(&encoder));
}

#[test]
fn the_scale_of_an_encoder_is_found_and_no_other_error() {
    let made = synthetic_stills(&SyntheticStillsOptions {
        encoder_scale: [-0.02, 0.0, 0.0],
        ..SyntheticStillsOptions::default()
    });
    let outcome = calibrated(&made, AngleModel::Encoder);
    let found =
        outcome.encoder_tests.iter().find(|it| it.joint == "yaw" && it.kind == EncoderErrorKind::Scale).unwrap();
    let [value, sigma] = found.coefficients[0];
    // The angle is the reading divided by 0.98.
    assert!(found.significant && (value - 0.0204).abs() < 4.0 * sigma && sigma < 0.004, "{found:?}");
    let others = outcome.encoder_tests.iter().filter(|test| test.significant && test.joint != "yaw");
    assert_eq!(others.count(), 0);
    let without = calibrated(&synthetic_stills(&SyntheticStillsOptions::default()), AngleModel::Encoder);
    assert!(without.encoder_tests.len() == 9 && without.encoder_tests.iter().all(|test| !test.significant));
}

#[test]
fn poses_are_found_without_given_ones() {
    let options = SyntheticStillsOptions { without_poses: true, ..SyntheticStillsOptions::default() };
    let with = synthetic_stills(&SyntheticStillsOptions::default());
    let without = synthetic_stills(&options);
    let [with, without] = [with, without].map(|made| calibrated(&made, AngleModel::Encoder));
    for (with, without) in with.floors.iter().zip(&without.floors) {
        assert!((with.floor.mean_px - without.floor.mean_px).abs() < 1e-6 && with.points_left_out == 0);
    }
}

#[test]
fn a_given_chain_is_judged_without_changing_it() {
    let made = synthetic_stills(&SyntheticStillsOptions::default());
    let judge = |chain| judge_stills(&made.stills, chain, &mut |_| ControlFlow::Continue(())).unwrap();
    let (truth, initial) = (judge(&made.truth), judge(&made.stills.initial));
    let px = |outcome: &StillsOutcome| outcome.score(ScoredChain::Given, "front").unwrap().as_read.unwrap().mean_px;
    assert!(px(&truth) < 12.0 && px(&initial) > 40.0, "{} and {} px", px(&truth), px(&initial));
    assert_eq!(truth.chain, made.truth);
    assert!(truth.warnings.is_empty() && !initial.warnings.is_empty(), "{:?}, {:?}", truth.warnings, initial.warnings);
}

#[test]
fn too_few_sets_and_an_interrupt_are_errors() {
    let few = SyntheticStillsOptions { stations: 1, sets_per_station: 4, ..SyntheticStillsOptions::default() };
    let made = synthetic_stills(&few);
    let run = |on_progress: &mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>| {
        calibrate_stills(&made.stills, &StillsOptions::default(), on_progress)
    };
    let error = run(&mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(error, StillsError::TooFewSets { found: 4, needed: 5, .. }), "{error}");
    assert!(matches!(run(&mut |_| ControlFlow::Break(())), Err(StillsError::Interrupted { .. })));
}
