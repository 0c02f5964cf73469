//! Common parts of all dialogs: backdrop, frame, title, and closing.

use egui::{Button, Context, Id, Key, LayerId, PointerState, RichText, Ui};

use crate::gui::theme::{Theme, dialog_frame};

#[derive(Clone, Copy, Debug)]
pub(in crate::gui) struct Modal<'a> {
    /// Id in the window.
    pub(in crate::gui) name: &'static str,
    /// Title; not shown if it is empty.
    pub(in crate::gui) title: &'a str,
    /// Width of the content in points; less in a window that is narrower.
    pub(in crate::gui) width: f32,
}

/// Space in points between the content and the edges of the window.
const MARGIN: f32 = 24.0;

impl Modal<'_> {
    /// Draws the dialog. Returns the result of `contents`, and true if the dialog stays open.
    ///
    /// Escape, a click outside and `ui.close()` in the contents close it.
    pub(in crate::gui) fn ui<T>(self, ui: &Ui, theme: &Theme, contents: impl FnOnce(&mut Ui) -> T) -> (T, bool) {
        show_pointer(ui.ctx());
        let modal = egui::Modal::new(Id::unique(self.name)).frame(dialog_frame(theme));
        let response = modal.show(ui.ctx(), |ui| {
            ui.set_width(self.width.min(ui.ctx().content_rect().width() - 2.0 * MARGIN));
            if !self.title.is_empty() {
                ui.label(RichText::new(self.title).size(15.0).color(theme.text_strong));
            }
            contents(ui)
        });
        let stays_open = !response.should_close();
        (response.inner, stays_open)
    }
}

/// Hides the pointer from everything that is drawn below an open dialog, until [`show_pointer`]; called at the begin of a
/// frame. Without it egui keeps a tooltip open while the pointer is at its widget, even over a dialog.
pub(in crate::gui) fn hide_covered_pointer(ctx: &Context) {
    if !ctx.memory(|memory| memory.is_above_modal_layer(LayerId::background())) {
        let pointer = ctx.input_mut(|input| std::mem::take(&mut input.pointer));
        ctx.data_mut(|data| data.insert_temp(hidden_pointer(), pointer));
    }
}

/// Ends what [`hide_covered_pointer`] began; called by each dialog and at the end of a frame.
pub(in crate::gui) fn show_pointer(ctx: &Context) {
    let hidden = ctx.data_mut(|data| data.remove_temp::<PointerState>(hidden_pointer()));
    if let Some(pointer) = hidden {
        ctx.input_mut(|input| input.pointer = pointer);
    }
}

fn hidden_pointer() -> Id {
    Id::unique("pointer over a dialog")
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
