//! Answers of runs: what is said first about flights with and without a fault.

use std::sync::Arc;

use crate::estimator::EventKind;
use crate::faults::{Area, Fault, FaultKind, Severity};
use crate::log_check::{Basis, Finding, FindingInterval, Trust};
use crate::session::record::{Diagnosis, DiagnosisVerdict, RankedCause, RunRecord};
use crate::session::result::{Answer, FindingSource};
use crate::session::tests::memory::{estimated, recorded};
use crate::simulation::{SyntheticFlight, SyntheticOptions, synthetic_tracks};

fn flight() -> SyntheticFlight {
    synthetic_tracks(&SyntheticOptions { duration_s: 8.0, ..SyntheticOptions::default() })
}

fn answer(flight: &SyntheticFlight, check: &[Finding], run: &RunRecord) -> Answer {
    Answer::of(&flight.given_rig, check, run)
}

fn finding(severity: Severity, title: &str, faults: Vec<Fault>) -> Finding {
    let area = faults.first().map_or(Area::Images, |fault| fault.kind.row().area);
    let [evidence, remedy] = ["3 of 7", "mend it"].map(str::to_owned);
    Finding {
        severity,
        area,
        title: title.to_owned(),
        evidence,
        remedy,
        interval: FindingInterval::default(),
        basis: Basis::Measured,
        faults,
    }
}

#[test]
fn a_sound_flight_is_trusted_and_its_parameters_are_counted() {
    let flight = flight();
    let mut run = recorded(&flight, "auto");
    run.finished = true;
    let found = answer(&flight, &[], &run);
    assert_eq!((found.trust, found.findings.len()), (Trust::Trusted, 0), "{found:?}");
    let requirement = found.requirement.expect("estimated parameters");
    assert_eq!(requirement.parameters, 18);
    assert!(requirement.met < 18 && requirement.worst.is_some(), "{requirement:?}");
    let start = format!("⚠ {} of 18 parameters within 5 mm and 0.1°, worst ", requirement.met);
    assert!(found.sentence.starts_with(&start), "{}", found.sentence);
    // A requirement of any accuracy is met since the first window.
    let mut rig = flight.given_rig.clone();
    rig.required_accuracy.translation_m = 10.0;
    rig.required_accuracy.rotation_rad = 10.0;
    let loose = Answer::of(&rig, &[], &run);
    let first_s = run.steps.iter().find(|step| step.report.newest().is_some()).unwrap().report.stamp_ns as f64 * 1e-9;
    assert_eq!(loose.requirement.unwrap().since_s, Some(first_s));
    assert!(loose.sentence.starts_with("✔ 18 of 18 parameters within"), "{}", loose.sentence);
    let fixed = recorded(&flight, "auto:calibrate=off");
    assert_eq!(answer(&flight, &[], &fixed).requirement, None);
}

#[test]
fn a_fault_of_the_check_comes_first_where_the_run_uses_what_is_faulty() {
    let flight = flight();
    let run = estimated(&flight, "auto");
    let reversed = Fault::from(FaultKind::JointReversed).of_joints(&["yaw".to_owned()]);
    let joint = finding(Severity::Error, "joint 'yaw' counts in the other direction than in the rig", vec![reversed]);
    let found = answer(&flight, std::slice::from_ref(&joint), &run);
    let sentence = "✖ Not usable: joint 'yaw' counts in the other direction than in the rig";
    assert_eq!((found.sentence.as_str(), found.remedy.as_str()), (sentence, "mend it"));
    let (changes, from_ns) = found.findings[0].correction(&flight.given_rig).expect("a fork that undoes it");
    assert_eq!((changes.to_string().as_str(), from_ns), ("correct=reversed:yaw", 0));
    // Joint angles do not matter to a run without encoders, another camera's images never do.
    let without = estimated(&flight, "auto:encoder=off");
    assert!(answer(&flight, &[joint], &without).findings.iter().all(|it| it.source != FindingSource::Check));
    let mut rig = flight.given_rig.clone();
    let mut second = rig.cameras[0].clone();
    second.key = "cam1".to_owned();
    rig.cameras.push(second);
    let of = |title: &str| Answer::of(&rig, &[finding(Severity::Warning, title, Vec::new())], &run).findings.len();
    assert_eq!((of("some images of cam1 are blurred"), of("some images of cam0 are blurred")), (0, 1));
    // What the rig only assumes, and notes, are no reason to doubt.
    let assumed = Finding { basis: Basis::Assumed, ..finding(Severity::Warning, "assumed", Vec::new()) };
    assert_eq!(answer(&flight, &[assumed, finding(Severity::Note, "note", Vec::new())], &run).trust, Trust::Trusted);
}

