//! Tests of the tour by its keys and labels.

use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::story::{Story, classical};
use crate::gui::PanelName;
use crate::gui::rank::verdict::verdict;
use crate::gui::samples::{SAMPLE_FRAMES, sample_recording_of};
use crate::gui::window::tests::{Bench, bench_of, commands_of};
use crate::session::{Command, Recording};

const SIZE: [f32; 2] = [1366.0, 768.0];

fn recording(runs: &[&str]) -> Recording {
    sample_recording_of(SAMPLE_FRAMES, runs)
}

/// Presses a key, and moves the cursor if the tour requests it.
fn press(harness: &mut Harness<'static, Bench>, key: Key) -> Vec<Command> {
    let pushed = commands_of(harness, |harness| harness.key_press(key));
    for command in &pushed {
        if let Command::Seek { stamp_ns } = command {
            harness.state_mut().cursor_ns = *stamp_ns;
        }
    }
    harness.run_steps(6);
    pushed
}

fn stands_at(harness: &Harness<'static, Bench>, number: usize) -> bool {
    harness.query_by_label_contains(&format!("{number} of 6: ")).is_some()
}

#[test]
fn six_steps_drive_the_window_and_take_their_numbers_from_the_recording() {
    let mut harness = bench_of(recording(&["auto", "classical"]), SIZE);
    harness.state_mut().window.tour.start();
    harness.run_steps(6);
    assert!(stands_at(&harness, 1));
    let mut story = Story::new(&harness.state().recording.runs[0]);
    story.read(&harness.state().recording.runs);
    let instant_ns = story.instant_ns.unwrap();
    let step = story.step(&harness.state().recording.runs).unwrap().clone();
    for (number, panel, run) in [
        (2, PanelName::Image, 0),
        (3, PanelName::Convergence, 0),
        (4, PanelName::Rank, 0),
        (5, PanelName::Rank, 1),
        (6, PanelName::Rank, 0),
    ] {
        let pushed = press(&mut harness, Key::Enter);
        assert!(pushed.contains(&Command::Seek { stamp_ns: instant_ns }), "{number}: {pushed:?}");
        assert!(stands_at(&harness, number), "{number}");
        assert_eq!(harness.state().window.tiles.focus, Some(panel));
        assert_eq!(harness.state().selection.run, run, "{number}");
        if number == 4 {
            let headline = verdict(&step, &harness.state().recording.rig.parameter_names()).headline;
            assert!(harness.query_all_by_label_contains(&headline).count() > 1, "panel and card say: {headline}");
            assert!(harness.state().selection.parameter.is_some());
        }
        if number == 5 {
            assert!(harness.query_by_label_contains("structural rank 18 of 24").is_some());
        }
    }
    assert!(harness.query_by_label_contains("The answer: ").is_some());
    assert!(harness.query_all_by_label_contains("Suggested excitation: ").count() > 0);
    press(&mut harness, Key::Backspace);
    assert!(stands_at(&harness, 5));
    press(&mut harness, Key::Enter);
    press(&mut harness, Key::Enter);
    assert!(!harness.state().window.tour.is_running(), "the last step ends the tour");
    assert!(harness.query_by_label_contains("of 6: ").is_none());
}

#[test]
fn the_run_for_comparison_is_added_once_and_escape_ends_the_tour() {
    let mut harness = bench_of(recording(&["auto"]), SIZE);
    assert_eq!(classical(&harness.state().recording.runs), None);
    harness.state_mut().window.tour.start();
    harness.run_steps(6);
    let mut added = Vec::new();
    for _ in 2..=6 {
        added.extend(press(&mut harness, Key::Enter).into_iter().filter(|one| matches!(one, Command::AddRun(_))));
    }
    assert_eq!(added, [Command::AddRun("classical".parse().unwrap())]);
    press(&mut harness, Key::Escape);
    assert!(!harness.state().window.tour.is_running());
}

#[test]
fn a_log_that_is_still_computed_is_waited_for() {
    let mut recording = recording(&["auto"]);
    recording.runs[0].finished = false;
    let mut harness = bench_of(recording, SIZE);
    harness.state_mut().window.tour.start();
    harness.run_steps(6);
    let pushed = press(&mut harness, Key::Enter);
    assert!(!pushed.iter().any(|command| matches!(command, Command::Seek { .. })), "{pushed:?}");
    assert!(harness.query_by_label_contains("Computing run auto: ").is_some());
}
