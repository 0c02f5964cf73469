//! Dialog with the settings of the window.

use egui::{DragValue, Grid, Key, Modifiers, RichText, Ui, vec2};

use super::modal::Modal;
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::timeline::SPEEDS;
use crate::gui::widgets::choice_ui;
use crate::gui::window::actions::Action;
use crate::gui::window::history::SettingsHistory;
use crate::gui::window::settings::{LAST_LAYOUT, MEMORY_MIB, SCALES, Settings};
use crate::gui::window::tiles::Preset;
use crate::text::Named as _;

/// Draws the dialog; changes have effect immediately. Returns true if it stays open.
pub(super) fn ui<'a>(
    ui: &Ui,
    theme: &Theme,
    settings: &mut Settings,
    history: &SettingsHistory,
    layouts: impl Iterator<Item = &'a str>,
    actions: &mut Vec<Action>,
) -> bool {
    let modal = Modal { name: "settings", title: "Settings", width: 430.0 };
    let contents = modal.ui(ui, theme, |ui| {
        ui.add_space(4.0);
        fields_ui(ui, settings, layouts);
        ui.add_space(4.0);
        ui.label(RichText::new("Applied immediately and saved for the next start").color(theme.text_weak));
        ui.add_space(6.0);
        buttons_ui(ui, settings, history, actions);
    });
    contents.1
}

fn buttons_ui(ui: &mut Ui, settings: &mut Settings, history: &SettingsHistory, actions: &mut Vec<Action>) {
    let keys = ui.input_mut(|input| {
        let redo = input.consume_key(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
        (!redo && input.consume_key(Modifiers::COMMAND, Key::Z), redo)
    });
    ui.horizontal(|ui| {
        if ui.button("Close").clicked() {
            ui.close();
        }
        let (undoes, redoes) = (history.can_undo(), history.can_redo());
        let button = |ui: &mut Ui, able: bool, text: &str, keys: &str| {
            ui.add_enabled(able, egui::Button::new(text)).on_hover_text(keys).clicked()
        };
        if button(ui, undoes, "Undo", "Ctrl+Z") || keys.0 && undoes {
            actions.push(Action::Undo);
        }
        if button(ui, redoes, "Redo", "Ctrl+Shift+Z") || keys.1 && redoes {
            actions.push(Action::Redo);
        }
        if ui.button("Restore defaults").clicked() {
            *settings = Settings { theme: settings.theme, ..Settings::default() };
        }
    });
}

fn fields_ui<'a>(ui: &mut Ui, settings: &mut Settings, layouts: impl Iterator<Item = &'a str>) {
    Grid::new("settings").num_columns(2).spacing(vec2(12.0, 6.0)).show(ui, |ui| {
        let themes = [ThemeName::Light, ThemeName::Dark, ThemeName::Print];
        choice_ui(ui, "Theme", 200.0, &mut settings.theme, themes, |theme| theme.name().to_owned());
        ui.end_row();
        let name = ui.label("Scale");
        let drag = DragValue::new(&mut settings.scale).range(SCALES).speed(0.01).max_decimals(2).suffix("×");
        ui.add(drag).labelled_by(name.id).on_hover_text("Scale of the user interface (Ctrl and +, − or 0)");
        ui.end_row();
        let name = ui.label("Recording memory");
        ui.add(DragValue::new(&mut settings.memory_mib).range(MEMORY_MIB).speed(4.0).suffix(" MiB"))
            .labelled_by(name.id)
            .on_hover_text("Budget for steps and snapshots; over it older steps are summary only and recomputed when the cursor moves there");
        ui.end_row();
        let presets = Preset::NAMES.iter().map(|(_, name)| *name);
        let layouts = [LAST_LAYOUT].into_iter().chain(presets).chain(layouts).map(str::to_owned);
        choice_ui(ui, "Initial layout", 200.0, &mut settings.layout, layouts, String::clone);
        ui.end_row();
        let speed = &mut settings.speed;
        choice_ui(ui, "Initial playback speed", 200.0, speed, SPEEDS, |speed| format!("{speed}×"));
        ui.end_row();
        ui.label("Plots");
        ui.checkbox(&mut settings.event_lines, "Events and rank losses as lines")
            .on_hover_text("Vertical lines in all plots (E): solid events, dashed losses of informed rank");
        ui.end_row();
    });
}
