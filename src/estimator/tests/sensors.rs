//! Rolling shutters, wrong intrinsics, and IMUs with scale errors.

use std::collections::BTreeSet;

use super::fixture;
use super::flight::{chain_error, run_flight_by_rows, trajectory_error_m};
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::report::StepReport;
use crate::faults::LensChange;
use crate::gimbal::{ParameterId, ParameterNames, Parameterization};
use crate::simulation::{SyntheticFlight, SyntheticMount, SyntheticOptions, synthetic_tracks};

const READOUT_S: f64 = 0.03;

/// Position error and chain error in metres, and the last report.
fn run(flight: &SyntheticFlight, change: impl Fn(&mut EstimatorConfig)) -> (f64, f64, StepReport) {
    let mut config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    change(&mut config);
    let (estimator, mut reports) = run_flight_by_rows(&flight.frames, config);
    let (error_m, _) = trajectory_error_m(&flight.frames, &reports);
    let (chain_m, _) = chain_error(flight, &estimator);
    (error_m, chain_m, reports.pop().expect("a flight has frames"))
}

/// Position error in metres and the distinct warnings of a run that does not estimate the errors of the given rig.
fn ignored(flight: &SyntheticFlight) -> (f64, BTreeSet<String>) {
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let (_, reports) = run_flight_by_rows(&flight.frames, config);
    let (error_m, _) = trajectory_error_m(&flight.frames, &reports);
    (error_m, reports.iter().flat_map(|report| &report.warnings).map(ToString::to_string).collect())
}

#[test]
fn a_late_camera_is_not_taken_for_a_rolling_shutter() {
    let flight =
        synthetic_tracks(&SyntheticOptions { clock_offsets_s: [0.01, 0.0], ..options(SyntheticMount::Static, 1) });
    let (_, warnings) = ignored(&flight);
    let names_another = |warning: &String| warning.contains("readout") || warning.contains("intrinsics");
    assert!(!warnings.is_empty() && !warnings.iter().any(names_another), "{warnings:?}");
}

/// Value and standard deviation of a parameter by its name.
fn value(report: &StepReport, name: &str) -> (f64, f64) {
    let id: ParameterId = ParameterNames::default().parse(name).expect("a known name");
    let calibration = &report.calibration;
    let column = calibration.parameters.iter().position(|known| *known == id).expect("an estimated parameter");
    (calibration.values[column], calibration.sigmas[column])
}

fn options(mount: SyntheticMount, seed: u64) -> SyntheticOptions {
    SyntheticOptions { mount, seed, duration_s: 12.0, features: 100, ..SyntheticOptions::default() }
}

#[test]
fn the_readout_of_a_rigid_camera_is_estimated_and_named_where_it_is_ignored() {
    let flight = synthetic_tracks(&SyntheticOptions { readout_s: READOUT_S, ..options(SyntheticMount::Static, 1) });
    let (ignored_m, warnings) = ignored(&flight);
    assert!(warnings.iter().any(|warning| warning.contains("try readout=on")), "{warnings:?}");
    let (known_m, _, _) = run(&flight, |config| config.sensor.readout_s = READOUT_S);
    let (estimated_m, chain_m, report) = run(&flight, |config| config.estimate_readout = true);
    let (readout_s, sigma_s) = value(&report, "readout");
    assert!((readout_s - READOUT_S).abs() < 0.0005, "{readout_s} ± {sigma_s} s");
    assert!(sigma_s > 0.0 && sigma_s < 0.0005, "{sigma_s} s");
    assert!(estimated_m < 0.1 * ignored_m && estimated_m < 1.3 * known_m, "{ignored_m}, {known_m}, {estimated_m} m");
    assert!(chain_m < 0.005, "{chain_m} m");
}

#[test]
fn the_readout_of_a_gimballed_camera_is_estimated_with_the_motion_of_its_joints() {
    let flight = synthetic_tracks(&SyntheticOptions { readout_s: READOUT_S, ..options(SyntheticMount::Gimbal, 2) });
    let (ignored_m, warnings) = ignored(&flight);
    assert!(warnings.iter().any(|warning| warning.contains("try readout=on")), "{warnings:?}");
    let (estimated_m, _, report) = run(&flight, |config| config.estimate_readout = true);
    let (readout_s, sigma_s) = value(&report, "readout");
    assert!((readout_s - READOUT_S).abs() < 0.0015, "{readout_s} ± {sigma_s} s");
    assert!(estimated_m < 0.5 * ignored_m, "{ignored_m} m, estimated {estimated_m} m");
}

#[test]
fn a_focal_length_with_an_error_of_a_percent_is_corrected() {
    let plain = options(SyntheticMount::Static, 1);
    let (reference_m, _, _) = run(&synthetic_tracks(&plain), |_| {});
    let flight = synthetic_tracks(&SyntheticOptions {
        intrinsics_error: LensChange { focal: 1.01, ..LensChange::NONE },
        ..plain
    });
    let (_, ignored_chain_m, _) = run(&flight, |_| {});
    let (estimated_m, chain_m, report) = run(&flight, |config| config.estimate_intrinsics = true);
    let [true_fx, ..] = flight.true_rig.cameras[0].model.intrinsics_px;
    let (fx, sigma) = value(&report, "fx");
    assert!((fx - true_fx).abs() < 0.001 * true_fx && sigma < 0.5, "{fx} ± {sigma} px of {true_fx}");
    assert!(estimated_m < 1.2 * reference_m, "{estimated_m} m, {reference_m} m with the true focal length");
    assert!(chain_m < 0.3 * ignored_chain_m, "{ignored_chain_m} m, estimated {chain_m} m");
}

#[test]
fn a_wrong_focal_length_is_named_in_the_warning() {
    let flight = synthetic_tracks(&SyntheticOptions {
        intrinsics_error: LensChange { focal: 1.03, ..LensChange::NONE },
        ..options(SyntheticMount::Static, 1)
    });
    let (_, warnings) = ignored(&flight);
    assert!(warnings.iter().any(|warning| warning.contains("try intrinsics=on")), "{warnings:?}");
    assert!(!warnings.iter().any(|warning| warning.contains("readout=on")), "{warnings:?}");
}

#[test]
fn scale_errors_of_the_gyroscope_are_estimated() {
    let flight = synthetic_tracks(&SyntheticOptions {
        imu_intrinsics_error: [0.01, 0.01],
        ..options(SyntheticMount::Static, 1)
    });
    let (_, ignored_chain_m, _) = run(&flight, |_| {});
    let (_, chain_m, report) = run(&flight, |config| config.estimate_imu_intrinsics = true);
    let truth = flight.true_rig.imu.intrinsics.parameters();
    for (axis, name) in ["gyroscope.sx", "gyroscope.sy", "gyroscope.sz"].into_iter().enumerate() {
        let (scale, sigma) = value(&report, name);
        let error = scale - truth.gyroscope.scale[axis];
        assert!(error.abs() < 0.002 && sigma < 0.002, "{name}: {scale} ± {sigma}, error {error}");
    }
    assert!(chain_m < 0.3 * ignored_chain_m, "{ignored_chain_m} m, estimated {chain_m} m");
}
