//! Headings and entries of the context menu.

use egui::{Button, RichText, Role, Ui, WidgetInfo};

use crate::gui::theme::Theme;
use crate::gui::window::actions::{Action, keys_of};

/// Draws the heading of a section; one that is not the first is separated from those above.
pub(super) fn heading_ui(ui: &mut Ui, theme: &Theme, text: &str) {
    if ui.min_rect().height() > 1.0 {
        ui.separator();
    }
    ui.label(RichText::new(text).small().color(theme.text_weak));
}

/// Draws an entry with the keys of an action that does the same; returns true if it is clicked.
pub(super) fn entry_ui(ui: &mut Ui, text: &str, enabled: bool, same: Option<Action>) -> bool {
    let keys = same.map_or("", keys_of);
    let response = ui.add_enabled(enabled, Button::new(text).shortcut_text(keys));
    response.widget_info(|| WidgetInfo::labeled(Role::Button, enabled, text));
    response.clicked()
}
