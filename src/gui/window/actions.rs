//! Table of the actions of keys, buttons and the command palette.

use egui::{Event, Key, KeyboardShortcut, Modifiers, Popup, Ui};

use super::tiles::Preset;
use crate::frontend::FeatureId;
use crate::gui::theme::ThemeName;
use crate::gui::{Dialog, PanelName, ReadingCursor};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Action {
    TogglePlay,
    /// Move the cursor by this number of frames.
    Step(i64),
    /// Move the cursor by log time in nanoseconds.
    StepTime(i64),
    /// Move the cursor to the next (`true`) or previous keyframe of the shown run.
    Keyframe(bool),
    /// Move the cursor to the next (`true`) or previous iteration of the solver.
    Iteration(bool),
    /// Move the cursor to the next (`true`) or previous event.
    Event(bool),
    /// Move the cursor to the first frame.
    Start,
    /// Move the cursor to the last computed frame.
    End,
    /// Start or end a loop over the visible range.
    Loop,
    /// Set or clear a marker.
    Marker,
    /// Move the cursor to the next (`true`) or previous marker.
    MarkerBeside(bool),
    /// Set or clear a breakpoint at the frame of the cursor.
    Breakpoint,
    /// Run to the next (`true`) or previous hit of a breakpoint.
    Hit(bool),
    /// Show the whole log in all plots.
    WholeLog,
    /// Zoom the time axis of all plots in (`true`) or out, about the cursor.
    ZoomTime(bool),
    /// Set a reading cursor at the pointer's time in a plot, else at the playback cursor.
    SetReading(ReadingCursor),
    ClearReading,
    /// Show or hide events and rank losses as lines in all plots.
    EventLines,
    /// Fix the value range of the plot under the pointer, or let it follow the data again.
    LockValues,
    /// Let the value ranges of all plots follow the data.
    FollowValues,
    /// Clear the selection and close open lists.
    Dismiss,
    /// Show the next run in the panels that show one.
    NextRun,
    Dialog(Dialog),
    Explain,
    Manual,
    Tour,
    Shortcuts,
    Warnings,
    /// Write the session to a file.
    Save,
    /// Write the panel with the focus to files.
    Export,
    /// Write a report on the runs and open it.
    Report,
    /// Copy the value under the pointer, or the table of the panel with the focus.
    Copy,
    CopyTable(PanelName),
    /// Undo the last change of settings or layout.
    Undo,
    /// Redo the change that was undone last.
    Redo,
    /// Close the log and go back to the welcome view.
    CloseLog,
    Quit,
    /// Arrange the panels as in a preset.
    Layout(Preset),
    /// Arrange the panels as in a saved layout, by its index.
    SavedLayout(usize),
    /// Move the focus to the next (`true`) or previous panel on the screen.
    NextPanel(bool),
    /// Maximize the focused panel, or restore the others.
    Maximize,
    /// Toggle between dark and light theme.
    Theme,
    SetTheme(ThemeName),
    /// Move the cursor to a stamp, in nanoseconds since the log began.
    GoTo(i64),
    Feature(FeatureId),
    /// Show a run in the panels that show one.
    Run(usize),
    RemoveRun(usize),
    Show(PanelName),
    Hide(PanelName),
    Focus(PanelName),
    /// Set the speed of playback in log seconds per second.
    Speed(f64),
    /// Play at the next higher (`true`) or lower speed.
    SpeedStep(bool),
}

pub(crate) struct Entry {
    pub(crate) action: Action,
    /// Name in the window.
    pub(crate) name: &'static str,
    /// Keys as shown to the user.
    pub(crate) keys: &'static str,
    shortcuts: &'static [(Modifiers, Key)],
}

const fn entry(
    action: Action,
    name: &'static str,
    keys: &'static str,
    shortcuts: &'static [(Modifiers, Key)],
) -> Entry {
    Entry { action, name, keys, shortcuts }
}

const NONE: Modifiers = Modifiers::NONE;
const SHIFT: Modifiers = Modifiers::SHIFT;
const CTRL: Modifiers = Modifiers::COMMAND;
const ALT: Modifiers = Modifiers::ALT;
const ALT_SHIFT: Modifiers = ALT.plus(SHIFT);
const CTRL_SHIFT: Modifiers = CTRL.plus(SHIFT);

/// Steps in time, in nanoseconds.
pub(super) const SECOND_NS: i64 = 1_000_000_000;
pub(super) const TENTH_NS: i64 = SECOND_NS / 10;

