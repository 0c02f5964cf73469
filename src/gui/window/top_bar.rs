//! Top bar: menus, log, runs, layouts.

use egui::containers::menu::MenuBar;
use egui::style::StyleModifier;
use egui::{Align, Button, Label, Layout as UiLayout, RichText, TextStyle, Ui, vec2};

use super::actions::{Action, TABLE};
use super::menu;
use super::state::MainWindow;
use super::tiles::Preset;
use crate::gui::theme::MAX_RUNS;
use crate::gui::{Dialog, PanelContext};
use crate::text::Named as _;

/// Buttons to the right of the menus, shown if they fit: text and action.
const BUTTONS: [(&str, Action); 2] =
    [("Add run…", Action::Dialog(Dialog::AddRun)), ("Fork…", Action::Dialog(Dialog::Fork))];

/// Minimum width in points of the entries of all runs.
const MIN_RUNS_WIDTH: f32 = 60.0;

pub(super) fn ui(ui: &mut Ui, state: &mut MainWindow, ctx: &mut PanelContext<'_>, actions: &mut Vec<Action>) {
    MenuBar::new().style(StyleModifier::default()).ui(ui, |ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        menu::ui(ui, state, ctx, actions);
        ui.separator();
        if let Some(study) = &state.status.study {
            study_button(ui, study, actions);
        }
        let log = ctx.recording.log_name();
        let rig = format!("rig: {}", ctx.recording.rig.name);
        let widths = Widths {
            log: text_width(ui, &log),
            rig: text_width(ui, &rig),
            buttons: BUTTONS.iter().map(|(text, _)| button_width(ui, text)).sum(),
            runs: state.legend.widths(ui, ctx),
            layout_names: Preset::all().map(|preset| button_width(ui, preset.name())).sum(),
            layout_numbers: 26.0 * Preset::NAMES.len() as f32,
            gap: 2.0 * ui.spacing().item_spacing.x + 6.0,
        };
        let shown = widths.shown(ui.available_width());

        let log = Label::new(RichText::new(&log).color(ctx.theme.text_strong)).truncate();
        let width = vec2(widths.log.min(shown.log), ui.available_height());
        let hover = format!("{}\n{rig}", ctx.recording.log_path.display());
        ui.allocate_ui_with_layout(width, UiLayout::left_to_right(Align::Center), |ui| {
            ui.add(log).on_hover_text(hover)
        });
        if shown.rig {
            ui.label(RichText::new(rig).color(ctx.theme.text_weak));
        }
        ui.separator();
        state.legend.ui(ui, ctx, shown.accuracy, shown.runs);
        if shown.buttons {
            for (text, action) in BUTTONS {
                action_button(ui, text, action, ctx.recording.runs.len() < MAX_RUNS, actions);
            }
        }
        ui.with_layout(UiLayout::right_to_left(Align::Center), |ui| {
            for (number, preset) in Preset::all().enumerate().rev() {
                layout_button(ui, state, preset, number + 1, shown.layout_names, actions);
            }
        });
    });
}

/// Widths in points of the elements to the right of the menus.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Widths {
    log: f32,
    rig: f32,
    buttons: f32,
    /// Width of all runs with and without their accuracy.
    runs: [f32; 2],
    layout_names: f32,
    layout_numbers: f32,
    gap: f32,
}

/// Elements shown in the available width.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shown {
    /// Maximum width of the name of the log in points.
    log: f32,
    rig: bool,
    buttons: bool,
    accuracy: bool,
    layout_names: bool,
    /// Width of all runs in points.
    runs: f32,
}

