//! The command palette and the sheet of shortcuts: two views of one table.

use egui::{Align2, Grid, Id, Key, Modal, RichText, ScrollArea, TextEdit, Ui, vec2};

use super::actions::{Action, TABLE};
use super::dialog_frame;
use crate::gui::theme::Theme;

/// State of the command palette.
#[derive(Debug, Default)]
pub struct CommandPalette {
    open: bool,
    typed: String,
    chosen: usize,
}

impl CommandPalette {
    /// Opens it, empty.
    pub fn show(&mut self) {
        *self = Self { open: true, ..Self::default() };
    }

    /// Closes it.
    pub fn hide(&mut self) {
        self.open = false;
    }

    /// Draws it; what is chosen joins the actions.
    pub(crate) fn ui(&mut self, ui: &Ui, theme: &Theme, actions: &mut Vec<Action>) {
        if !self.open {
            return;
        }
        let typed = self.typed.to_lowercase();
        let found: Vec<_> = TABLE
            .iter()
            .filter(|entry| !matches!(entry.action, Action::Palette | Action::Dismiss))
            .filter(|entry| typed.split_whitespace().all(|word| entry.name.to_lowercase().contains(word)))
            .collect();
        self.chosen = self.chosen.min(found.len().saturating_sub(1));
        let mut taken = None;
        let modal = Modal::new(Id::unique("command palette")).frame(dialog_frame(theme));
        let response = modal.show(ui.ctx(), |ui| {
            ui.set_width(380.0);
            let (up, down, enter) = ui.input_mut(|input| {
                let mut key = |key| input.consume_key(egui::Modifiers::NONE, key);
                (key(Key::ArrowUp), key(Key::ArrowDown), key(Key::Enter))
            });
            let edit = TextEdit::singleline(&mut self.typed).hint_text("Type a command").desired_width(f32::INFINITY);
            let edit = ui.add(edit);
            edit.widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Command"));
            edit.request_focus();
            if edit.changed() {
                self.chosen = 0;
            }
            let last = found.len().saturating_sub(1);
            if down {
                self.chosen = (self.chosen + 1).min(last);
            }
            if up {
                self.chosen = self.chosen.saturating_sub(1);
            }
            ScrollArea::vertical().max_height(360.0).show(ui, |ui| {
                for (number, entry) in found.iter().enumerate() {
                    ui.horizontal(|ui| {
                        let row = ui.selectable_label(number == self.chosen, entry.name);
                        if row.clicked() {
                            taken = Some(entry.action);
                        }
                        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                            ui.label(RichText::new(entry.keys).small().color(theme.text_weak));
                        });
                    });
                }
            });
            if enter {
                taken = found.get(self.chosen).map(|entry| entry.action);
            }
        });
        if taken.is_some() || response.should_close() {
            self.open = false;
        }
        actions.extend(taken);
    }
}

/// The sheet of shortcuts.
pub(super) fn shortcuts_ui(ui: &Ui, theme: &Theme, open: &mut bool) {
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
        ui.separator();
        ui.label(RichText::new("With the pointer over a plot").color(theme.text_weak));
        Grid::new("pointer").spacing(vec2(16.0, 4.0)).show(ui, |ui| {
            for (how, what) in [
                ("Drag", "move the cursor"),
                ("Ctrl+scroll", "zoom in time, in all plots at once; over the timeline scrolling is enough"),
                ("Middle drag", "move through time"),
                ("Double click", "show the whole log"),
                ("Shift+drag on the timeline", "set the range that is played over and over"),
                ("Click a parameter or a feature", "select it in all panels"),
            ] {
                ui.label(RichText::new(how).monospace().color(theme.text_strong));
                ui.label(RichText::new(what).color(theme.text));
                ui.end_row();
            }
        });
    });
}
