//! Recomputation of earlier steps on the sample log: every recomputed step equals the recorded one, even if only its
//! summary was kept.

use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use dcvins::estimator::StageTimes;
use dcvins::session::{
    self, Command, Computation, Recording, RunRecord, Session, SessionPlan, SessionRequest, StepRecord,
};

fn plan(specs: &[&str], memory_budget_bytes: usize) -> SessionPlan {
    let specs = specs.iter().map(|spec| spec.parse().expect("the specifications of tests are valid"));
    let request = SessionRequest {
        log_path: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap"),
        specs: specs.collect(),
        ..SessionRequest::default()
    };
    let plan = SessionPlan::open(&request).expect("the sample log opens");
    SessionPlan { memory_budget_bytes, ..plan }
}

/// A record as its bits (NaNs are equal), without the measured times.
fn bits(record: &StepRecord) -> String {
    let mut record = record.clone();
    record.report.times = StageTimes::default();
    format!("{record:?}")
}

/// Runs without a memory limit, computed from start to end.
fn straight(specs: &[&str]) -> Computation {
    let computation = session::compute(&plan(specs, usize::MAX), &mut |_| {}).expect("the runs start");
    assert!(computation.recording().runs.iter().all(|run| run.error.is_none() && run.memory.summaries == 0));
    computation
}

/// [`straight`] of the run "auto", which several tests compare with.
fn straight_auto() -> &'static Computation {
    static AUTO: LazyLock<Computation> = LazyLock::new(|| straight(&["auto"]));
    &AUTO
}

fn check_step(run: &RunRecord, number: usize, again: &StepRecord) {
    assert_eq!(bits(again), bits(&run.steps[number]), "step {number} of {}", run.spec.label);
}

#[test]
fn every_recomputed_step_is_the_step_that_was_recorded() {
    const AT_ONCE: usize = 20;
    let computation = straight(&["auto", "cluster", "auto:passes=2"]);
    for (index, run) in computation.recording().runs.iter().enumerate() {
        let mut end = run.steps.len();
        while end > 0 {
            let steps = computation.recompute(index, end - 1, AT_ONCE);
            let (first, _) = steps.first().expect("every step can be recomputed");
            assert!((end.saturating_sub(AT_ONCE)..end).contains(first));
            let next = *first;
            for (number, again) in steps {
                check_step(run, number, &again);
            }
            end = next;
        }
        // In any order as well.
        for number in [3, 150, 77, 141, 16] {
            let (last, again) = computation.recompute(index, number, 1).pop().expect("every step can be recomputed");
            assert_eq!(last, number);
            check_step(run, number, &again);
        }
        assert!(computation.recompute(index, run.steps.len(), 1).is_empty());
    }
}

