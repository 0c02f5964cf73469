//! Memory of a recording.

use std::sync::Arc;

use crate::estimator::{ColumnGroup, Phase, StageTimes};
use crate::session::engine::{History, OwnedStepInput, RunEngine, estimator_config, input_of, recorded_by};
use crate::session::record::{RunRecord, StepRecord};
use crate::simulation::{SyntheticFlight, SyntheticOptions, synthetic_tracks};

pub(in crate::session) fn recorded(flight: &SyntheticFlight, spec: &str) -> RunRecord {
    recorded_with(flight, spec, None)
}

/// A step without its observability analysis, which takes most of the time of a first window.
pub(in crate::session) fn estimated_step(engine: &mut RunEngine, input: &OwnedStepInput) -> StepRecord {
    input.record(engine.report_without_rank(input), None)
}

/// A recorded run in which every n-th report keeps its linearization.
pub(super) fn recorded_with(
    flight: &SyntheticFlight,
    spec: &str,
    keep_linearization_every: Option<usize>,
) -> RunRecord {
    run_by(RunEngine::step, flight, spec, keep_linearization_every)
}

/// A run without its observability analysis.
pub(in crate::session) fn estimated(flight: &SyntheticFlight, spec: &str) -> RunRecord {
    run_by(estimated_step, flight, spec, None)
}

fn run_by(
    step: impl Fn(&mut RunEngine, &OwnedStepInput) -> StepRecord,
    flight: &SyntheticFlight,
    spec: &str,
    keep_linearization_every: Option<usize>,
) -> RunRecord {
    recorded_by(step, flight, &spec.parse().unwrap(), keep_linearization_every).unwrap()
}

/// Ten minutes at 20 fps must fit into 1.5 GiB, tracks included: 134 kB per frame. A frame with 150 features in a
/// window of eleven takes about half of that.
#[test]
fn a_recorded_frame_stays_small() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 10.0, ..SyntheticOptions::default() });
    let run = recorded(&flight, "auto");
    let steps: Vec<_> = run.steps.iter().rev().take(60).collect();
    assert!(steps.iter().all(|step| step.report.phase == Phase::Tracking && step.report.linearization.is_none()));
    let observations: usize =
        steps.iter().flat_map(|step| &step.report.features).map(|feature| feature.observations.len()).sum();
    assert!(observations / steps.len() > 500, "a full window: {} observations", observations / steps.len());
    let bytes = steps.iter().map(|step| step.own_bytes() + step.tracks_bytes()).sum::<usize>() / steps.len();
    assert!(bytes < 90_000, "{bytes} bytes a frame: {:?}", steps[0].report.bytes());
    // The running sum has the same value.
    let summed: usize = run.steps.iter().map(|step| step.own_bytes() + step.tracks_bytes()).sum();
    assert_eq!(run.memory.steps + run.memory.tracks, summed);
}

/// A covariance refers to the frames of the window, so the summary must keep both.
#[test]
fn a_summary_with_a_linearization_keeps_the_frames_of_its_columns() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 6.0, ..SyntheticOptions::default() });
    let run = recorded_with(&flight, "auto", Some(10));
    let summaries: Vec<_> = run.steps.iter().enumerate().map(|(number, step)| step.summary(number)).collect();
    let tracking = summaries.iter().filter(|summary| summary.report.phase == Phase::Tracking);
    let (kept, plain): (Vec<_>, Vec<_>) = tracking.partition(|summary| summary.report.linearization.is_some());
    assert!(kept.len() >= 5 && plain.len() >= 40, "{} with, {} without", kept.len(), plain.len());
    for summary in &kept {
        let columns = &summary.report.linearization.as_ref().unwrap().columns;
        let poses = columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose).count();
        assert!(poses > 1 && poses == summary.report.window.len(), "{poses} poses");
    }
    // The window of the initialization is kept too: all poses are relative to its oldest frame.
    let initialized =
        plain.iter().position(|summary| summary.report.events.iter().any(|event| event.kind.initializes_window()));
    let whole: Vec<usize> = (0..plain.len()).filter(|place| plain[*place].report.window.len() > 1).collect();
    assert_eq!(whole, Vec::from_iter(initialized));
}

/// A budget for a few snapshots is used up, and every step is recomputed to the same bits from the remaining snapshots.
#[test]
fn snapshots_fill_their_budget_and_give_back_every_step() {
    const BUDGET_BYTES: usize = 800_000;
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 5.0, features: 60, ..SyntheticOptions::default() });
    let config = estimator_config(&flight.given_rig, &"auto".parse().unwrap()).unwrap();
    let sigma_rad = config.encoder_sigma_rad.unwrap();
    let mut engine = RunEngine::new(config, None);
    let history = History::new(BUDGET_BYTES);
    let mut steps = Vec::new();
    for (number, frame) in flight.frames.iter().enumerate() {
        let input = Arc::new(input_of(frame, Some(sigma_rad)));
        history.inputs().push(Arc::clone(&input));
        history.before_step(number, &engine);
        steps.push(engine.step(&input));
        assert!(history.snapshots().bytes <= BUDGET_BYTES || history.snapshots().count == 1);
    }
    let used = history.snapshots();
    assert!(used.count >= 6 && used.bytes > BUDGET_BYTES / 2, "{used:?}");
    assert!(used.spacing > 5 && used.spacing * used.count < 2 * steps.len(), "{used:?}");
    let text = |record: &StepRecord| {
        let mut report = record.report.clone();
        report.times = StageTimes::default();
        format!("{report:?} {:?}", record.rank)
    };
    for (number, step) in steps.iter().enumerate() {
        let recomputed = history.recompute(number, 1);
        assert_eq!(recomputed.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [number]);
        assert!(text(&recomputed[0].1) == text(step), "step {number}");
    }
}
