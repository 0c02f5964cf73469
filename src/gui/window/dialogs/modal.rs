//! Common parts of all dialogs: backdrop, frame, title, and closing.

use egui::{Button, Id, Key, RichText, Ui};

use crate::gui::theme::{Theme, dialog_frame};

#[derive(Clone, Copy, Debug)]
pub(in crate::gui) struct Modal<'a> {
    /// Id in the window.
    pub(in crate::gui) name: &'static str,
    /// Title; not shown if it is empty.
    pub(in crate::gui) title: &'a str,
    /// Width of the content in points.
    pub(in crate::gui) width: f32,
}

impl Modal<'_> {
    /// Draws the dialog. Returns the result of `contents`, and true if the dialog stays open.
    ///
    /// Escape, a click outside and `ui.close()` in the contents close it.
    pub(in crate::gui) fn ui<T>(self, ui: &Ui, theme: &Theme, contents: impl FnOnce(&mut Ui) -> T) -> (T, bool) {
        let modal = egui::Modal::new(Id::unique(self.name)).frame(dialog_frame(theme));
        let response = modal.show(ui.ctx(), |ui| {
            ui.set_width(self.width);
            if !self.title.is_empty() {
                ui.label(RichText::new(self.title).size(15.0).color(theme.text_strong));
            }
            contents(ui)
        });
        let stays_open = !response.should_close();
        (response.inner, stays_open)
    }
}

/// Draws the buttons at the bottom: one accepts, also by Enter, the other cancels. Both close the dialog; returns true
/// if it was accepted.
pub(super) fn accept_or_cancel_ui(ui: &mut Ui, label: &str, ready: bool) -> bool {
    let enter = ui.input(|input| input.key_pressed(Key::Enter));
    let clicked = ui.horizontal(|ui| {
        let accepted = ui.add_enabled(ready, Button::new(label)).clicked();
        let cancelled = ui.button("Cancel").clicked();
        (accepted, cancelled)
    });
    let (accepted, cancelled) = clicked.inner;
    let accepted = ready && (accepted || enter);
    if accepted || cancelled {
        ui.close();
    }
    accepted
}