fn played(session: &mut Session) {
    while session.recording().runs.iter().any(|run| !run.finished) {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    session.apply(Command::GoToEnd);
}

#[test]
fn stepping_back_shows_what_was_seen_on_the_way_forward_with_little_memory() {
    let forwards = straight_auto();
    let expected = &forwards.recording().runs[0];
    let mut session = Session::start(plan(&["auto"], 0)).expect("the session starts");
    played(&mut session);
    let kept = Arc::clone(&session.recording());
    assert!(kept.runs[0].memory.summaries > 90, "{:?}", kept.runs[0].memory);
    assert!(kept.memory_bytes() < forwards.recording().memory_bytes());
    for number in (0..expected.steps.len()).rev() {
        session.settle();
        let recording = session.recording();
        let shown = recording.runs[0].step_at(session.cursor_ns()).expect("a step is shown");
        assert!(!shown.summary_only);
        check_step(expected, number, shown);
        session.apply(Command::StepFrames(-1));
    }
    for number in [120, 15, 64, 101] {
        session.apply(Command::Seek { stamp_ns: expected.steps[number].report.stamp_ns });
        session.settle();
        let recording = session.recording();
        check_step(expected, number, recording.runs[0].step_at(session.cursor_ns()).expect("a step is shown"));
    }
}

#[test]
fn summaries_hold_everything_that_is_plotted_over_time() {
    let summaries = session::compute(&plan(&["auto"], 0), &mut |_| {});
    let (whole, summaries) = (straight_auto().recording(), summaries.expect("the runs start").into_recording());
    assert!(summaries.runs[0].memory.summaries > 90);
    for (whole, kept) in whole.runs[0].steps.iter().zip(&summaries.runs[0].steps) {
        let mut report = whole.report.clone();
        if kept.summary_only {
            // The first window is kept in full: poses and their covariances are relative to its oldest frame.
            if !report.events.iter().any(|event| event.kind.initializes_window()) {
                report.window.drain(..report.window.len().saturating_sub(1));
            }
            report.features.clear();
            report.jacobian_source = None;
            assert!(kept.report.landmarks.is_empty() || kept.report.landmarks == report.landmarks);
            report.landmarks = kept.report.landmarks.clone();
        }
        let expected = StepRecord { report, summary_only: kept.summary_only, ..StepRecord::clone(whole) };
        assert_eq!(bits(kept), bits(&expected));
    }
}

#[test]
fn the_solver_can_be_followed_through_a_step() {
    let forwards = straight_auto();
    let run = &forwards.recording().runs[0];
    let number = 150;
    let iterations = &run.steps[number].report.iterations;
    let states = forwards.solver_states(0, number);
    assert_eq!(states.len(), iterations.len() + 1);
    assert!(iterations.len() > 1, "a step with more than one iteration");
    check_step(run, number, states.last().expect("the last state is the step"));
    for (count, state) in states.iter().enumerate() {
        assert_eq!(state.report.iterations, iterations[..count]);
        let chi2 = |after: bool| -> f64 {
            let of = |it: &dcvins::estimator::ResidualSummary| if after { it.chi2_after } else { it.chi2_before };
            state.report.residuals.iter().map(of).sum()
        };
        // The solver's cost equals that of the report.
        let expected = if count == 0 { chi2(false) } else { 2.0 * iterations[count - 1].cost_after };
        let shown = chi2(true);
        assert!((shown - expected).abs() < 1e-6 * expected || count == 0 && shown == expected, "{shown} {expected}");
    }

    let mut session = Session::start(plan(&["auto"], usize::MAX)).expect("the session starts");
    played(&mut session);
    session.apply(Command::Seek { stamp_ns: run.steps[number].report.stamp_ns });
    let mut shown = Vec::new();
    for _ in 0..=iterations.len() {
        session.settle();
        let recording = session.recording();
        shown.push(bits(recording.runs[0].step_at(session.cursor_ns()).expect("a step is shown")));
        session.apply(Command::StepIteration { forward: false });
    }
    let expected: Vec<String> = states.iter().rev().map(bits).collect();
    assert!(shown == expected);
    // The last step went to the previous frame; a step forward returns to the first state here.
    session.settle();
    assert_eq!(session.cursor_ns(), run.steps[number - 1].report.stamp_ns);
    session.apply(Command::StepIteration { forward: true });
    session.settle();
    let recording = session.recording();
    let state = recording.runs[0].step_at(session.cursor_ns()).expect("a step is shown");
    assert_eq!(bits(state), bits(&states[0]));
}

/// `screenshot` and `report` draw any time of a long log whose steps are kept as summaries only.
#[cfg(feature = "gui")]
#[test]
fn screenshots_of_any_instant_have_the_same_bytes_with_little_memory() {
    use dcvins::export::{PANEL_NAMES, ScreenshotOptions, draw_panel, panel_csv, png_bytes};
    use dcvins::flight_log::ImageReader;

    let whole = straight(&["auto", "classical"]).into_recording();
    let plan = plan(&["auto", "classical"], 0);
    let mut little = session::compute(&plan, &mut |_| {}).expect("the runs start");
    let stamps_ns: Vec<i64> = [16, 81, 100].map(|step| whole.runs[0].steps[step].report.stamp_ns).to_vec();
    let summary_only = |stamp_ns: i64| {
        little.recording().runs.iter().all(|run| run.step_at(stamp_ns).is_some_and(|step| step.summary_only))
    };
    assert!(stamps_ns.iter().all(|stamp_ns| summary_only(*stamp_ns)));
    let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
    let options = ScreenshotOptions { size_px: [960, 720], ..ScreenshotOptions::default() };
    for stamp_ns in stamps_ns {
        little.fill_in(stamp_ns);
        for panel in PANEL_NAMES {
            let mut drawn = |recording: &Recording| {
                let screenshot = draw_panel(panel, recording, stamp_ns, &mut images, &options).expect("it is drawn");
                let table = panel_csv(panel, recording, stamp_ns, &mut images, &options).ok();
                (png_bytes(&screenshot).expect("it is encoded"), table)
            };
            let (whole, little) = (drawn(&whole), drawn(little.recording()));
            assert!(whole.0 == little.0, "'{panel}' at {stamp_ns} ns looks different with little memory");
            assert_eq!(whole.1, little.1, "'{panel}' at {stamp_ns} ns");
        }
    }
}
