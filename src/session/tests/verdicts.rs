//! Verdicts on the calibration against a required accuracy.

use crate::faults::{Area, Severity};
use crate::gimbal::ParameterId;
use crate::log_check::{Basis, Finding, FindingInterval, Trust};
use crate::observability::Determination;
use crate::session::record::{FlightParameter, FlightVerdicts, RunRecord};
use crate::session::result::Answer;
use crate::session::tests::memory::recorded;
use crate::simulation::{SyntheticFlight, SyntheticOptions, synthetic_tracks};

fn flight() -> SyntheticFlight {
    synthetic_tracks(&SyntheticOptions { duration_s: 8.0, ..SyntheticOptions::default() })
}

fn table(flight: &SyntheticFlight, run: &RunRecord) -> Vec<FlightParameter> {
    let rig = &flight.given_rig;
    FlightVerdicts::of_run(run, &rig.required_accuracy).table(&rig.parameter_names(), None)
}

fn with_verdict(rows: &[FlightParameter], wanted: Determination) -> Vec<ParameterId> {
    rows.iter().filter(|row| row.verdict == wanted).map(|row| row.parameter).collect()
}

/// Finding without a fault that a fork corrects.
fn warning(area: Area, title: &str) -> Finding {
    Finding {
        severity: Severity::Warning,
        area,
        title: title.to_owned(),
        evidence: String::new(),
        remedy: "mount it softly".to_owned(),
        interval: FindingInterval::default(),
        basis: Basis::Measured,
        faults: Vec::new(),
    }
}

/// Also by the ratio of σ and prior σ, as a check that the looser prior makes this ratio smaller.
#[test]
fn a_looser_prior_determines_no_further_parameter() {
    let of = |factor: f64| {
        let mut flight = flight();
        let prior = &mut flight.given_rig.gimbal.as_mut().unwrap().prior;
        prior.translation_bound_m *= factor;
        prior.rotation_bound_rad *= factor;
        // About the middle of what this flight reaches.
        flight.given_rig.required_accuracy.translation_m = 0.01;
        flight.given_rig.required_accuracy.rotation_rad = 0.3_f64.to_radians();
        let run = recorded(&flight, "auto");
        table(&flight, &run)
    };
    let [tight, loose] = [1.0, 10.0].map(of);
    let small_ratios =
        |rows: &[FlightParameter]| rows.iter().filter(|row| row.ratio.is_some_and(|ratio| ratio < 0.3)).count();
    assert!(small_ratios(&loose) > small_ratios(&tight), "{} and {}", small_ratios(&loose), small_ratios(&tight));
    let of_loose = with_verdict(&loose, Determination::Determined);
    assert!(of_loose.len() > 2 && of_loose.len() < loose.len(), "{loose:?}");
    let alone = |rows: &[FlightParameter]| -> Vec<String> {
        rows.iter().map(|row| format!("{} {:.2}", row.name, row.flight_sigma.unwrap() / row.required)).collect()
    };
    // The values at which the factors are linearized differ, and with them σ by up to a sixth.
    let is_near = |row: &FlightParameter| row.flight_sigma.unwrap() < 1.2 * row.required;
    let near: Vec<ParameterId> = tight.iter().filter(|row| is_near(row)).map(|row| row.parameter).collect();
    assert!(
        of_loose.iter().all(|parameter| near.contains(parameter)),
        "σ over required: {:?} and with the looser prior {:?}",
        alone(&tight),
        alone(&loose)
    );
    let [given, still] = [&tight, &loose].map(|rows| with_verdict(rows, Determination::Given).len());
    assert!(given > still, "{given} given with the tight prior, {still} with the loose one");
    for (tight, loose) in tight.iter().zip(&loose) {
        let ratio = loose.flight_sigma.unwrap() / tight.flight_sigma.unwrap();
        assert!((0.8..1.25).contains(&ratio), "{}: {ratio}", tight.name);
        assert!(tight.flight_sigma.unwrap() >= 0.999 * tight.sigma.unwrap(), "{tight:?}");
    }
}

