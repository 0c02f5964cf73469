//! Agreement with evo 1.38.1 on `tests/data/estimate.tum` and `tests/data/reference.tum`.
//!
//! The expected numbers are the output of evo's `metrics.APE` and `metrics.RPE` (translation part, rotation angle in
//! degrees, consecutive pairs) after `sync.associate_trajectories(reference, estimate, max_diff=0.01)`.

use std::path::PathBuf;

use dcvins::export::{EvaluationOptions, EvaluationReport, ExportError, evaluate};
use dcvins::session::accuracy::{RelativeDelta, TrajectoryAlignment};

const TOLERANCE: f64 = 1e-6;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn compare(alignment: TrajectoryAlignment, delta: RelativeDelta) -> EvaluationReport {
    let options = EvaluationOptions { alignment, delta, ..EvaluationOptions::default() };
    evaluate(&data("estimate.tum"), &data("reference.tum"), &options).expect("the fixtures can be compared")
}

/// `[rmse, mean, median, max]` of the absolute error.
fn check_absolute(alignment: TrajectoryAlignment, expected: [f64; 4]) {
    let report = compare(alignment, RelativeDelta::Frames(1));
    assert_eq!(report.pairs, 109);
    let found = [report.ate_m.rmse, report.ate_m.mean, report.ate_m.median, report.ate_m.max];
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < TOLERANCE, "{alignment:?}: {found} against evo's {expected}");
    }
}

/// `[rmse, std, min]` of the relative translation error, then `[rmse, median]` of the rotation error.
fn check_relative(
    alignment: TrajectoryAlignment,
    delta: RelativeDelta,
    pairs: usize,
    translation: [f64; 3],
    rotation: [f64; 2],
) {
    let report = compare(alignment, delta);
    assert_eq!(report.rpe_pairs, pairs, "{alignment:?} {delta:?}");
    let metres = &report.rpe_translation_m;
    let degrees = &report.rpe_rotation_deg;
    let found = [metres.rmse, metres.std, metres.min, degrees.rmse, degrees.median];
    for (found, expected) in found.iter().zip(translation.into_iter().chain(rotation)) {
        assert!((found - expected).abs() < TOLERANCE, "{alignment:?} {delta:?}: {found} against evo's {expected}");
    }
}

#[test]
fn absolute_error_is_evos() {
    check_absolute(TrajectoryAlignment::None, [4.20919436943, 3.86121951724, 4.01290926728, 5.96124147453]);
    check_absolute(TrajectoryAlignment::Rigid, [0.0500251340797, 0.0466803299608, 0.0443203541791, 0.104091836119]);
    check_absolute(
        TrajectoryAlignment::Similarity,
        [0.0346649464803, 0.0316539666576, 0.0297747238716, 0.0727999051586],
    );
}

#[test]
fn relative_error_is_evos() {
    check_relative(
        TrajectoryAlignment::Rigid,
        RelativeDelta::Frames(1),
        108,
        [0.0484767436704, 0.018054180736, 0.0104313639236],
        [1.48446346111, 1.40570842464],
    );
    check_relative(
        TrajectoryAlignment::None,
        RelativeDelta::Frames(7),
        15,
        [0.0532706592673, 0.0168029272709, 0.0288014825495],
        [1.79657168539, 1.76144040506],
    );
    check_relative(
        TrajectoryAlignment::Similarity,
        RelativeDelta::Metres(2.5),
        5,
        [0.0527472259414, 0.0184995517138, 0.0227123780697],
        [1.15944029811, 0.779630063008],
    );
}

#[test]
fn yaw_alignment_leaves_the_tilt_alone() {
    let yaw = compare(TrajectoryAlignment::YawPosition, RelativeDelta::Frames(1)).ate_m.rmse;
    let rigid = compare(TrajectoryAlignment::Rigid, RelativeDelta::Frames(1)).ate_m.rmse;
    assert!(yaw >= rigid && yaw < 1.2 * rigid, "the estimate is turned about the vertical only: {yaw} and {rigid}");
}

#[test]
fn bad_trajectories_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let check = |text: &str, words: &[&str]| {
        let path = folder.path().join("bad.tum");
        std::fs::write(&path, text).unwrap();
        let error = evaluate(&path, &data("reference.tum"), &EvaluationOptions::default()).unwrap_err();
        let message = error.to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    check("1 2 3\n", &["line 1", "3 numbers", "bad.tum"]);
    check("# only a comment\n", &["no pose"]);
    check("1 0 0 0 0 0 0 x\n", &["line 1", "'x'"]);
    check("1 0 0 0 0 0 0 0.5\n", &["norm 0.5"]);
    check("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", &["no stamps within", "clocks"]);
    let missing = evaluate(&folder.path().join("none.tum"), &data("reference.tum"), &EvaluationOptions::default());
    assert!(matches!(missing, Err(ExportError::Read { .. })));
}
