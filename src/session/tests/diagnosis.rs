//! Diagnoses of synthetic flights with one planted fault.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::faults::{Area, Fault, FaultKind, Severity, correct_joint_angles};
use crate::log_check::{Basis, Finding, FindingInterval};
use crate::sensors::Rig;
use crate::session::diagnosis::{TRIALS_S, diagnose_run};
use crate::session::engine::input_of;
use crate::session::engine::{History, OwnedStepInput, RunEngine, estimator_config};
use crate::session::plan::RunSpec;
use crate::session::record::{Diagnosis, DiagnosisVerdict, RunRecord};
use crate::session::tests::memory::estimated_step;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// Stamp from which on a fault of the recording acts, in nanoseconds.
const LATER_NS: i64 = 3_500_000_000;

/// Diagnosis of a flight whose rig and inputs have a fault; `measured` are the faults that the check of its log finds.
fn diagnosed(
    duration_s: f64,
    rig_fault: impl Fn(&mut Rig),
    input_fault: impl Fn(&mut OwnedStepInput, &Rig),
    measured: &[Fault],
) -> Diagnosis {
    diagnosed_until((f64::INFINITY, TRIALS_S), duration_s, rig_fault, input_fault, measured)
}

/// The same, stopped when the progress exceeds a ratio, with an amount of processor time in seconds.
fn diagnosed_until(
    (stop_at, trials_s): (f64, f64),
    duration_s: f64,
    rig_fault: impl Fn(&mut Rig),
    input_fault: impl Fn(&mut OwnedStepInput, &Rig),
    measured: &[Fault],
) -> Diagnosis {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s, ..SyntheticOptions::default() });
    let mut rig = flight.given_rig.clone();
    rig_fault(&mut rig);
    // A window of five frames: its trials take half of the time of one of ten.
    let spec: RunSpec = "auto:window=5".parse().unwrap();
    let config = estimator_config(&rig, &spec).unwrap();
    let sigma_rad = config.encoder_sigma_rad.unwrap();
    let mut engine = RunEngine::new(config, None);
    let history = Arc::new(History::new(usize::MAX));
    let mut record = RunRecord::new(spec, "cam0".to_owned());
    for (step, frame) in flight.frames.iter().enumerate() {
        let mut input = input_of(frame, Some(sigma_rad));
        input_fault(&mut input, &rig);
        let input = Arc::new(input);
        history.inputs().push(Arc::clone(&input));
        history.before_step(step, &engine);
        record.push(estimated_step(&mut engine, &input));
    }
    let findings = || measured.iter().map(error_of).collect();
    diagnose_run(&rig, &record, &history, &findings, trials_s, &mut |ratio, _| {
        if ratio > stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
}

fn error_of(fault: &Fault) -> Finding {
    Finding {
        severity: Severity::Error,
        area: Area::Encoders,
        title: format!("{fault:?}"),
        evidence: String::new(),
        remedy: String::new(),
        interval: FindingInterval::default(),
        basis: Basis::Measured,
        faults: vec![fault.clone()],
    }
}

fn no_fault(_: &mut OwnedStepInput, _: &Rig) {}

#[test]
fn a_sound_flight_has_no_cause() {
    let found = diagnosed(5.0, |_| (), no_fault, &[]);
    assert_eq!((found.verdict, found.trials, found.causes.len()), (DiagnosisVerdict::Agrees, 0, 0), "{found}");
    assert!(found.to_string().contains("nothing to diagnose"), "{found}");
}

#[test]
fn a_wrong_focal_length_is_named_with_its_value() {
    let longer = |rig: &mut Rig| {
        for camera in &mut rig.cameras {
            let [fx, fy, cx, cy, k1, k2] = camera.model.intrinsics();
            camera.model = camera.model.with_intrinsics([1.1 * fx, 1.1 * fy, cx, cy, k1, k2]).unwrap();
        }
    };
    // The front end computes bearings with the camera of the rig.
    let bearings = |input: &mut OwnedStepInput, rig: &Rig| {
        let mut tracks = (**input.main_tracks()).clone();
        for feature in &mut tracks.features {
            feature.bearing = rig.cameras[0].model.unproject(&feature.uv_px).unwrap();
        }
        input.images[0].tracks = Arc::new(tracks);
    };
    let found = diagnosed(4.0, longer, bearings, &[]);
    assert_eq!((found.verdict, found.causes[0].cause), (DiagnosisVerdict::Cause, FaultKind::Focal), "{found}");
    let [focal] = found.causes[0].changes.corrections.as_slice() else { panic!("{found}") };
    let factor = focal.value(0);
    assert!((factor * 1.1 - 1.0).abs() < 0.01, "{factor}");
    assert!(found.causes[0].values.iter().all(|value| value.agrees()), "{found}");
}

/// Offset in radians of the first joint from [`LATER_NS`] on.
const JUMP_RAD: f64 = 0.3;

fn jump(input: &mut OwnedStepInput, rig: &Rig) {
    if let Some(angles) = input.joint_angles.as_mut().filter(|_| input.stamp_ns >= LATER_NS) {
        let names = rig.joint_names();
        let undoes = Fault::new(FaultKind::JointOffset, &[-JUMP_RAD]).of_joints(&names[..1]);
        correct_joint_angles(&[undoes.inverse()], &names, angles);
    }
}

fn assert_jump(found: &Diagnosis) {
    assert_eq!((found.verdict, found.causes[0].cause), (DiagnosisVerdict::Cause, FaultKind::JointOffset), "{found}");
    let [offset] = found.causes[0].changes.corrections.as_slice() else { panic!("{found}") };
    let undone_rad = offset.value(0);
    assert!((undone_rad + JUMP_RAD).abs() < 0.02, "{undone_rad}");
    assert!((found.causes[0].from_s - 3.5).abs() < 0.21, "{found}");
}

#[test]
fn an_offset_of_a_joint_is_named_with_its_time() {
    // The check is wrong here: its fault does not explain the residuals, so that all causes are tried.
    let found = diagnosed(5.0, |_| (), jump, &[Fault::from(FaultKind::JointReversed).of_joints(&["pitch".to_owned()])]);
    assert_jump(&found);
    assert!(!found.measured && found.headline().contains("by the trials"), "{found}");
}

#[test]
fn a_diagnosis_that_is_stopped_says_what_is_open() {
    let found = diagnosed_until((0.0, TRIALS_S), 5.0, |_| (), jump, &[]);
    assert!(found.interrupted && found.trials == 0, "{found}");
    assert_eq!(found.headline(), "stopped; so far no cause found; not tried: any cause");
    let found = diagnosed_until((0.06, TRIALS_S), 5.0, |_| (), jump, &[]);
    assert!(found.interrupted && found.trials > 0 && !found.not_tried.is_empty(), "{found}");
    let headline = found.headline();
    assert!(headline.starts_with("stopped; so far ") && headline.contains("; not tried: "), "{headline}");
}

#[test]
fn a_diagnosis_ends_with_its_processor_time_and_says_what_is_open() {
    let found = |trials_s: f64| diagnosed_until((f64::INFINITY, trials_s), 5.0, |_| (), jump, &[]);
    let none = found(0.0);
    assert_eq!((none.trials, none.ended_after_s, none.interrupted), (0, Some(0.0), false), "{none}");
    assert_eq!(none.verdict, DiagnosisVerdict::Unexplained);
    assert!(none.to_string().contains("; ended after about 0 s of processor time; not tried: focal length"), "{none}");
    let some = found(2.0);
    assert!(some.trials > 0 && some.ended_after_s == Some(2.0), "{some}");
    assert!(some.to_string().contains("; ended after about 2 s of processor time"), "{some}");
    let all = found(1e3);
    assert!(all.trials > some.trials && all.ended_after_s.is_none() && all.not_tried.is_empty(), "{all}");
}

#[test]
fn a_fault_that_the_check_measures_is_undone_first() {
    let offset = Fault::new(FaultKind::JointOffset, &[-0.27]).of_joints(&["yaw".to_owned()]);
    let found = diagnosed(5.0, |_| (), jump, &[Fault { since_s: Some(3.4), ..offset }]);
    assert_jump(&found);
    assert!(found.measured && found.trials < 60, "{found}");
    assert!(found.headline().ends_with("by the check of the log and by the trials"), "{found}");
}

#[test]
fn a_fault_that_no_change_undoes_ends_the_search() {
    let found = diagnosed(5.0, |_| (), jump, &[Fault::from(FaultKind::UnusableJoints)]);
    assert_eq!((found.verdict, found.trials, found.causes.len()), (DiagnosisVerdict::LogFault, 0, 0), "{found}");
    assert!(found.headline().ends_with("by the check of the log"), "{found}");
}

#[test]
fn a_run_without_steps_has_no_cause() {
    let rig = synthetic_tracks(&SyntheticOptions { duration_s: 0.2, ..SyntheticOptions::default() }).given_rig;
    let record = RunRecord::new(RunSpec::default(), "cam0".to_owned());
    let history = History::new(usize::MAX);
    let found = diagnose_run(&rig, &record, &history, &Vec::new, TRIALS_S, &mut |_, _| ControlFlow::Continue(()));
    assert_eq!(found.verdict, DiagnosisVerdict::NoSteps);
    assert!(found.to_string().contains("no image reached the estimator"), "{found}");
}
