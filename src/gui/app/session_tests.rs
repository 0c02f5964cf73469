//! Tests of the application with a session that processes a sample log.

use std::path::PathBuf;
use std::sync::Arc;

use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use super::tests::{TestDesktop, run_until};
use super::{App, OpenFailure, OpenLog};
use crate::gui::desktop::Desktop;
use crate::gui::painted_texts::painted_texts;
use crate::gui::theme::ThemeName;
use crate::log_check::{self, CheckReport};
use crate::session::{RunRecord, Session, SessionPlan, SessionRequest};

/// A window with the first seconds of the sample log, processed by one run.
pub(super) fn window_over_garden(spec: &str, duration_s: f64) -> Harness<'static, App> {
    window_of(Session::start(garden(spec, duration_s)).unwrap())
}

fn garden(spec: &str, duration_s: f64) -> SessionPlan {
    let log_path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let specs = vec![spec.parse().unwrap()];
    let request = SessionRequest { log_path, specs, duration_s: Some(duration_s), ..SessionRequest::default() };
    SessionPlan::open(&request).unwrap()
}

fn window_of(session: Session) -> Harness<'static, App> {
    let open: OpenLog = Arc::new(|_, _| Err(OpenFailure::Problem("no other log is opened here".to_owned())));
    let mut app = App::new(open, Arc::new(TestDesktop::default()) as Arc<dyn Desktop>, ThemeName::Dark);
    app.show(Box::new(session), None);
    let mut harness = Harness::builder().with_size([1500.0, 900.0]).build_ui_state(|ui, app: &mut App| app.ui(ui), app);
    harness.run_steps(2);
    harness
}

pub(super) fn runs(harness: &Harness<'static, App>) -> Vec<RunRecord> {
    harness.state().log().unwrap().recording().runs.clone()
}

pub(super) fn all_finished(harness: &Harness<'static, App>) -> bool {
    harness.state().log().unwrap().recording().runs.iter().all(|run| run.finished)
}

/// Informed rank of a step; `None` during initialization.
fn informed(run: &RunRecord, step: usize) -> Option<usize> {
    run.steps[step].rank.as_ref().map(|rank| rank.rank_informed)
}

/// While the run computes, the cursor is at its last frame; a key takes the cursor away from there.
#[test]
fn the_window_opens_at_the_last_computed_frame_until_the_cursor_is_moved() {
    let mut harness = window_over_garden("auto", 4.0);
    let cursor_ns = |harness: &Harness<'static, App>| harness.state().log().unwrap().cursor_ns();
    run_until(&mut harness, all_finished);
    harness.run_steps(3);
    let last_ns = harness.state().log().unwrap().recording().last_stamp_ns();
    assert!(last_ns > 3_500_000_000);
    assert_eq!(cursor_ns(&harness), last_ns);
    harness.key_press(Key::Home);
    harness.run_steps(20);
    assert!(cursor_ns(&harness) < 500_000_000, "{}", cursor_ns(&harness));

    let mut harness = window_over_garden("auto", 6.0);
    run_until(&mut harness, |harness| cursor_ns(harness) > 500_000_000);
    assert!(!all_finished(&harness), "the cursor follows the run while it computes");
    harness.key_press(Key::Home);
    run_until(&mut harness, all_finished);
    harness.run_steps(3);
    assert!(cursor_ns(&harness) < 500_000_000, "{}", cursor_ns(&harness));
}

