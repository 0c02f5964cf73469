//! What a person may set once and for all, and the dialog for it.

use egui::util::undoer::Undoer;
use egui::{ComboBox, DragValue, Grid, Id, Key, Modal, Modifiers, RichText, Ui, vec2};
use serde::{Deserialize, Serialize};

use super::dialog_frame;
use super::tiles::Preset;
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::timeline::SPEEDS;
use crate::session::DEFAULT_MEMORY_BUDGET_BYTES;

/// Sizes that everything may be drawn at.
pub const SCALES: std::ops::RangeInclusive<f32> = 0.5..=3.0;
/// Mebibytes that a recording may take.
const MEMORY_MIB: std::ops::RangeInclusive<usize> = 64..=65_536;

/// The settings; they are kept for the next start.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub struct Settings {
    /// Colours.
    pub theme: ThemeName,
    /// How large everything is drawn, 1 as the screen has it.
    pub scale: f32,
    /// How much memory what is recorded may take, in MiB.
    pub memory_mib: usize,
    /// Where the panels are at the start: name of a preset or of a layout of one's own.
    pub layout: String,
    /// How fast a log plays at first, in log seconds per second.
    pub speed: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theme: ThemeName::default(),
            scale: 1.0,
            memory_mib: DEFAULT_MEMORY_BUDGET_BYTES >> 20,
            layout: Preset::default().name().to_owned(),
            speed: 1.0,
        }
    }
}

impl Settings {
    /// Reads what [`Settings::to_text`] wrote; what is missing or cannot be is as without settings.
    pub fn from_text(text: &str, theme: ThemeName) -> Self {
        let standard = Self { theme, ..Self::default() };
        let mut value: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
        // One setting that is not understood shall not take the others along.
        let Some(entries) = value.as_object_mut() else { return standard };
        let Ok(serde_json::Value::Object(known)) = serde_json::to_value(&standard) else { return standard };
        for (name, usual) in &known {
            let alone = |value: &serde_json::Value| {
                serde_json::from_value::<Self>(serde_json::json!({ name.as_str(): value })).is_ok()
            };
            if !entries.get(name).is_some_and(alone) {
                entries.insert(name.clone(), usual.clone());
            }
        }
        serde_json::from_value(value).map_or(standard, Self::sensible)
    }

    /// The settings as JSON.
    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// With every number in its range.
    fn sensible(mut self) -> Self {
        let clamp = |value: f32| value.clamp(*SCALES.start(), *SCALES.end());
        self.scale = if self.scale.is_finite() { clamp(self.scale) } else { 1.0 };
        self.memory_mib = self.memory_mib.clamp(*MEMORY_MIB.start(), *MEMORY_MIB.end());
        self.speed = if self.speed.is_finite() { self.speed.clamp(0.01, 100.0) } else { 1.0 };
        self
    }

    /// How much memory what is recorded may take, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.memory_mib << 20
    }
}

/// State of the dialog.
#[derive(Debug, Default)]
pub struct SettingsDialog {
    open: bool,
    undoer: Undoer<Settings>,
}

impl SettingsDialog {
    /// Opens it.
    pub fn show(&mut self) {
        self.open = true;
    }

    /// Whether it is open.
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// Closes it.
    pub fn hide(&mut self) {
        self.open = false;
    }