#[test]
fn redundant_parameters_are_known_by_the_prior_alone() {
    let mut flight = flight();
    flight.given_rig.required_accuracy.translation_m = 10.0;
    flight.given_rig.required_accuracy.rotation_rad = 10.0;
    let rows = table(&flight, &recorded(&flight, "classical"));
    let redundant = with_verdict(&rows, Determination::Redundant);
    assert!(redundant.len() > 5, "{redundant:?}");
    let alone = |parameter: &ParameterId| rows.iter().find(|row| row.parameter == *parameter).unwrap().flight_sigma;
    assert!(redundant.iter().all(|parameter| alone(parameter).is_none()), "{rows:?}");
    assert!(rows.iter().all(|row| row.verdict == Determination::Redundant || row.verdict.is_met()), "{rows:?}");
}

#[test]
fn verdicts_of_a_run_that_is_not_trusted_are_withheld() {
    let flight = flight();
    let run = recorded(&flight, "auto");
    let trusted = Answer::of(&flight.given_rig, &[], &run);
    assert_eq!(trusted.withheld(), None, "{trusted:?}");
    let doubtful = Answer::of(&flight.given_rig, &[warning(Area::Imu, "the accelerometer is saturated")], &run);
    let withheld = doubtful.withheld().expect("a warning about the IMU");
    let mut rows = table(&flight, &run);
    assert!(!with_verdict(&rows, Determination::Determined).is_empty());
    withheld.apply(&mut rows);
    assert_eq!(with_verdict(&rows, Determination::Unknown).len(), rows.len());
    assert!(rows.iter().all(|row| row.reason == "the run is doubtful: the accelerometer is saturated"), "{rows:?}");
    assert!(rows.iter().all(|row| row.remedy == "mount it softly" && row.cause.is_none()), "{rows:?}");
    assert!(!doubtful.meets_requirement());
    assert_eq!(withheld.verdict(0, Determination::Initializing), Determination::Initializing);
    let late = Answer::of(&flight.given_rig, &[warning(Area::Time, "the ground truth is 100 ms late")], &run);
    assert_eq!((late.trust, late.withheld()), (Trust::Doubtful, None), "no verdict depends on the ground truth");
    let gyroscope = warning(Area::Imu, "the gyroscope measures 2.00 times the rotation of the ground truth");
    assert!(Answer::of(&flight.given_rig, &[gyroscope], &run).withheld().is_some());
}

#[test]
fn verdicts_are_withheld_from_the_start_of_the_finding_on() {
    let flight = flight();
    let mut run = recorded(&flight, "auto");
    let onset = run.steps.len() - 5;
    for step in &mut run.steps[onset..] {
        std::sync::Arc::make_mut(step).report.restarts = 1;
    }
    let withheld = Answer::of(&flight.given_rig, &[], &run).withheld().expect("a restart");
    let onset_ns = run.steps[onset].report.stamp_ns;
    assert_eq!(withheld.from_ns, onset_ns);
    assert_eq!(withheld.verdict(onset_ns - 1, Determination::Determined), Determination::Determined);
    assert_eq!(withheld.verdict(onset_ns, Determination::Determined), Determination::Unknown);
}

/// Faults of measurements are named before the residuals that follow from them.
#[test]
fn a_cause_comes_before_residuals_that_are_worse() {
    let mut flight = flight();
    let camera = &mut flight.given_rig.cameras[0];
    camera.model.intrinsics_px[0] *= 1.3;
    camera.model.intrinsics_px[1] *= 1.3;
    let run = recorded(&flight, "auto");
    let of = |area| Answer::of(&flight.given_rig, &[warning(area, "imu0 is stamped on arrival")], &run);
    let alone = Answer::of(&flight.given_rig, &[], &run);
    let by_cause = of(Area::Time);
    assert_eq!(by_cause.trust, alone.trust);
    assert!(by_cause.sentence.contains("imu0 is stamped on arrival"), "{}", by_cause.sentence);
    // Dark images are no cause of residuals that make a run useless.
    assert!(of(Area::Images).sentence.contains("residuals") == (alone.trust > by_cause.findings[0].trust));
}
