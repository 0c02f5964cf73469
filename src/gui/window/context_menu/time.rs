//! Section of the context menu about a time in a plot or on the timeline.

use egui::Ui;

use super::widgets::{entry_ui, heading_ui};
use crate::gui::plot::PlotOnScreen;
use crate::gui::theme::MAX_RUNS;
use crate::gui::units::seconds;
use crate::gui::window::actions::Action;
use crate::gui::window::copying::copy_value;
use crate::gui::window::state::MainWindow;
use crate::gui::{Dialog, PanelContext, ReadingCursor};
use crate::session::{Command, Marker};

/// Draws the section of a plot with the time under the pointer.
pub(super) fn ui(
    ui: &mut Ui,
    state: &mut MainWindow,
    ctx: &mut PanelContext<'_>,
    plot: &PlotOnScreen,
    stamp_ns: i64,
    actions: &mut Vec<Action>,
) {
    let stamp_ns = stamp_ns.clamp(0, ctx.recording.duration_ns.max(0));
    heading_ui(ui, ctx.theme, &format!("At {} s", seconds(stamp_ns)));
    if entry_ui(ui, "Move the cursor here", true, None) {
        ctx.commands.push(Command::Seek { stamp_ns });
    }
    reading_ui(ui, ctx, stamp_ns);
    if entry_ui(ui, "Add a marker here…", true, None) {
        if ctx.playback.markers.at(stamp_ns).is_none() {
            ctx.commands.push(Command::SetMarkers(ctx.playback.markers.with(Marker::new(stamp_ns, ""))));
        }
        state.dialogs.edit_marker(stamp_ns);
    }
    if entry_ui(ui, "Fork the shown run here…", ctx.recording.runs.len() < MAX_RUNS, None) {
        ctx.commands.push(Command::Seek { stamp_ns });
        actions.push(Action::Dialog(Dialog::Fork));
    }
    if entry_ui(ui, "Diagnose the shown run…", true, Some(Action::Dialog(Dialog::Diagnosis))) {
        actions.push(Action::Dialog(Dialog::Diagnosis));
    }
    if entry_ui(ui, "Copy the time", true, None) {
        copy_value(format!("{} s", seconds(stamp_ns)), state);
    }
    ui.separator();
    let reading = &mut ctx.selection.reading;
    if !plot.key.is_empty() {
        let fixed = reading.fixed_values.contains_key(&plot.key);
        let text = if fixed { "Free the value axis" } else { "Fix the value axis" };
        if entry_ui(ui, text, true, Some(Action::LockValues)) {
            reading.toggle_fixed(&plot.key, [plot.area.low, plot.area.high]);
        }
    }
    for (text, action) in
        [("Events and rank losses in all plots", Action::EventLines), ("Zoom out to the whole log", Action::WholeLog)]
    {
        if entry_ui(ui, text, true, Some(action)) {
            actions.push(action);
        }
    }
}

/// Draws the entries of the reading cursors.
fn reading_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, stamp_ns: i64) {
    let reading = &mut ctx.selection.reading;
    for cursor in ReadingCursor::ALL {
        let text = format!("Set reading cursor {} here", cursor.letter());
        if entry_ui(ui, &text, true, Some(Action::SetReading(cursor))) {
            reading.set_cursor(cursor, stamp_ns);
        }
    }
    if ReadingCursor::ALL.iter().any(|cursor| reading.cursor_ns(*cursor).is_some())
        && entry_ui(ui, "Clear the reading cursors", true, Some(Action::ClearReading))
    {
        reading.clear_cursors();
    }
}
