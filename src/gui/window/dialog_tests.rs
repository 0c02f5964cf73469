//! Tests of dialogs and inputs that could lose work or accept mistakes.

use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use super::WindowRequest;
use super::tests::{Bench, bench, commands_of};
use crate::gui::desktop::DrawnFigure;
use crate::gui::{Dialog, PanelName};
use crate::session::Command;

fn type_text(harness: &mut Harness<'static, Bench>, field: &str, text: &str) {
    harness.get_by_role_and_label(Role::TextInput, field).focus();
    harness.run_steps(1);
    harness.get_by_role_and_label(Role::TextInput, field).type_text(text);
    harness.run_steps(2);
}

#[test]
fn a_run_is_removed_after_a_question_and_undo_does_not_skip_it() {
    let mut harness = bench();
    // A change of the settings before, which undo must not revert instead.
    harness.state_mut().window.settings.scale = 1.25;
    harness.run_steps(4);
    let ask = |harness: &mut Harness<'static, Bench>| {
        harness.get_by_label("Run").click();
        harness.run_steps(3);
        harness.get_by_label_contains("Remove run classical").click();
        harness.run_steps(3);
    };
    let pushed = commands_of(&mut harness, |_| {});
    assert!(pushed.is_empty());
    ask(&mut harness);
    assert!(harness.query_by_label("Remove run classical?").is_some());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Cancel").click());
    assert!(pushed.is_empty(), "{pushed:?}");
    ask(&mut harness);
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Remove").click());
    assert_eq!(pushed, [Command::RemoveRun(1)]);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("Removing run classical cannot be undone").is_some());
    assert_eq!(harness.state().window.settings.scale, 1.25);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert_eq!(harness.state().window.settings.scale, 1.0);
}

#[test]
fn a_breakpoint_on_an_unknown_parameter_is_refused() {
    let mut harness = bench();
    let state = harness.state_mut();
    state.window.tiles.layout.set_visible(PanelName::Breakpoints, true);
    harness.run_steps(3);
    type_text(&mut harness, "Condition", "sigma(pitch.q) > 0");
    assert!(harness.get_by_label("Add breakpoint").accesskit_node().is_disabled());
    assert!(harness.query_by_label_contains("Unknown name 'pitch.q'; did you mean 'pitch.").is_some());
    let pushed = commands_of(&mut harness, |harness| harness.key_press(Key::Enter));
    assert!(pushed.is_empty(), "{pushed:?}");
    // Enter has left the field; a known name that no run estimates is accepted with a note.
    let mut harness = bench();
    harness.state_mut().window.tiles.layout.set_visible(PanelName::Breakpoints, true);
    harness.run_steps(3);
    type_text(&mut harness, "Condition", "sigma(k1) > 0");
    assert!(!harness.get_by_label("Add breakpoint").accesskit_node().is_disabled());
    assert!(harness.query_by_label_contains("No run has 'k1'").is_some());
}

#[test]
fn a_fork_with_a_misspelt_parameter_stays_open() {
    let mut harness = bench();
    harness.state_mut().window.dialogs.show(Dialog::Fork);
    harness.run_steps(3);
    type_text(&mut harness, "Freeze parameters", "yaw.alhpa");
    assert!(harness.query_by_label_contains("no parameter 'yaw.alhpa'; did you mean 'yaw.alpha'?").is_some());
    assert!(harness.get_by_label("Fork").accesskit_node().is_disabled());
    let pushed = commands_of(&mut harness, |harness| harness.key_press(Key::Enter));
    assert!(pushed.is_empty() && harness.state().window.dialogs.is_open(), "{pushed:?}");
}

#[test]
fn a_figure_of_the_focused_panel_is_composed_and_saved() {
    let mut harness = bench();
    harness.state_mut().window.tiles.focus = Some(PanelName::Residuals);
    harness.state_mut().selection.visible_ns = Some((1_000_000_000, 3_000_000_000));
    harness.run_steps(2);
    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::E);
    harness.run_steps(4);
    let command = |harness: &Harness<'static, Bench>| {
        let label = harness.get_by_label_contains("dcvins screenshot ");
        let node = label.accesskit_node();
        node.value().or_else(|| node.label()).unwrap_or_default()
    };
    let shown = command(&harness);
    assert!(shown.contains("--panel residuals --from 1 --to 3 --width-mm 85 --font-pt 8 --theme print"), "{shown}");
    harness.get_by_label("Two columns").click();
    harness.get_by_label("Whole log").click();
    harness.run_steps(3);
    let shown = command(&harness);
    assert!(shown.contains("--panel residuals --width-mm 175 --font-pt 8") && shown.ends_with("175mm.pdf"), "{shown}");
    harness.get_by_label("Save").click();
    harness.run_steps(3);
    let requests = &harness.state().window.requests;
    let Some(WindowRequest::WriteFigure(export)) = requests.last() else { panic!("{requests:?}") };
    assert!(export.path.ends_with("/residuals-175mm.pdf"), "{}", export.path);
    assert!(matches!(&export.figure, DrawnFigure::File(bytes) if bytes.starts_with(b"%PDF")));
    assert!(!harness.state().window.dialogs.is_open());
}
