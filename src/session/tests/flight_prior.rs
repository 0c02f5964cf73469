//! Runs that start from the calibration of another flight.

use std::path::PathBuf;
use std::sync::Arc;

use crate::estimator::{CalibrationPosterior, EstimatorConfig};
use crate::gimbal::Chain;
use crate::sensors::ChainPrior;
use crate::session::engine::input_of;
use crate::session::engine::{RunEngine, estimator_config};
use crate::session::plan::{FlightPrior, RunSpec};
use crate::simulation::{SyntheticFlight, SyntheticFrame, SyntheticOptions, synthetic_tracks};

const RULER: ChainPrior = ChainPrior { translation_bound_m: 0.03, rotation_bound_rad: 0.17 };

fn flight() -> SyntheticFlight {
    synthetic_tracks(&SyntheticOptions { seed: 2, duration_s: 16.0, start_error: RULER, ..SyntheticOptions::default() })
}

fn prior_of(posterior: CalibrationPosterior, growth: f64) -> FlightPrior {
    let joints = ["yaw", "roll", "pitch"].map(str::to_owned).to_vec();
    let (folder, history) = (PathBuf::from("before"), Vec::new());
    FlightPrior { folder, cameras: vec!["cam0".to_owned()], joints, posterior, growth, history }
}

fn config(flight: &SyntheticFlight, spec: &str, prior: Option<&FlightPrior>) -> Result<EstimatorConfig, String> {
    let spec: RunSpec = spec.parse().unwrap();
    let config = estimator_config(&flight.given_rig, &spec).unwrap();
    let of_run = |prior: &FlightPrior| {
        prior
            .of_run(&spec.label, &["cam0"], &flight.given_rig.joint_names(), &config)
            .map_err(|error| error.to_string())
    };
    let calibration_prior = prior.map(of_run).transpose()?.map(Arc::new);
    Ok(EstimatorConfig { calibration_prior, ..config })
}

/// Calibration at the end of a run over some frames.
fn run(
    flight: &SyntheticFlight,
    spec: &str,
    prior: Option<&FlightPrior>,
    frames: &[SyntheticFrame],
) -> CalibrationPosterior {
    let config = config(flight, spec, prior).unwrap();
    let sigma_rad = config.encoder_sigma_rad.unwrap();
    let mut engine = RunEngine::new(config, None);
    for frame in frames {
        engine.step_without_rank(&input_of(frame, Some(sigma_rad)));
    }
    engine.estimator().posterior().expect("the run has a window")
}

/// Root mean square of the errors of the chain in standard deviations.
fn errors_in_sigmas(flight: &SyntheticFlight, posterior: &CalibrationPosterior) -> f64 {
    let camera = &posterior.cameras[0];
    let truth = flight.true_rig.gimbal.as_ref().unwrap().chain.clone();
    let form = |chain| Chain::from_classical(chain, camera.parameterization);
    let error = form(&camera.chain).minus(&form(&truth));
    let squares = error
        .iter()
        .zip(posterior.sigmas())
        .zip(&camera.parameters)
        .map(|((error, sigma), parameter)| (parameter.dimension().difference(*error, 0.0) / sigma).powi(2));
    (squares.sum::<f64>() / error.len() as f64).sqrt()
}