/// All actions. Those with more modifiers are first, because a shortcut also matches with additional modifiers.
pub(crate) const TABLE: &[Entry] = &[
    entry(Action::Redo, "Redo the change of settings, layout or markers", "Ctrl+Shift+Z", &[(CTRL_SHIFT, Key::Z)]),
    entry(Action::Undo, "Undo the last change of settings, layout or markers", "Ctrl+Z", &[(CTRL, Key::Z)]),
    // The platform's copy key arrives as an event.
    entry(Action::Copy, "Copy the value under the pointer, or the focused panel's table", "Ctrl+C", &[]),
    entry(Action::CloseLog, "Close the log", "Ctrl+W", &[(CTRL, Key::W)]),
    entry(Action::Quit, "Quit", "Ctrl+Q", &[(CTRL, Key::Q)]),
    entry(Action::StepTime(TENTH_NS), "0.1 s forward", "Alt+Shift+Right", &[(ALT_SHIFT, Key::ArrowRight)]),
    entry(Action::StepTime(-TENTH_NS), "0.1 s back", "Alt+Shift+Left", &[(ALT_SHIFT, Key::ArrowLeft)]),
    entry(Action::StepTime(SECOND_NS), "1 s forward", "Alt+Right", &[(ALT, Key::ArrowRight)]),
    entry(Action::StepTime(-SECOND_NS), "1 s back", "Alt+Left", &[(ALT, Key::ArrowLeft)]),
    entry(Action::Event(true), "Next event", "Ctrl+Right", &[(CTRL, Key::ArrowRight)]),
    entry(Action::Event(false), "Previous event", "Ctrl+Left", &[(CTRL, Key::ArrowLeft)]),
    entry(Action::Step(10), "Ten frames forward", "Shift+Right", &[(SHIFT, Key::ArrowRight)]),
    entry(Action::Step(-10), "Ten frames back", "Shift+Left", &[(SHIFT, Key::ArrowLeft)]),
    entry(Action::Keyframe(false), "Previous keyframe of the shown run", "Shift+K", &[(SHIFT, Key::K)]),
    entry(Action::MarkerBeside(false), "Previous marker", "Shift+G", &[(SHIFT, Key::G)]),
    entry(Action::Dialog(Dialog::Markers), "Markers: list, names, removal…", "Shift+M", &[(SHIFT, Key::M)]),
    entry(Action::Hit(false), "Run back to the previous breakpoint hit", "Shift+N", &[(SHIFT, Key::N)]),
    entry(Action::FollowValues, "Free the value axes of all plots", "Shift+Y", &[(SHIFT, Key::Y)]),
    entry(Action::NextPanel(false), "Focus the previous panel", "Shift+F6", &[(SHIFT, Key::F6)]),
    entry(Action::Maximize, "Maximize the focused panel, or restore", "Ctrl+M", &[(CTRL, Key::M)]),
    entry(Action::Dialog(Dialog::Settings), "Settings…", "Ctrl+,", &[(CTRL, Key::Comma)]),
    entry(Action::Dialog(Dialog::OpenLog), "Open log or session…", "Ctrl+O", &[(CTRL, Key::O)]),
    entry(Action::Dialog(Dialog::Figure), "Figure for a paper…", "Ctrl+Shift+E", &[(CTRL_SHIFT, Key::E)]),
    entry(Action::Export, "Export focused panel (PNG, SVG, CSV)", "Ctrl+E", &[(CTRL, Key::E)]),
    entry(Action::Report, "Write report and open it", "Ctrl+R", &[(CTRL, Key::R)]),
    entry(Action::Save, "Save session", "Ctrl+S", &[(CTRL, Key::S)]),
    entry(Action::Dialog(Dialog::Palette), "Command palette…", "Ctrl+P", &[(CTRL, Key::P)]),
    entry(Action::Tour, "Tour in six steps", "Ctrl+F1", &[(CTRL, Key::F1)]),
    entry(Action::Manual, "Manual", "Shift+F1", &[(SHIFT, Key::F1)]),
    entry(Action::TogglePlay, "Play or pause", "Space", &[(NONE, Key::Space)]),
    entry(Action::Step(1), "One frame forward", "Right", &[(NONE, Key::ArrowRight)]),
    entry(Action::Step(-1), "One frame back", "Left", &[(NONE, Key::ArrowLeft)]),
    entry(Action::Keyframe(true), "Next keyframe of the shown run", "K", &[(NONE, Key::K)]),
    entry(Action::MarkerBeside(true), "Next marker", "G", &[(NONE, Key::G)]),
    entry(Action::SpeedStep(true), "Play faster", "]", &[(NONE, Key::CloseBracket)]),
    entry(Action::SpeedStep(false), "Play slower", "[", &[(NONE, Key::OpenBracket)]),
    entry(Action::Iteration(true), "Next solver iteration", ".", &[(NONE, Key::Period)]),
    entry(Action::Iteration(false), "Previous solver iteration", ",", &[(NONE, Key::Comma)]),
    entry(Action::Start, "Go to start", "Home", &[(NONE, Key::Home)]),
    entry(Action::End, "Go to end", "End", &[(NONE, Key::End)]),
    entry(Action::Loop, "Loop over the visible time range", "L", &[(NONE, Key::L)]),
    entry(Action::Marker, "Set or clear a marker at the cursor", "M", &[(NONE, Key::M)]),
    entry(Action::Breakpoint, "Set or clear a breakpoint at the cursor", "B", &[(NONE, Key::B)]),
    entry(Action::Hit(true), "Run to the next breakpoint hit", "N", &[(NONE, Key::N)]),
    entry(Action::WholeLog, "Zoom out to the whole log", "Z", &[(NONE, Key::Z)]),
    entry(Action::ZoomTime(true), "Zoom in on the cursor", "+", &[(NONE, Key::Plus), (NONE, Key::Equals)]),
    entry(Action::ZoomTime(false), "Zoom out from the cursor", "-", &[(NONE, Key::Minus)]),
    entry(Action::SetReading(ReadingCursor::A), "Set reading cursor A at the pointer", "C", &[(NONE, Key::C)]),
    entry(Action::SetReading(ReadingCursor::B), "Set reading cursor B at the pointer", "V", &[(NONE, Key::V)]),
    entry(Action::ClearReading, "Clear the reading cursors", "X", &[(NONE, Key::X)]),
    entry(Action::EventLines, "Show events and rank losses in all plots", "E", &[(NONE, Key::E)]),
    entry(Action::LockValues, "Fix or free the value axis under the pointer", "Y", &[(NONE, Key::Y)]),
    entry(Action::NextRun, "Show the next run", "R", &[(NONE, Key::R)]),
    entry(Action::Dialog(Dialog::Fork), "Fork the shown run at the cursor…", "F", &[(NONE, Key::F)]),
    entry(Action::Dialog(Dialog::AddRun), "Add a run…", "A", &[(NONE, Key::A)]),
    entry(Action::Dialog(Dialog::Diagnosis), "Diagnose the shown run…", "D", &[(NONE, Key::D)]),
    entry(Action::Dialog(Dialog::Sources), "Show which sources agree…", "U", &[(NONE, Key::U)]),
    entry(Action::Warnings, "List warnings", "W", &[(NONE, Key::W)]),
    entry(Action::Theme, "Toggle dark and light theme", "T", &[(NONE, Key::T)]),
    entry(Action::Layout(Preset::Overview), "Layout: overview", "1", &[(NONE, Key::Num1)]),
    entry(Action::Layout(Preset::Calibration), "Layout: calibration", "2", &[(NONE, Key::Num2)]),
    entry(Action::Layout(Preset::FrontEnd), "Layout: front end", "3", &[(NONE, Key::Num3)]),
    entry(Action::Layout(Preset::Scene), "Layout: scene", "4", &[(NONE, Key::Num4)]),
    entry(Action::Layout(Preset::Comparison), "Layout: comparison", "5", &[(NONE, Key::Num5)]),
    entry(Action::SavedLayout(0), "Saved layout 1 to 9", "Ctrl+1 to 9", &[]),
    entry(Action::NextPanel(true), "Focus the next panel", "F6", &[(NONE, Key::F6)]),
    entry(Action::Explain, "What is this? (focused panel)", "F1", &[(NONE, Key::F1)]),
    entry(Action::Shortcuts, "Shortcuts", "?", &[(NONE, Key::Questionmark)]),
    entry(Action::Dismiss, "Clear the selection", "Escape", &[(NONE, Key::Escape)]),
];

