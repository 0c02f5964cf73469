//! Time offsets of cameras and encoders.

use super::fixture;
use super::flight::{run_flight, trajectory_error_m};
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::report::StepReport;
use crate::geometry::Dimension;
use crate::gimbal::{ParameterId, Parameterization, Quantity};
use crate::simulation::{SyntheticFlight, SyntheticMount, SyntheticOptions, synthetic_tracks};

fn flight(mount: SyntheticMount, seed: u64, clock_offsets_s: [f64; 2]) -> SyntheticFlight {
    synthetic_tracks(&SyntheticOptions {
        mount,
        seed,
        duration_s: 12.0,
        clock_offsets_s,
        ..SyntheticOptions::default()
    })
}

/// Position error in metres, and the last report.
fn run_flight_at(flight: &SyntheticFlight, estimate_timeshift: bool) -> (f64, StepReport) {
    let options = EstimatorOptions::default();
    let config = EstimatorConfig {
        estimate_timeshift,
        ..fixture::config(&flight.given_rig, Parameterization::Minimal, options)
    };
    let (_, mut reports) = run_flight(&flight.frames, config);
    let (error_m, _) = trajectory_error_m(&flight.frames, &reports);
    (error_m, reports.pop().expect("a flight has frames"))
}

/// Value and standard deviation of a parameter, in seconds.
fn clock(report: &StepReport, clock: ParameterId) -> (f64, f64) {
    let calibration = &report.calibration;
    let index = calibration.parameters.iter().position(|known| *known == clock).expect("the offset has a column");
    assert_eq!(calibration.parameters[index].dimension(), Dimension::Time);
    (calibration.values[index], calibration.sigmas[index])
}

#[test]
fn the_offset_of_a_rigid_camera_is_found() {
    for (seed, offset_s) in [(1, 0.01), (2, -0.015), (3, 0.0)] {
        let flight = flight(SyntheticMount::Static, seed, [offset_s, 0.0]);
        let (ignored_m, report) = run_flight_at(&flight, false);
        assert!(report.calibration.parameters.iter().all(|parameter| parameter.quantity != Quantity::Timeshift));
        assert_eq!(report.warnings.is_empty(), offset_s == 0.0, "seed {seed}: {:?}", report.warnings);
        let (error_m, report) = run_flight_at(&flight, true);
        assert!(report.warnings.is_empty(), "seed {seed}: {:?}", report.warnings);
        let (found_s, sigma_s) = clock(&report, ParameterId::timeshift(0));
        assert!((found_s - offset_s).abs() < 0.001, "seed {seed}: {found_s} of {offset_s} s");
        assert!(sigma_s > 0.0 && sigma_s < 0.001, "seed {seed}: {sigma_s} s");
        assert!(
            offset_s == 0.0 || error_m < 0.7 * ignored_m,
            "seed {seed}: {ignored_m} m, {error_m} m with the offset"
        );
    }
}

#[test]
fn camera_and_encoder_time_offsets_are_separated() {
    for (seed, offsets_s) in [(1, [0.01, -0.02]), (2, [-0.01, 0.01])] {
        let flight = flight(SyntheticMount::Gimbal, seed, offsets_s);
        let (ignored_m, report) = run_flight_at(&flight, false);
        assert!(!report.warnings.is_empty(), "seed {seed}: {:?}", report.residuals);
        let (error_m, report) = run_flight_at(&flight, true);
        assert!(report.warnings.is_empty(), "seed {seed}: {:?}", report.warnings);
        for (id, offset_s) in [ParameterId::timeshift(0), ParameterId::ENCODER_TIMESHIFT].into_iter().zip(offsets_s) {
            let (found_s, sigma_s) = clock(&report, id);
            assert!((found_s - offset_s).abs() < 4.0 * sigma_s, "seed {seed}: {id:?} {found_s} ± {sigma_s} s");
            assert!((found_s - offset_s).abs() < 0.002, "seed {seed}: {id:?} {found_s} of {offset_s} s");
        }
        assert!(error_m < 0.7 * ignored_m, "seed {seed}: {ignored_m} m, {error_m} m with the offsets");
    }
}
