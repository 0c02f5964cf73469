//! The list of shortcuts.

use egui::{Align2, Grid, RichText, Ui, vec2};

use super::actions::TABLE;
use crate::gui::theme::Theme;

/// Actions of the pointer.
const POINTER: [(&str, &str); 6] = [
    ("Drag", "move the cursor"),
    ("Ctrl+scroll", "zoom in time, in all plots at once; over the timeline scrolling is enough"),
    ("Middle drag", "move through time"),
    ("Double click", "show the whole log"),
    ("Shift+drag on the timeline", "set the range that is played over and over"),
    ("Click a parameter or a feature", "select it in all panels"),
];

/// Keys that work everywhere.
const EVERYWHERE: [(&str, &str); 3] = [
    ("Tab, Shift+Tab", "the next or previous button, tab or plot; Enter or Space presses it"),
    ("Ctrl and +, − or 0", "everything larger, smaller, or as it was"),
    ("Ctrl+P, then a number", "go to a time, a frame, a feature"),
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
        for (title, rows) in [("Everywhere", &EVERYWHERE[..]), ("With the pointer over a plot", &POINTER[..])] {
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
