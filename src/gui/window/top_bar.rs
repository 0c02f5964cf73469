//! The bar at the top: logs, runs, layouts.

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Align, Button, Layout as UiLayout, PopupCloseBehavior, RichText, Ui, vec2};

use super::actions::{Action, TABLE};
use super::tiles::Preset;
use super::{Dialog, PanelName, WindowRequest, WindowState};
use crate::gui::PanelContext;
use crate::gui::theme::{MAX_RUNS, Theme};
use crate::session::Recording;

pub(super) fn ui(ui: &mut Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>, actions: &mut Vec<Action>) {
    ui.horizontal_centered(|ui| {
        action_button(ui, "Open…", Action::Dialog(Dialog::OpenLog), true, actions);
        let room = ctx.recording.runs.len() < MAX_RUNS;
        action_button(ui, "Add run…", Action::Dialog(Dialog::AddRun), room, actions);
        action_button(ui, "Fork…", Action::Dialog(Dialog::Fork), room, actions);
        ui.separator();
        ui.label(RichText::new(log_name(ctx.recording)).color(ctx.theme.text_strong));
        ui.label(RichText::new(format!("rig: {}", ctx.recording.rig.name)).color(ctx.theme.text_weak));
        ui.separator();
        state.legend.ui(ui, ctx);
        ui.with_layout(UiLayout::right_to_left(Align::Center), |ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            action_button(ui, "?", Action::Shortcuts, true, actions);
            action_button(ui, "☀", Action::Theme, true, actions);
            panels_menu(ui, state, ctx.theme);
            ui.add_space(6.0);
            for (number, preset) in Preset::ALL.into_iter().enumerate().rev() {
                layout_button(ui, state, preset, number + 1, actions);
            }
        });
    });
}

/// The file name of the log.
pub(crate) fn log_name(recording: &Recording) -> String {
    recording.log_path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn action_button(ui: &mut Ui, text: &str, action: Action, enabled: bool, actions: &mut Vec<Action>) {
    let entry = TABLE.iter().find(|entry| entry.action == action);
    let (name, keys) = entry.map_or((text, ""), |entry| (entry.name, entry.keys));
    let response = ui.add_enabled(enabled, Button::new(text));
    // A screen reader would read a lone symbol literally.
    let label = if text.chars().count() < 3 { name } else { text };
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, enabled, label));
    if response.on_hover_text(format!("{name} ({keys})")).clicked() {
        actions.push(action);
    }
}

fn layout_button(ui: &mut Ui, state: &WindowState, preset: Preset, number: usize, actions: &mut Vec<Action>) {
    let on = state.layout.preset == Some(preset);
    let response = ui.add(Button::new(number.to_string()).selected(on).min_size(vec2(22.0, 20.0)));
    let name = format!("Layout {}", preset.name());
    response.widget_info(|| egui::WidgetInfo::selected(egui::Role::Button, true, on, &name));
    if response.on_hover_text(format!("{name} ({number})")).clicked() {
        actions.push(Action::Layout(preset));
    }
}

fn panels_menu(ui: &mut Ui, state: &mut WindowState, theme: &Theme) {
    let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    MenuButton::new("Panels").config(config).ui(ui, |ui| {
        for panel in PanelName::movable() {
            let mut visible = state.layout.is_visible(panel);
            if ui.checkbox(&mut visible, panel.title()).changed() {
                state.layout.set_visible(panel, visible);
            }
        }
        ui.separator();
        if state.saved_layouts.ui(ui, theme, &mut state.layout) {
            state.requests.push(WindowRequest::KeepLayouts(state.saved_layouts.to_text()));
        }
    });
}
