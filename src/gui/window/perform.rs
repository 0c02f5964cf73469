//! Execution of the actions: commands for the session, state for the window.

use egui::Ui;

use super::actions::Action;
use super::request::WindowRequest;
use super::state::MainWindow;
use super::{copying, panel_export};
use crate::gui::plot::{plot_under_pointer, zoom_about_cursor};
use crate::gui::theme::ThemeName;
use crate::gui::timeline::{next_speed, toggled_loop};
use crate::gui::{Dialog, PanelContext, PanelName};
use crate::session::{Command, PlaybackSpeed};

pub(super) fn perform(ui: &Ui, action: Action, state: &mut MainWindow, ctx: &mut PanelContext<'_>) {
    if let Some(command) = command_of(action, ctx) {
        ctx.commands.push(command);
        return;
    }
    match action {
        Action::TogglePlay
        | Action::Step(_)
        | Action::StepTime(_)
        | Action::Keyframe(_)
        | Action::Iteration(_)
        | Action::Event(_)
        | Action::Start
        | Action::End
        | Action::Loop
        | Action::Breakpoint
        | Action::Hit(_)
        | Action::Marker
        | Action::GoTo(_)
        | Action::Speed(_)
        | Action::SpeedStep(_) => {}
        Action::MarkerBeside(forward) => {
            state.notices.inform(if forward { "No marker after the cursor" } else { "No marker before the cursor" });
        }
        Action::WholeLog => ctx.selection.visible_ns = None,
        Action::ZoomTime(closer) => zoom_about_cursor(ctx, closer),
        Action::SetReading(cursor) => {
            let stamp_ns = ctx.selection.reading.pointer_ns.unwrap_or(ctx.cursor_ns);
            ctx.selection.reading.set_cursor(cursor, stamp_ns.clamp(0, ctx.recording.duration_ns.max(0)));
        }
        Action::ClearReading => ctx.selection.reading.clear_cursors(),
        Action::LockValues => match plot_under_pointer(ui) {
            Some((plot, _)) if !plot.key.is_empty() => {
                ctx.selection.reading.toggle_fixed(&plot.key, [plot.area.low, plot.area.high]);
            }
            _ => state.notices.inform("No plot with a value axis is under the pointer"),
        },
        Action::FollowValues => ctx.selection.reading.fixed_values.clear(),
        Action::NextRun => ctx.selection.run = (ctx.selection.run + 1) % ctx.recording.runs.len().max(1),
        Action::Run(run) => ctx.selection.run = run,
        Action::Feature(feature) => ctx.selection.feature = Some(feature),
        Action::Dismiss => dismiss(state, ctx),
        Action::Dialog(dialog) => open_dialog(dialog, state, ctx),
        Action::RemoveRun(run) => state.dialogs.ask_to_remove(run),
        Action::Shortcuts => state.dialogs.shortcuts_open = !state.dialogs.shortcuts_open,
        Action::Warnings => state.notices.list_open = !state.notices.list_open,
        Action::Manual => state.help.manual.show(None),
        Action::Tour => state.tour.start(),
        Action::Explain => {
            if let Some(panel) = state.tiles.focused_or_first() {
                state.help.ask(panel);
            }
        }
        Action::Export => {
            let export = panel_export::export(&state.panels, state.tiles.focused(), ctx);
            state.requests.push(WindowRequest::WritePanel(Box::new(export)));
        }
        Action::Copy => match copying::value_under_pointer(ui) {
            Some(value) => copying::copy_value(ui, &mut state.notices, value),
            None => copy_table(ui, state.tiles.focused().0, state, ctx),
        },
        Action::CopyTable(panel) => copy_table(ui, panel, state, ctx),
        Action::Report => state.requests.push(WindowRequest::WriteReport),
        Action::Save => state.requests.push(WindowRequest::SaveSession),
        Action::CloseLog => state.requests.push(WindowRequest::CloseLog),
        Action::Quit => state.requests.push(WindowRequest::Quit),
        Action::Undo => state.undo(ctx),
        Action::Redo => state.redo(ctx),
        Action::Layout(preset) => state.tiles.arrange(preset),
        Action::SavedLayout(number) => {
            if !state.tiles.saved.take(number, &mut state.tiles.layout) {
                state.notices.inform("No saved layout has this number: save one in the Panels menu");
            }
        }
        Action::NextPanel(forward) => state.tiles.focus_neighbour(forward),
        Action::Focus(panel) => state.tiles.focus = Some(panel),
        Action::Maximize => state.tiles.layout.toggle_maximized(state.tiles.focused().0),
        Action::Show(panel) => state.tiles.show(panel),
        Action::Hide(panel) => state.tiles.layout.set_visible(panel, false),
        Action::EventLines => state.settings.event_lines = !state.settings.event_lines,
        Action::Theme => {
            state.settings.theme = if ctx.theme.is_dark() { ThemeName::Light } else { ThemeName::Dark };
        }
        Action::SetTheme(theme) => state.settings.theme = theme,
    }
}

/// The command of an action that only concerns the session; `None` for other actions, and where there is nothing to do.
fn command_of(action: Action, ctx: &PanelContext<'_>) -> Option<Command> {
    Some(match action {
        Action::TogglePlay => Command::TogglePlay,
        Action::Step(frames) => Command::StepFrames(frames),
        Action::StepTime(by_ns) => Command::StepTime { by_ns },
        Action::Keyframe(forward) => Command::JumpToKeyframe { run: ctx.selection.run, forward },
        Action::Iteration(forward) => Command::StepIteration { forward },
        Action::Event(forward) => Command::JumpToEvent { forward },
        Action::Start => Command::GoToStart,
        Action::End => Command::GoToEnd,
        Action::GoTo(stamp_ns) => Command::Seek { stamp_ns },
        Action::Loop => toggled_loop(ctx),
        Action::Breakpoint => Command::ToggleBreakpointHere,
        Action::Hit(forward) => Command::RunToBreakpoint { forward },
        Action::Marker => Command::ToggleMarker,
        Action::MarkerBeside(forward) => {
            Command::Seek { stamp_ns: ctx.playback.markers.beside(ctx.cursor_ns, forward)?.stamp_ns }
        }
        Action::Speed(speed) => Command::SetSpeed(PlaybackSpeed(speed)),
        Action::SpeedStep(faster) => Command::SetSpeed(PlaybackSpeed(next_speed(ctx.playback.speed, faster)?)),
        _ => return None,
    })
}

/// Closes the manual or else the tour; without them clears the selection and closes dialogs and lists.
fn dismiss(state: &mut MainWindow, ctx: &mut PanelContext<'_>) {
    if state.help.manual.is_open() {
        state.help.manual.close();
    } else if state.tour.is_running() {
        state.tour.end();
    } else {
        (ctx.selection.feature, ctx.selection.parameter, ctx.selection.slide) = (None, None, None);
        state.close_dialogs();
    }
}

fn open_dialog(dialog: Dialog, state: &mut MainWindow, ctx: &PanelContext<'_>) {
    match dialog {
        Dialog::Markers if ctx.playback.markers.at(ctx.cursor_ns).is_some() => {
            state.dialogs.edit_marker(ctx.cursor_ns);
            return;
        }
        Dialog::Figure => state.dialogs.figure.start(state.tiles.focused().0, &state.panels, ctx),
        _ => {}
    }
    state.dialogs.show(dialog);
}

fn copy_table(ui: &Ui, panel: PanelName, state: &mut MainWindow, ctx: &PanelContext<'_>) {
    let table = state.panels.csv_table(panel, ctx);
    copying::copy_table(ui, &mut state.notices, panel, table);
}
