//! The list of shortcuts.

use egui::{Align2, Grid, RichText, Ui, vec2};

use super::actions::TABLE;
use crate::gui::theme::Theme;

/// Actions of the pointer.
const POINTER: [(&str, &str); 6] = [
    ("Drag", "move the cursor"),
    ("Ctrl+scroll", "zoom the time axis of all plots (timeline: scroll without Ctrl)"),
    ("Middle drag", "pan in time"),
    ("Double-click", "zoom out to the whole log"),
    ("Shift+drag on the timeline", "set the loop range"),
    ("Click a parameter or a feature", "select in all panels"),
];

/// Keys that work everywhere.
const EVERYWHERE: [(&str, &str); 3] = [
    ("Tab, Shift+Tab", "focus the next or previous control; Enter or Space activates it"),
    ("Ctrl and +, − or 0", "zoom in, zoom out, reset zoom"),
    ("Ctrl+P, then a number", "go to a time or frame, select a feature"),
];

/// Draws the list while it is open.
pub(super) fn ui(ui: &Ui, theme: &Theme, open: &mut bool) {
    let window = egui::Window::new("Shortcuts").open(open).collapsible(false).resizable(false);
    window.anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).show(ui.ctx(), |ui| {
        ui.horizontal_top(|ui| {
            let half = TABLE.len().div_ceil(2);
            for (column, entries) in TABLE.chunks(half).enumerate() {
                Grid::new(("shortcuts", column)).spacing(vec2(16.0, 4.0)).show(ui, |ui| {
                    for entry in entries {
                        ui.label(RichText::new(entry.keys).monospace().color(theme.text_strong));
                        ui.label(RichText::new(entry.name).color(theme.text));
                        ui.end_row();
                    }
                });
                ui.add_space(24.0);
            }
        });
        for (title, rows) in [("Keyboard", &EVERYWHERE[..]), ("Pointer on a plot or the timeline", &POINTER[..])] {
            ui.separator();
            ui.label(RichText::new(title).color(theme.text_weak));
            Grid::new(title).spacing(vec2(16.0, 4.0)).show(ui, |ui| {
                for (how, what) in rows {
                    ui.label(RichText::new(*how).monospace().color(theme.text_strong));
                    ui.label(RichText::new(*what).color(theme.text));
                    ui.end_row();
                }
            });
        }
    });
}
