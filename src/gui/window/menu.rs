//! Menus of the top bar: the actions of the table with their keys, and entries that depend on the session.

use std::path::Path;

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Button, PopupCloseBehavior, Ui, WidgetInfo};

use super::actions::{Action, Entry, SECOND_NS, TABLE, TENTH_NS};
use super::panel_tiles::PanelTiles;
use super::request::WindowRequest;
use super::state::MainWindow;
use super::tiles::Preset;
use crate::gui::theme::{MAX_RUNS, ThemeName};
use crate::gui::timeline::SPEEDS;
use crate::gui::{Dialog, PanelContext, PanelName, ReadingCursor};
use crate::text::Named;

/// Maximum number of recent files in the menu.
const MAX_RECENT: usize = 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Menu {
    File,
    View,
    Run,
    Playback,
    Help,
}

/// Titles from left to right; the menu of the panels follows after the view.
impl Named for Menu {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::File, "File"),
        (Self::View, "View"),
        (Self::Run, "Run"),
        (Self::Playback, "Playback"),
        (Self::Help, "Help"),
    ];
}

impl Menu {
    /// Actions of the menu in groups, from top to bottom.
    const fn actions(self) -> &'static [&'static [Action]] {
        match self {
            Self::File => &[
                &[Action::Dialog(Dialog::OpenLog)],
                &[Action::Save, Action::Export, Action::Dialog(Dialog::Figure), Action::Report, Action::Copy],
                &[Action::Dialog(Dialog::Settings), Action::Undo, Action::Redo],
                &[Action::CloseLog, Action::Quit],
            ],
            Self::View => &[
                &[
                    Action::Layout(Preset::Overview),
                    Action::Layout(Preset::Calibration),
                    Action::Layout(Preset::FrontEnd),
                    Action::Layout(Preset::Scene),
                    Action::Layout(Preset::Comparison),
                    Action::SavedLayout(0),
                ],
                &[Action::ZoomTime(true), Action::ZoomTime(false), Action::WholeLog],
                &[
                    Action::SetReading(ReadingCursor::A),
                    Action::SetReading(ReadingCursor::B),
                    Action::ClearReading,
                    Action::EventLines,
                    Action::LockValues,
                    Action::FollowValues,
                ],
                &[Action::Dismiss, Action::Warnings],
                &[Action::NextPanel(true), Action::NextPanel(false), Action::Maximize, Action::Theme],
            ],
            Self::Run => &[
                &[Action::Dialog(Dialog::AddRun), Action::Dialog(Dialog::Fork), Action::NextRun],
                &[Action::Dialog(Dialog::Diagnosis), Action::Dialog(Dialog::Sources)],
                &[Action::Breakpoint, Action::Hit(true), Action::Hit(false)],
            ],
            Self::Playback => &[
                &[Action::TogglePlay, Action::Start, Action::End],
                &[Action::Step(1), Action::Step(-1), Action::Step(10), Action::Step(-10)],
                &[
                    Action::StepTime(TENTH_NS),
                    Action::StepTime(-TENTH_NS),
                    Action::StepTime(SECOND_NS),
                    Action::StepTime(-SECOND_NS),
                ],
                &[Action::Iteration(true), Action::Iteration(false)],
                &[Action::Event(true), Action::Event(false), Action::Keyframe(true), Action::Keyframe(false)],
                &[Action::SpeedStep(true), Action::SpeedStep(false), Action::Loop],
                &[
                    Action::Marker,
                    Action::Dialog(Dialog::Markers),
                    Action::MarkerBeside(true),
                    Action::MarkerBeside(false),
                ],
            ],
            Self::Help => &[
                &[Action::Tour, Action::Manual, Action::Explain],
                &[Action::Shortcuts, Action::Dialog(Dialog::Palette)],
            ],
        }
    }

    /// Entries of the table in groups. The view menu also contains the actions that are in no menu.
    pub(super) fn groups(self) -> Vec<Vec<&'static Entry>> {
        let mut groups: Vec<Vec<&Entry>> = self
            .actions()
            .iter()
            .map(|group| {
                let entry = |action: &Action| TABLE.iter().find(|entry| entry.action == *action);
                group.iter().filter_map(entry).collect()
            })
            .collect();
        if self == Self::View {
            let placed =
                |action: Action| Self::all().any(|menu| menu.actions().iter().any(|group| group.contains(&action)));
            groups.push(TABLE.iter().filter(|entry| !placed(entry.action)).collect());
        }
        groups.retain(|group| !group.is_empty());
        groups
    }
}

/// Draws the buttons of all menus, and the menu that is open.
pub(super) fn ui(ui: &mut Ui, state: &mut MainWindow, ctx: &PanelContext<'_>, actions: &mut Vec<Action>) {
    for menu in Menu::all() {
        MenuButton::from_button(Button::new(menu.name()).frame_when_inactive(false)).ui(ui, |ui| {
            ui.set_min_width(230.0);
            for (number, group) in menu.groups().into_iter().enumerate() {
                if number > 0 {
                    ui.separator();
                }
                for entry in group {
                    entry_ui(ui, state, ctx, entry, actions);
                }
                if number == 0 {
                    first_group_ui(ui, menu, state, ctx, actions);
                }
            }
            last_group_ui(ui, menu, ctx, actions);
        });
        if menu == Menu::View {
            panels_ui(ui, state, ctx);
        }
    }
}