    /// Draws it; settings hold as soon as they are changed.
    pub(super) fn ui<'a>(
        &mut self,
        ui: &Ui,
        theme: &Theme,
        settings: &mut Settings,
        layouts: impl Iterator<Item = &'a str>,
    ) {
        if !self.open {
            return;
        }
        self.undoer.feed_state(ui.input(|input| input.time), settings);
        let modal = Modal::new(Id::unique("settings")).frame(dialog_frame(theme));
        let response = modal.show(ui.ctx(), |ui| {
            ui.set_width(430.0);
            ui.label(RichText::new("Settings").size(15.0).color(theme.text_strong));
            ui.add_space(4.0);
            fields_ui(ui, settings, layouts);
            ui.add_space(4.0);
            ui.label(RichText::new("They hold at once and are kept for the next start").color(theme.text_weak));
            ui.add_space(6.0);
            let keys = ui.input_mut(|input| {
                let redo = input.consume_key(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
                (!redo && input.consume_key(Modifiers::COMMAND, Key::Z), redo)
            });
            ui.horizontal(|ui| {
                let close = ui.button("Close").clicked();
                let (undoes, redoes) = (self.undoer.has_undo(settings), self.undoer.has_redo(settings));
                let button = |ui: &mut Ui, able: bool, text: &str, keys: &str| {
                    ui.add_enabled(able, egui::Button::new(text)).on_hover_text(keys).clicked()
                };
                let undo = button(ui, undoes, "Undo", "Ctrl+Z") || keys.0 && undoes;
                let redo = button(ui, redoes, "Redo", "Ctrl+Shift+Z") || keys.1 && redoes;
                let other = if undo {
                    self.undoer.undo(settings)
                } else if redo {
                    self.undoer.redo(settings)
                } else {
                    None
                };
                if let Some(other) = other.cloned() {
                    *settings = other;
                }
                if ui.button("As delivered").clicked() {
                    *settings = Settings { theme: settings.theme, ..Settings::default() };
                }
                close
            })
            .inner
        });
        if response.should_close() || response.inner {
            self.open = false;
        }
    }
}

fn fields_ui<'a>(ui: &mut Ui, settings: &mut Settings, layouts: impl Iterator<Item = &'a str>) {
    Grid::new("settings").num_columns(2).spacing(vec2(12.0, 6.0)).show(ui, |ui| {
        let name = ui.label("Theme");
        let themes = [ThemeName::Light, ThemeName::Dark, ThemeName::Print];
        let combo = ComboBox::from_id_salt("theme").width(200.0).selected_text(settings.theme.as_str());
        let shown = combo.show_ui(ui, |ui| {
            for theme in themes {
                ui.selectable_value(&mut settings.theme, theme, theme.as_str());
            }
        });
        shown.response.labelled_by(name.id);
        ui.end_row();
        let name = ui.label("Size of everything");
        let drag = DragValue::new(&mut settings.scale).range(SCALES).speed(0.01).max_decimals(2).suffix("×");
        ui.add(drag).labelled_by(name.id).on_hover_text("Ctrl and +, − or 0 do the same");
        ui.end_row();
        let name = ui.label("Memory of a recording");
        ui.add(DragValue::new(&mut settings.memory_mib).range(MEMORY_MIB).speed(4.0).suffix(" MiB"))
            .labelled_by(name.id)
            .on_hover_text("What does not fit is kept in outline and taken again when you go there");
        ui.end_row();
        let name = ui.label("Layout at the start");
        let combo = ComboBox::from_id_salt("layout").width(200.0).selected_text(&settings.layout);
        let shown = combo.show_ui(ui, |ui| {
            for layout in Preset::ALL.map(Preset::name).into_iter().chain(layouts) {
                ui.selectable_value(&mut settings.layout, layout.to_owned(), layout);
            }
        });
        shown.response.labelled_by(name.id);
        ui.end_row();
        let name = ui.label("Speed at the start");
        let text = |speed: f64| format!("{speed}×");
        let combo = ComboBox::from_id_salt("speed at the start").width(200.0).selected_text(text(settings.speed));
        let shown = combo.show_ui(ui, |ui| {
            for speed in SPEEDS {
                ui.selectable_value(&mut settings.speed, speed, text(speed));
            }
        });
        shown.response.labelled_by(name.id);
        ui.end_row();
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back_and_nonsense_harms_nothing_else() {
        let settings =
            Settings { theme: ThemeName::Print, scale: 1.5, memory_mib: 700, layout: "mine".to_owned(), speed: 0.5 };
        assert_eq!(Settings::from_text(&settings.to_text(), ThemeName::Light), settings);
        let standard = Settings { theme: ThemeName::Light, ..Settings::default() };
        for text in ["", "no json", "[]", "{}", "{\"scale\": \"large\", \"theme\": \"pink\"}"] {
            assert_eq!(Settings::from_text(text, ThemeName::Light), standard, "{text}");
        }
        let mixed = "{\"theme\": 7, \"scale\": 1e9, \"memory_mib\": 0, \"speed\": -1, \"later\": true}";
        let read = Settings::from_text(mixed, ThemeName::Dark);
        assert_eq!((read.theme, read.scale, read.memory_mib, read.speed), (ThemeName::Dark, 3.0, 64, 0.01));
    }
}