/// Keys of the saved layouts in order, pressed with Ctrl.
const LAYOUT_KEYS: [Key; 9] =
    [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];

pub(crate) fn keys_of(action: Action) -> &'static str {
    TABLE.iter().find(|entry| entry.action == action).map_or("", |entry| entry.keys)
}

/// Consumes the pressed shortcuts: none while the user types, and no keys without modifiers while a widget has the
/// focus.
pub(crate) fn pressed(ui: &Ui) -> Vec<Action> {
    if ui.egui_wants_keyboard_input() {
        return Vec::new();
    }
    let focused = ui.memory(|memory| memory.focused().is_some());
    let menu_open = Popup::is_any_open(ui.ctx());
    let mut actions = Vec::new();
    ui.input_mut(|input| {
        if input.events.contains(&Event::Copy) {
            actions.push(Action::Copy);
        }
        for (number, key) in LAYOUT_KEYS.into_iter().enumerate() {
            if input.consume_shortcut(&KeyboardShortcut::new(CTRL, key)) {
                actions.push(Action::SavedLayout(number));
            }
        }
        for entry in TABLE {
            for (modifiers, key) in entry.shortcuts {
                // A focused widget gets Space and the arrows, the window the other keys.
                let widget_key = matches!(key, Key::Space | Key::ArrowLeft | Key::ArrowRight | Key::Home | Key::End);
                // Escape closes an open menu first.
                let menu_key = menu_open && *key == Key::Escape;
                if menu_key || focused && *modifiers == NONE && widget_key {
                    continue;
                }
                let shortcut = KeyboardShortcut::new(*modifiers, *key);
                let foreign = (input.modifiers.alt || input.modifiers.command) && *modifiers == NONE;
                if !foreign && input.consume_shortcut(&shortcut) {
                    actions.push(entry.action);
                }
            }
        }
    });
    actions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manual_lists_every_key() {
        let manual = include_str!("../../../docs/manual.md");
        for entry in TABLE {
            assert!(manual.contains(&format!("| `{}` |", entry.keys)), "docs/manual.md lacks {}", entry.keys);
        }
    }
}