impl Widths {
    /// Elements that fit into `room` points. The rig is omitted first, then the names of the layouts, the buttons and
    /// the accuracies; the names of the log and of the runs are shortened last.
    fn shown(self, room: f32) -> Shown {
        let mut shown =
            Shown { log: self.log, rig: true, buttons: true, accuracy: true, layout_names: true, runs: self.runs[0] };
        let needed = |shown: &Shown| {
            let part = |on: bool, width: f32| if on { width + self.gap } else { 0.0 };
            shown.log
                + self.gap
                + part(shown.rig, self.rig)
                + part(true, self.runs[usize::from(!shown.accuracy)])
                + part(shown.buttons, self.buttons)
                + part(true, if shown.layout_names { self.layout_names } else { self.layout_numbers })
        };
        let reductions: [fn(&mut Shown); 4] = [
            |shown| shown.rig = false,
            |shown| shown.layout_names = false,
            |shown| shown.buttons = false,
            |shown| shown.accuracy = false,
        ];
        for reduce in reductions {
            if needed(&shown) > room {
                reduce(&mut shown);
            }
        }
        shown.runs = self.runs[usize::from(!shown.accuracy)];
        let excess = needed(&shown) - room;
        if excess > 0.0 {
            const MIN_LOG: f32 = 70.0;
            let from_log = excess.min((shown.log - MIN_LOG).max(0.0));
            shown.log -= from_log;
            shown.runs = (shown.runs - (excess - from_log)).max(MIN_RUNS_WIDTH);
        }
        shown
    }
}

fn text_width(ui: &Ui, text: &str) -> f32 {
    let font = TextStyle::Body.resolve(ui.style());
    ui.painter().layout_no_wrap(text.to_owned(), font, egui::Color32::WHITE).size().x.ceil() + 1.0
}

fn button_width(ui: &Ui, text: &str) -> f32 {
    text_width(ui, text) + 2.0 * ui.spacing().button_padding.x + ui.spacing().item_spacing.x
}

fn action_button(ui: &mut Ui, text: &str, action: Action, enabled: bool, actions: &mut Vec<Action>) {
    let entry = TABLE.iter().find(|entry| entry.action == action);
    let (name, keys) = entry.map_or((text, ""), |entry| (entry.name, entry.keys));
    let response = ui.add_enabled(enabled, Button::new(text));
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, enabled, text));
    if response.on_hover_text(format!("{name} ({keys})")).clicked() {
        actions.push(action);
    }
}

/// Draws the button that closes the session and returns to its study.
fn study_button(ui: &mut Ui, study: &str, actions: &mut Vec<Action>) {
    let response = ui.add(Button::new("◀ Study"));
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, "Back to the study"));
    if response.on_hover_text(format!("Back to the study {study} (Ctrl+W)")).clicked() {
        actions.push(Action::CloseLog);
    }
}

/// Draws the button of a layout, with its name or with its number.
fn layout_button(
    ui: &mut Ui,
    state: &MainWindow,
    preset: Preset,
    number: usize,
    named: bool,
    actions: &mut Vec<Action>,
) {
    let on = state.tiles.layout.preset == Some(preset);
    let text = if named { preset.name().to_owned() } else { number.to_string() };
    let response = ui.add(Button::new(text).selected(on).min_size(vec2(22.0, 20.0)));
    let name = format!("Layout {}", preset.name());
    response.widget_info(|| egui::WidgetInfo::selected(egui::Role::Button, true, on, &name));
    if response.on_hover_text(format!("{name} ({number})")).clicked() {
        actions.push(Action::Layout(preset));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_bar_shows_the_most_important_parts() {
        let widths = Widths {
            log: 100.0,
            rig: 60.0,
            buttons: 120.0,
            runs: [300.0, 180.0],
            layout_names: 320.0,
            layout_numbers: 130.0,
            gap: 10.0,
        };
        let all = widths.shown(1000.0);
        assert!(all.rig && all.buttons && all.accuracy && all.layout_names && all.runs == 300.0);
        let shown = widths.shown(940.0);
        assert!(!shown.rig && shown.layout_names);
        let shown = widths.shown(700.0);
        assert!(!shown.layout_names && shown.buttons);
        let shown = widths.shown(600.0);
        assert!(!shown.buttons && shown.accuracy);
        let shown = widths.shown(500.0);
        assert!(!shown.accuracy && shown.runs == 180.0 && shown.log == 100.0);
        let shown = widths.shown(400.0);
        assert!(shown.log < 100.0 && shown.runs < 180.0);
        assert!(shown.log + shown.runs + 130.0 + 30.0 <= 400.0, "{shown:?}");
    }
}