#[test]
fn residuals_that_disagree_are_said_without_a_cause() {
    let mut flight = flight();
    let camera = &mut flight.given_rig.cameras[0];
    camera.model.intrinsics_px[0] *= 1.3;
    camera.model.intrinsics_px[1] *= 1.3;
    let run = estimated(&flight, "auto");
    let found = answer(&flight, &[], &run);
    assert!(found.trust > Trust::Trusted, "{found:?}");
    assert!(found.findings.iter().any(|it| it.source == FindingSource::Residuals), "{found:?}");
    assert_eq!(found.remedy, "diagnose the run");
}

#[test]
fn a_diagnosis_names_the_cause_of_residuals_that_disagree() {
    let mut flight = flight();
    let camera = &mut flight.given_rig.cameras[0];
    camera.model.intrinsics_px[0] *= 1.3;
    camera.model.intrinsics_px[1] *= 1.3;
    let mut run = estimated(&flight, "auto");
    assert!(answer(&flight, &[], &run).is_unexplained());
    let cause = |statement: &str, changes: &str| RankedCause {
        cause: FaultKind::Focal,
        statement: statement.to_owned(),
        remedy: "calibrate cam0".to_owned(),
        changes: changes.parse().unwrap(),
        from_ns: 0,
        from_s: 0.0,
        since_ns: Some(1_000_000_000),
        parameters: 1,
        beyond_search: false,
        gain: 8000.0,
        values: Vec::new(),
        accuracy: None,
    };
    let causes = vec![cause("the focal length is wrong", "correct=focal:0.77"), cause("cam0 zooms", "chain-prior=5")];
    let one = Diagnosis { verdict: DiagnosisVerdict::Cause, explaining: 1, causes, ..Diagnosis::default() };
    let mut with = |diagnosis: Diagnosis| {
        run.diagnosis = Some(Arc::new(diagnosis));
        answer(&flight, &[], &run)
    };
    let found = with(one.clone());
    assert!(found.sentence.ends_with("since 1.0 s: the focal length is wrong"), "{}", found.sentence);
    assert_eq!((found.remedy.as_str(), found.findings[0].source), ("calibrate cam0", FindingSource::Diagnosis));
    let (changes, from_ns) = found.findings[0].correction(&flight.given_rig).expect("a fork that undoes it");
    assert_eq!((changes.to_string().as_str(), from_ns, found.is_unexplained()), ("correct=focal:0.77", 0, false));
    let several = with(Diagnosis { verdict: DiagnosisVerdict::Several, explaining: 2, ..one.clone() });
    assert!(several.sentence.ends_with(": most likely the focal length is wrong, or cam0 zooms"), "{several:?}");
    assert_eq!(several.named().len(), 2);
    // What is stopped early is no cause.
    let stopped = with(Diagnosis { interrupted: true, not_tried: vec![FaultKind::ImuNoise], ..one });
    assert!(stopped.is_unexplained(), "{stopped:?}");
    let open = "diagnosis: stopped; so far the focal length is wrong; not tried: imu noise";
    assert_eq!(stopped.remedy, open);
}

#[test]
fn a_run_that_never_initialized_says_its_most_frequent_reason() {
    let flight = flight();
    let mut run = estimated(&flight, "auto");
    run.end_at(0);
    run.finished = false;
    assert_eq!(answer(&flight, &[], &run).findings, []);
    run.finished = true;
    let waits = run.steps.iter().flat_map(|step| &step.report.events);
    let waits = waits.filter(|event| event.kind == EventKind::InitializationWaits).count();
    let found = answer(&flight, &[], &run);
    assert_eq!((found.trust, waits), (Trust::NotUsable, run.steps.len()), "{found:?}");
    assert!(found.sentence.starts_with("✖ Not usable: the run never initialized: "), "{}", found.sentence);
}
