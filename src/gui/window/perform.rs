//! Execution of the actions: commands for the session, state for the window.

use super::actions::Action;
use super::notices::NoticeLevel;
use super::request::WindowRequest;
use super::state::MainWindow;
use super::{copying, panel_export};
use crate::gui::plot::zoom_about_cursor;
use crate::gui::theme::ThemeName;
use crate::gui::timeline::{next_speed, toggled_loop};
use crate::gui::{Dialog, PanelContext, PanelName};
use crate::session::{Command, PlaybackSpeed};

pub(super) fn perform(action: Action, state: &mut MainWindow, ctx: &mut PanelContext<'_>) {
    match action {
        Action::TogglePlay => ctx.commands.push(Command::TogglePlay),
        Action::Step(frames) => ctx.commands.push(Command::StepFrames(frames)),
        Action::StepTime(by_ns) => ctx.commands.push(Command::StepTime { by_ns }),
        Action::Keyframe(forward) => {
            ctx.commands.push(Command::JumpToKeyframe { run: ctx.selection.run, forward });
        }
        Action::Iteration(forward) => ctx.commands.push(Command::StepIteration { forward }),
        Action::Event(forward) => ctx.commands.push(Command::JumpToEvent { forward }),
        Action::Start => ctx.commands.push(Command::GoToStart),
        Action::End => ctx.commands.push(Command::GoToEnd),
        Action::Loop => ctx.commands.push(toggled_loop(ctx)),
        Action::Breakpoint => ctx.commands.push(Command::ToggleBreakpointHere),
        Action::Hit(forward) => ctx.commands.push(Command::RunToBreakpoint { forward }),
        Action::Marker => ctx.commands.push(Command::ToggleMarker),
        Action::MarkerBeside(forward) => {
            if let Some(marker) = ctx.playback.markers.beside(ctx.cursor_ns, forward) {
                ctx.commands.push(Command::Seek { stamp_ns: marker.stamp_ns });
            } else {
                let text = if forward { "No marker after the cursor" } else { "No marker before the cursor" };
                state.notices.show_message(NoticeLevel::Info, text);
            }
        }
        Action::WholeLog => ctx.selection.visible_ns = None,
        Action::SetReading(cursor) => {
            let stamp_ns = ctx.selection.reading.pointer_ns.unwrap_or(ctx.cursor_ns);
            ctx.selection.reading.set_cursor(cursor, stamp_ns.clamp(0, ctx.recording.duration_ns.max(0)));
        }
        Action::ClearReading => ctx.selection.reading.clear_cursors(),
        Action::EventLines => state.settings.event_lines = !state.settings.event_lines,
        Action::LockValues => match &state.pointed_plot {
            Some(plot) if !plot.key.is_empty() => {
                ctx.selection.reading.toggle_fixed(&plot.key, [plot.area.low, plot.area.high]);
            }
            _ => {
                let text = "No plot with a value axis is under the pointer";
                state.notices.show_message(NoticeLevel::Info, text);
            }
        },
        Action::FollowValues => ctx.selection.reading.fixed_values.clear(),
        Action::Dismiss if state.help.manual.is_open() => state.help.manual.close(),
        Action::Dismiss if state.tour.is_running() => state.tour.end(),
        Action::Tour => state.tour.start(),
        Action::Dismiss => {
            (ctx.selection.feature, ctx.selection.parameter, ctx.selection.slide) = (None, None, None);
            state.close_dialogs();
        }
        Action::ZoomTime(closer) => zoom_about_cursor(ctx, closer),
        Action::NextRun => {
            ctx.selection.run = (ctx.selection.run + 1) % ctx.recording.runs.len().max(1);
        }
        Action::Dialog(Dialog::Markers) if ctx.playback.markers.at(ctx.cursor_ns).is_some() => {
            state.dialogs.edit_marker(ctx.cursor_ns);
        }
        Action::Dialog(dialog) => {
            if dialog == Dialog::Figure {
                let (panel, _) = state.focused();
                state.dialogs.figure.start(panel, &state.panels, ctx);
            }
            state.dialogs.show(dialog);
        }
        Action::Explain => state.explain_focused(),
        Action::Manual => state.help.manual.show(None),
        Action::Shortcuts => state.shortcuts_open = !state.shortcuts_open,
        Action::Warnings => state.notices.list_open = !state.notices.list_open,
        Action::Export => {
            let export = panel_export::export(state, ctx);
            state.requests.push(WindowRequest::WritePanel(Box::new(export)));
        }
        Action::Report => state.requests.push(WindowRequest::WriteReport),
        Action::Copy => {
            let value = state.pointed.take();
            copying::copy(value, state, ctx);
        }
        Action::CopyTable(panel) => copying::copy_table(panel, state, ctx),
        Action::Undo => state.undo(ctx),
        Action::Redo => state.redo(ctx),
        Action::CloseLog => state.requests.push(WindowRequest::CloseLog),
        Action::Quit => state.requests.push(WindowRequest::Quit),
        Action::Save => state.requests.push(WindowRequest::SaveSession),
        Action::Layout(preset) => state.layout.arrange(preset),
        Action::SavedLayout(number) => {
            if !state.saved_layouts.take(number, &mut state.layout) {
                let text = "No saved layout has this number: save one in the Panels menu";
                state.notices.show_message(NoticeLevel::Info, text);
            }
        }
        Action::NextPanel(forward) => state.focus_neighbour(forward),
        Action::Maximize => {
            let (panel, _) = state.focused();
            state.layout.toggle_maximized(panel);
        }
        Action::Theme => {
            state.settings.theme = if ctx.theme.is_dark() { ThemeName::Light } else { ThemeName::Dark };
        }
        Action::SetTheme(theme) => state.settings.theme = theme,
        Action::GoTo(stamp_ns) => ctx.commands.push(Command::Seek { stamp_ns }),
        Action::Feature(feature) => ctx.selection.feature = Some(feature),
        Action::Run(run) => ctx.selection.run = run,
        Action::RemoveRun(run) => state.dialogs.ask_to_remove(run),
        Action::Show(panel) => {
            if panel != PanelName::Timeline {
                state.layout.set_visible(panel, true);
            }
            state.focus = Some(panel);
        }
        Action::Hide(panel) => state.layout.set_visible(panel, false),
        Action::Speed(speed) => ctx.commands.push(Command::SetSpeed(PlaybackSpeed(speed))),
        Action::SpeedStep(faster) => {
            let next = next_speed(ctx.playback.speed, faster);
            ctx.commands.extend(next.map(|speed| Command::SetSpeed(PlaybackSpeed(speed))));
        }
    }
}
