//! Question asked before unsaved work is discarded.

use egui::{Button, Key, RichText, Ui};

use super::modal::Modal;
use crate::gui::PanelContext;
use crate::gui::window::request::WindowRequest;

/// Draws the question; `lost` is the unsaved work as text. Returns true if it stays open.
pub(super) fn ui(ui: &Ui, ctx: &PanelContext<'_>, lost: &str, requests: &mut Vec<WindowRequest>) -> bool {
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
