//! What all dialogs share: backdrop, frame, title, and how they close.

use egui::{Button, Id, Key, RichText, Ui};

use crate::gui::theme::{Theme, dialog_frame};

/// A dialog that the rest of the window waits for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Modal<'a> {
    /// Its name among the parts of the window.
    pub(super) name: &'static str,
    /// The first line, none where it is empty.
    pub(super) title: &'a str,
    /// Width of the contents in points.
    pub(super) width: f32,
}

impl Modal<'_> {
    /// Draws the dialog; returns what the contents returned, and whether the dialog stays open.
    ///
    /// Escape, a click beside it and `ui.close()` in the contents close it.
    pub(super) fn ui<T>(self, ui: &Ui, theme: &Theme, contents: impl FnOnce(&mut Ui) -> T) -> (T, bool) {
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

/// The last line of a dialog that asks for something: the button that accepts, which Enter presses too, and the one that
/// cancels. Either closes the dialog; returns whether it was accepted.
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