fn entry_ui(ui: &mut Ui, state: &MainWindow, ctx: &PanelContext<'_>, entry: &Entry, actions: &mut Vec<Action>) {
    if matches!(entry.action, Action::SavedLayout(_)) {
        return;
    }
    let room = ctx.recording.runs.len() < MAX_RUNS;
    let enabled = room || !matches!(entry.action, Action::Dialog(Dialog::AddRun | Dialog::Fork));
    let on = matches!(entry.action, Action::Layout(preset) if state.tiles.layout.preset == Some(preset))
        || entry.action == Action::EventLines && state.settings.event_lines;
    if item_ui(ui, entry.name, entry.keys, enabled, on) {
        actions.push(entry.action);
    }
}

fn item_ui(ui: &mut Ui, name: &str, keys: &str, enabled: bool, on: bool) -> bool {
    let response = ui.add_enabled(enabled, Button::new(name).shortcut_text(keys).selected(on));
    response.widget_info(|| WidgetInfo::selected(egui::Role::Button, enabled, on, name));
    response.clicked()
}

/// Entries of the first group of a menu that depend on the session.
fn first_group_ui(ui: &mut Ui, menu: Menu, state: &mut MainWindow, ctx: &PanelContext<'_>, actions: &mut Vec<Action>) {
    match menu {
        Menu::File => {
            ui.add_enabled_ui(!state.status.recent_logs.is_empty(), |ui| {
                ui.menu_button("Open recent", |ui| {
                    for path in state.status.recent_logs.iter().take(MAX_RECENT) {
                        if recent_ui(ui, path) {
                            state.requests.push(WindowRequest::OpenLog(vec![path.clone()]));
                        }
                    }
                });
            });
        }
        Menu::View => {
            for (number, name) in state.tiles.saved.names().enumerate() {
                let keys = if number < 9 { format!("Ctrl+{}", number + 1) } else { String::new() };
                if item_ui(ui, &format!("Layout: {name}"), &keys, true, false) {
                    actions.push(Action::SavedLayout(number));
                }
            }
        }
        Menu::Run => {
            let runs = &ctx.recording.runs;
            for (number, run) in runs.iter().enumerate().filter(|_| runs.len() > 1) {
                if item_ui(ui, &format!("Show run {}", run.spec.label), "", true, ctx.selection.run == number) {
                    actions.push(Action::Run(number));
                }
            }
            if let Some(last) = runs.last().filter(|_| runs.len() > 1)
                && item_ui(ui, &format!("Remove run {}…", last.spec.label), "", true, false)
            {
                actions.push(Action::RemoveRun(runs.len() - 1));
            }
        }
        Menu::Playback => {
            ui.menu_button("Speed", |ui| {
                for speed in SPEEDS {
                    if item_ui(ui, &format!("{speed}× log time"), "", true, ctx.playback.speed == speed) {
                        actions.push(Action::Speed(speed));
                    }
                }
            });
        }
        Menu::Help => {}
    }
}

/// Draws a recent file by name, with its folder in the tooltip; returns true if it is clicked.
fn recent_ui(ui: &mut Ui, path: &Path) -> bool {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let response = ui.button(&name);
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("Open {name}")));
    response.on_hover_text(path.display().to_string()).clicked()
}

/// Draws the entries of the last group of a menu that depend on the session.
fn last_group_ui(ui: &mut Ui, menu: Menu, ctx: &PanelContext<'_>, actions: &mut Vec<Action>) {
    if menu == Menu::View {
        for theme in [ThemeName::Light, ThemeName::Dark, ThemeName::Print] {
            if item_ui(ui, &format!("Theme: {}", theme.name()), "", true, ctx.theme.name == theme) {
                actions.push(Action::SetTheme(theme));
            }
        }
    }
}

/// The menu of the panels stays open while panels are chosen.
fn panels_ui(ui: &mut Ui, state: &mut MainWindow, ctx: &PanelContext<'_>) {
    let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    let button = Button::new("Panels").frame_when_inactive(false);
    MenuButton::from_button(button).config(config).ui(ui, |ui| {
        for panel in PanelName::movable() {
            let mut visible = state.tiles.layout.is_visible(panel);
            if ui.checkbox(&mut visible, panel.title()).changed() {
                state.tiles.layout.set_visible(panel, visible);
            }
        }
        ui.separator();
        let PanelTiles { saved, layout, .. } = &mut state.tiles;
        if saved.ui(ui, ctx.theme, layout) {
            state.requests.push(WindowRequest::KeepLayouts(saved.to_text()));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_action_of_the_table_is_in_exactly_one_menu() {
        for entry in TABLE {
            let count =
                |menu: Menu| menu.groups().iter().flatten().filter(|other| other.action == entry.action).count();
            let counts: usize = Menu::all().map(count).sum();
            assert_eq!(counts, 1, "{}", entry.name);
        }
        let listed = Menu::all().flat_map(|menu| menu.actions().iter().copied().flatten());
        for action in listed {
            assert!(TABLE.iter().any(|entry| entry.action == *action), "{action:?} is not in the table");
        }
    }
}
