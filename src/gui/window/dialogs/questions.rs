//! Questions asked before work is discarded: unsaved work, and a run.

use egui::{Button, Key, RichText, Ui};

use super::modal::Modal;
use crate::geometry::seconds_from_ns;
use crate::gui::PanelContext;
use crate::gui::window::history::SettingsHistory;
use crate::gui::window::request::WindowRequest;
use crate::session::{Command, Recording};

/// Draws the question; `lost` is the unsaved work as text. Returns true if it stays open.
pub(super) fn unsaved_ui(ui: &Ui, ctx: &PanelContext<'_>, lost: &str, requests: &mut Vec<WindowRequest>) -> bool {
    let modal = Modal { name: "unsaved", title: "Save the session?", width: 430.0 };
    let contents = modal.ui(ui, ctx.theme, |ui| {
        ui.add_space(4.0);
        ui.label(format!("Not saved in {}: {lost}", ctx.recording.log_name()));
        let hint = "A saved session opens like a log; its results are recomputed bit for bit";
        ui.label(RichText::new(hint).color(ctx.theme.text_weak));
        ui.add_space(6.0);
        let enter = ui.input(|input| input.key_pressed(Key::Enter));
        ui.horizontal(|ui| {
            let save = ui.add(Button::new("Save"));
            // The safe answer has the focus: Enter saves, Tab moves to the others.
            if ui.memory(|memory| memory.focused().is_none()) {
                save.request_focus();
            }
            let saves = save.clicked() || enter && save.has_focus();
            let discards = ui.button("Discard").clicked();
            if saves || discards {
                requests.push(WindowRequest::Leave { save: saves });
            }
            if ui.button("Cancel").clicked() || saves || discards {
                ui.close();
            }
        });
    });
    contents.1
}

/// Draws the question about run `number`. Returns true if it stays open.
pub(super) fn remove_run_ui(ui: &Ui, ctx: &mut PanelContext<'_>, number: usize, history: &mut SettingsHistory) -> bool {
    let Some(run) = ctx.recording.runs.get(number) else { return false };
    let title = format!("Remove run {}?", run.spec.label);
    let modal = Modal { name: "remove run", title: &title, width: 430.0 };
    let contents = modal.ui(ui, ctx.theme, |ui| {
        ui.add_space(4.0);
        for line in consequences(ctx.recording, number) {
            ui.add(egui::Label::new(RichText::new(line).color(ctx.theme.text)).wrap());
        }
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let removed = ui.button("Remove").clicked();
            let cancel = ui.add(Button::new("Cancel"));
            // The safe answer has the focus.
            if ui.memory(|memory| memory.focused().is_none()) {
                cancel.request_focus();
            }
            if removed {
                ctx.commands.push(Command::RemoveRun(number));
                history.set_barrier(format!("Removing run {} cannot be undone", run.spec.label));
            }
            if removed || cancel.clicked() {
                ui.close();
            }
        });
    });
    contents.1
}

/// Work that is lost with a run.
fn consequences(recording: &Recording, number: usize) -> Vec<String> {
    let Some(run) = recording.runs.get(number) else { return Vec::new() };
    let mut lines = Vec::new();
    if let Some(origin) = &run.origin {
        let time_s = seconds_from_ns(origin.stamp_ns);
        lines.push(format!("It is a fork at {time_s:.3} s with the changes: {}", origin.changes));
    }
    let forks = recording.runs.iter().filter(|other| other.origin.as_ref().is_some_and(|from| from.parent == run.id));
    let forks: Vec<&str> = forks.map(|fork| fork.spec.label.as_str()).collect();
    if !forks.is_empty() {
        lines.push(format!("Its forks depend on it: {}", forks.join(", ")));
    }
    lines.push(format!("Its results of {} frames are discarded. This cannot be undone.", run.steps.len()));
    lines
}
