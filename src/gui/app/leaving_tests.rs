//! Tests: leaving a log, restoring the window, and names in the welcome view.

use std::path::PathBuf;
use std::sync::Arc;

use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::App;
use super::tests::{Dropped, TestDesktop, app, opened, run_until, sample_opener};
use crate::gui::desktop::Desktop;
use crate::gui::theme::ThemeName;

/// Opens the sample log and sets a marker.
fn with_marker() -> (Harness<'static, App>, Arc<TestDesktop>) {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.key_press(Key::M);
    harness.run_steps(2);
    (harness, desktop)
}

/// Presses a key with Ctrl.
fn with_ctrl(harness: &mut Harness<'static, App>, key: Key) {
    harness.key_press_modifiers(Modifiers::COMMAND, key);
    harness.run_steps(3);
}

/// The commands to the window in the next frames.
fn viewport_commands(harness: &mut Harness<'static, App>) -> Vec<egui::ViewportCommand> {
    let mut commands = Vec::new();
    for _ in 0..3 {
        harness.run_steps(1);
        let viewports = harness.output().viewport_output.values();
        commands.extend(viewports.flat_map(|viewport| viewport.commands.clone()));
    }
    commands
}

#[test]
fn ctrl_w_closes_a_log_without_unsaved_work_at_once() {
    let (mut harness, _) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    with_ctrl(&mut harness, Key::W);
    assert!(opened(&harness).is_none() && harness.query_by_label("Recent logs").is_some());
}

#[test]
fn unsaved_work_is_asked_about_before_it_is_left() {
    let (mut harness, desktop) = with_marker();
    let question = "Not saved in yard.mcap: 1 marker";
    with_ctrl(&mut harness, Key::Q);
    assert!(!harness.state().departure.quits);
    assert!(harness.query_by_label(question).is_some());
    harness.key_press(Key::Escape);
    harness.run_steps(3);
    assert!(harness.query_by_label(question).is_none() && opened(&harness).is_some());
    // Opening another log after saving.
    harness.input_mut().dropped_files.push(Arc::new(Dropped(PathBuf::from("/x/b.mcap"))));
    harness.run_steps(3);
    harness.get_by_role_and_label(egui::Role::Button, "Open").click();
    harness.run_steps(3);
    assert!(harness.query_by_label(question).is_some());
    harness.get_by_label("Save").click();
    run_until(&mut harness, |harness| opened(harness) == Some(PathBuf::from("/x/b.mcap")));
    assert!(desktop.sessions.lock().unwrap()[0].contains("stamp_ns"));
    // The new log has its own marker, which is discarded.
    harness.key_press(Key::M);
    harness.run_steps(2);
    with_ctrl(&mut harness, Key::W);
    harness.get_by_label("Discard").click();
    harness.run_steps(3);
    assert!(opened(&harness).is_none());
    assert_eq!(desktop.sessions.lock().unwrap().len(), 1);
}

#[test]
fn a_saved_session_is_left_without_a_question() {
    let (mut harness, _) = with_marker();
    with_ctrl(&mut harness, Key::S);
    with_ctrl(&mut harness, Key::Q);
    assert!(harness.state().departure.quits);
}

#[test]
fn the_close_button_of_the_window_asks_too() {
    let (mut harness, _) = with_marker();
    let close = |harness: &mut Harness<'static, App>| {
        let viewports = &mut harness.input_mut().viewports;
        viewports.get_mut(&egui::ViewportId::ROOT).unwrap().events.push(egui::ViewportEvent::Close);
        viewport_commands(harness)
    };
    assert!(close(&mut harness).contains(&egui::ViewportCommand::CancelClose));
    harness.get_by_label("Discard").click();
    assert!(viewport_commands(&mut harness).contains(&egui::ViewportCommand::Close));
    assert!(!close(&mut harness).contains(&egui::ViewportCommand::CancelClose), "the answer holds");
}

#[test]
fn the_layout_is_kept_and_restored() {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.key_press(Key::Num4);
    // It is stored some time after the change.
    harness.run_steps(90);
    let kept = desktop.window.lock().unwrap().clone().expect("it is stored");
    assert!(kept.contains("\"preset\":\"Scene\"") && kept.contains("\"size\""), "{kept}");
    let again = App::new(sample_opener(), desktop as Arc<dyn Desktop>, ThemeName::Dark);
    assert!(again.state.tiles.last_layout_value() == harness.state().state.tiles.last_layout_value());
}

#[test]
fn everything_in_the_welcome_view_has_a_name() {
    use egui::accesskit::Action;
    use egui_kittest::kittest::{By, NodeT as _};

    let (harness, _) = app();
    let usable = By::new().predicate(|node| {
        let acts = |action| node.data().supports_action(action);
        let container = matches!(
            node.role(),
            egui::Role::GenericContainer | egui::Role::Window | egui::Role::ScrollView | egui::Role::ScrollBar
        );
        (acts(Action::Click) || acts(Action::Focus)) && !container
    });
    let names: Vec<(egui::Role, Option<String>)> =
        harness.query_all(usable).map(|node| (node.accesskit_node().role(), node.accesskit_node().label())).collect();
    assert!(names.len() > 3, "{names:?}");
    let named = |(role, name): &(egui::Role, Option<String>)| {
        *role != egui::Role::Unknown && name.as_ref().is_some_and(|name| !name.trim().is_empty())
    };
    assert!(names.iter().all(named), "{names:?}");
}