#[test]
fn two_flights_add_up_and_their_order_matters_little() {
    let flight = flight();
    let (first, second) = flight.frames.split_at(flight.frames.len() / 2);
    let alone = [first, second].map(|frames| run(&flight, "minimal:timeshift=on", None, frames));
    let after = |posterior: &CalibrationPosterior, frames| {
        let prior = prior_of(posterior.clone(), 1.0);
        run(&flight, "minimal:timeshift=on", Some(&prior), frames)
    };
    let both = [after(&alone[0], second), after(&alone[1], first)];
    let [a, b] = both.each_ref().map(CalibrationPosterior::sigmas);
    for k in 0..a.len() {
        let least = alone[0].sigmas()[k].min(alone[1].sigmas()[k]);
        assert!(a[k] < 1.05 * least && b[k] < 1.05 * least, "column {k}: {} and {} from {least}", a[k], b[k]);
        assert!((a[k] / b[k]).ln().abs() < 0.3, "column {k}: {} and {} by the order", a[k], b[k]);
    }
    for posterior in &both {
        let errors = errors_in_sigmas(&flight, posterior);
        assert!(errors < 2.0, "{errors} σ RMS");
        assert_eq!(posterior.cameras[0].rig_sigmas, alone[0].cameras[0].rig_sigmas, "the rig stays the reference");
    }
    // Known before a flight is the rig, or the flight before it.
    let before = |posterior: &CalibrationPosterior| posterior.before.clone().unwrap();
    let of_rig = before(&alone[0]);
    for (variance, sigma) in of_rig.covariance.diagonal().iter().zip(&alone[0].cameras[0].rig_sigmas) {
        assert!((variance.sqrt() / sigma - 1.0).abs() < 1e-6, "{} {sigma}", variance.sqrt());
    }
    let of_flight = before(&both[0]);
    for (value, expected) in of_flight.values.iter().zip(&alone[0].cameras[0].values) {
        assert!((value - expected).abs() < 1e-9, "{value} {expected}");
    }
    let difference = &of_flight.covariance - &alone[0].covariance;
    assert!(difference.norm() < 1e-6 * of_flight.covariance.norm(), "{}", difference.norm());
}

#[test]
fn a_prior_is_the_start_in_any_parameterization_and_grows_by_its_factor() {
    let flight = flight();
    let before = run(&flight, "minimal", None, &flight.frames[..flight.frames.len() / 2]);
    for (spec, growth) in [("minimal", 1.0), ("minimal", 3.0), ("poe", 1.0), ("minimal-swapped", 2.0)] {
        let config = config(&flight, spec, Some(&prior_of(before.clone(), growth))).unwrap();
        let parameterization = config.parameterization;
        let engine = RunEngine::new(config, None);
        let start = engine.estimator().start_posterior();
        let chain = &start.cameras[0].chain;
        for angles in [[0.0; 3], [0.7, -0.3, 0.4]] {
            let [found, expected] = [chain, &before.cameras[0].chain].map(|chain| chain.imu_from_camera(&angles));
            assert!(found.minus(&expected).norm() < 1e-7, "{spec}");
        }
        assert_eq!(start.cameras[0].parameterization, parameterization);
        if spec == "minimal" {
            for (found, expected) in start.sigmas().iter().zip(before.sigmas()) {
                assert!((found / (growth * expected) - 1.0).abs() < 0.01, "{found} {expected} × {growth}");
            }
        }
    }
}

#[test]
fn another_mechanism_is_refused_with_the_first_difference() {
    let flight = flight();
    let posterior = run(&flight, "minimal", None, &flight.frames[..80]);
    let refused = |prior: &FlightPrior, spec: &str, words: &[&str]| {
        let problem = config(&flight, spec, Some(prior)).expect_err("it does not fit");
        for word in words.iter().chain(&["minimal", "before"]) {
            assert!(problem.contains(word), "'{word}' is missing: {problem}");
        }
    };
    let good = prior_of(posterior.clone(), 1.0);
    let joints = vec!["pan".to_owned(), "roll".to_owned(), "pitch".to_owned()];
    refused(&FlightPrior { joints, ..good.clone() }, "minimal", &["pan, roll, pitch", "yaw, roll, pitch"]);
    refused(&FlightPrior { cameras: vec!["cam3".to_owned()], ..good.clone() }, "minimal", &["cam3", "cam0"]);
    refused(&good, "minimal:encoder=off", &["with encoders", "without encoders"]);
    refused(&good, "minimal:calibrate=off", &["calibrate=off", "--rig"]);
    let mut moved = good.clone();
    moved.posterior.cameras[0].chain.imu_from_base.translation_m.x += 1.0;
    refused(&moved, "minimal", &["1.0", "away"]);
    let mut shorter = good;
    shorter.posterior.cameras[0].chain.links.pop();
    refused(&shorter, "minimal", &["2 joints", "3 joints"]);
}