#[test]
fn a_classical_run_goes_on_as_minimal_from_where_its_rank_drops() {
    let mut harness = window_over_garden("classical", 6.6);
    run_until(&mut harness, all_finished);
    let parent = runs(&harness).remove(0);
    let drops = |step: &usize| informed(&parent, step - 1).zip(informed(&parent, *step)).is_some_and(|(a, b)| b < a);
    let at = (1..parent.steps.len()).rfind(drops).expect("the informed rank drops somewhere");
    let step = &parent.steps[at];

    // By keyboard: the palette moves the cursor to a frame.
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    harness.run_steps(3);
    harness.event(egui::Event::Text(format!("frame {}", step.report.frame_index)));
    harness.run_steps(3);
    harness.key_press(Key::Enter);
    harness.run_steps(3);
    assert_eq!(harness.state().log().unwrap().cursor_ns(), step.report.stamp_ns);
    let rank = step.rank.as_ref().unwrap();
    assert_eq!((rank.parameters.len(), rank.rank_structural, rank.deficit_parameterization), (24, 18, 6));

    harness.key_press(Key::F);
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("Fork classical at ").is_some());
    let combo = harness.get_all_by_role(Role::ComboBox).find(|node| node.value().as_deref() == Some("unchanged"));
    combo.unwrap().click();
    harness.run_steps(3);
    harness.get_by_label("minimal").click();
    harness.run_steps(3);
    harness.get_by_label("Fork").click();
    run_until(&mut harness, |harness| runs(harness).len() == 2 && all_finished(harness));

    let [parent, fork] = <[RunRecord; 2]>::try_from(runs(&harness)).unwrap();
    let origin = fork.origin.as_ref().unwrap();
    assert_eq!((origin.parent, origin.step, origin.stamp_ns), (parent.id, at, step.report.stamp_ns));
    assert_eq!(fork.steps.len(), parent.steps.len());
    for (number, (own, other)) in fork.steps.iter().zip(&parent.steps).enumerate() {
        assert_eq!(Arc::ptr_eq(own, other), number < at, "step {number}");
        assert_eq!(
            own.report.calibration.parameters.len(),
            if number < at { other.report.calibration.parameters.len() } else { 18 }
        );
    }
    let forked = fork.steps[at].rank.as_ref().unwrap();
    assert_eq!((forked.parameters.len(), forked.rank_structural, forked.deficit_parameterization), (18, 18, 0));

    // Both lanes have names next to the timeline, and the fork shows its origin.
    harness.run_steps(4);
    let timeline = harness.get_by_label("Timeline").rect();
    let lanes: Vec<String> = painted_texts(&harness)
        .into_iter()
        .filter(|painted| {
            let rect = painted.rect();
            rect.right() <= timeline.left() + 1.0 && timeline.y_range().contains(rect.center().y)
        })
        .map(|painted| painted.text().to_owned())
        .collect();
    for run in [&parent, &fork] {
        assert!(lanes.contains(&run.spec.label), "{} in {lanes:?}", run.spec.label);
    }
    harness.get_by_label_contains(&format!("Run {}", fork.spec.label)).hover();
    harness.run_steps(8);
    assert!(harness.query_by_label_contains("s: minimal").is_some(), "the legend shows where it was forked");

    // The comparison has both runs; they diverge at the frame of the fork.
    harness.key_press(Key::Num5);
    harness.run_steps(6);
    for run in [&parent, &fork] {
        let name = format!("Show run {} in all panels", run.spec.label);
        assert!(harness.query_by_label(&name).is_some(), "{name}");
    }
    let divergence_label = format!("First bitwise difference of {} from {}", fork.spec.label, parent.spec.label);
    let time = format!("{divergence_label}: {:.3} s", step.report.stamp_ns as f64 * 1e-9);
    assert!(harness.query_by_label(&time).is_some(), "{time}");

    // The rank panel next to it shows the fork.
    harness.get_by_label(&format!("Show run {} in all panels", fork.spec.label)).click();
    harness.run_steps(4);
    assert_eq!(harness.state().selection.run, 1);
    let verdicts = painted_texts(&harness);
    assert!(verdicts.iter().any(|painted| painted.text().contains("of 18")), "the rank panel shows the fork's rank");
    let buttons = harness.query_all_by_role(Role::Button);
    let unnamed = buttons.filter(|node| node.accesskit_node().label().is_none_or(|name| name.is_empty())).count();
    assert_eq!(unnamed, 0, "every button has a name");
}

/// The focal lengths of the rig are too long, and the check finds nothing.
#[test]
fn a_run_that_nothing_explains_is_diagnosed_when_it_has_ended_and_its_log_is_checked() {
    let is_diagnosed = |harness: &Harness<'static, App>| runs(harness)[0].diagnosis.is_some();
    let ended = |checked: bool| {
        let mut plan = garden("static", 5.5);
        for camera in &mut Arc::make_mut(&mut plan.rig).cameras {
            camera.model.intrinsics_px[..2].iter_mut().for_each(|focal_px| *focal_px *= 1.3);
        }
        let session = Session::start(plan).unwrap();
        if checked {
            session.check_log(|log, rig| {
                let findings = Vec::new();
                CheckReport { findings, ..log_check::check(log, Ok(rig), &[]) }
            });
        }
        let mut harness = window_of(session);
        run_until(&mut harness, all_finished);
        harness.run_steps(4);
        harness
    };
    let unchecked = ended(false);
    assert!(unchecked.query_by_label("Stop").is_none() && !is_diagnosed(&unchecked), "the check may explain it");
    let mut harness = ended(true);
    assert!(harness.query_by_label("Stop").is_some() || is_diagnosed(&harness), "it has begun by itself");
    if let Some(stop) = harness.query_by_label("Stop") {
        stop.click();
    }
    run_until(&mut harness, is_diagnosed);
    harness.run_steps(40);
    assert!(harness.query_by_label("Stop").is_none(), "it does not begin again");
    assert!(harness.query_all_by_label_contains("✖ Not usable").next().is_some(), "the window goes on");
}
