//! Sections of the context menu about a parameter, a feature, a run or a marker.

use egui::Ui;

use super::widgets::{entry_ui, heading_ui};
use crate::frontend::FeatureId;
use crate::geometry::Dimension;
use crate::gimbal::ParameterId;
use crate::gui::theme::MAX_RUNS;
use crate::gui::under_pointer::Item;
use crate::gui::units::{fixed, seconds};
use crate::gui::window::actions::Action;
use crate::gui::window::copying::copy_value;
use crate::gui::window::notices::NoticeLevel;
use crate::gui::window::state::MainWindow;
use crate::gui::{Dialog, PanelContext, PanelName};
use crate::observability::DETERMINED_RATIO;
use crate::session::breakpoints::Condition;
use crate::session::{Command, FlightParameter};
use crate::text::Named as _;

/// Draws the section of an item.
pub(super) fn ui(
    ui: &mut Ui,
    state: &mut MainWindow,
    ctx: &mut PanelContext<'_>,
    item: Item,
    actions: &mut Vec<Action>,
) {
    match item {
        Item::Parameter(parameter) => parameter_ui(ui, state, ctx, parameter, actions),
        Item::Feature(feature) => feature_ui(ui, state, ctx, feature),
        Item::Run(run) => run_ui(ui, state, ctx, run, actions),
        Item::Marker(stamp_ns) => marker_ui(ui, state, ctx, stamp_ns),
    }
}

fn can_fork(ctx: &PanelContext<'_>) -> bool {
    ctx.recording.runs.len() < MAX_RUNS
}

fn parameter_ui(
    ui: &mut Ui,
    state: &mut MainWindow,
    ctx: &mut PanelContext<'_>,
    parameter: ParameterId,
    actions: &mut Vec<Action>,
) {
    let name = ctx.names().name(parameter);
    heading_ui(ui, ctx.theme, &format!("Parameter {name}"));
    let selected = ctx.selection.parameter == Some(parameter);
    let text = if selected { "Clear the selection" } else { "Select in all panels" };
    if entry_ui(ui, text, true, selected.then_some(Action::Dismiss)) {
        ctx.selection.parameter = (!selected).then_some(parameter);
    }
    let report = ctx.selected_run().map(|run| ctx.flight(ui, run));
    let row = report.iter().flat_map(|report| report.rows.iter()).find(|row| row.parameter == parameter);
    if let Some((row, stamp_ns)) = row.and_then(|row| Some((row, row.since_ns?)))
        && entry_ui(ui, &format!("Go to {} s: {} since then", seconds(stamp_ns), row.verdict.name()), true, None)
    {
        ctx.selection.parameter = Some(parameter);
        ctx.commands.push(Command::Seek { stamp_ns });
    }
    if entry_ui(ui, "Show over time", true, None) {
        ctx.selection.parameter = Some(parameter);
        actions.push(Action::Show(PanelName::Convergence));
    }
    if let Some(condition) = row.and_then(|row| determined(row, &name))
        && entry_ui(ui, &format!("Breakpoint where {condition}"), true, None)
    {
        state.notices.show_message(NoticeLevel::Info, format!("Breakpoint added: {condition}"));
        ctx.commands.push(Command::AddBreakpoint(condition));
    }
    if entry_ui(ui, "Fork with it fixed…", can_fork(ctx), None) {
        state.dialogs.fork_with("freeze", name);
    }
}

/// Condition that a parameter is determined: σ below the limit, in degrees, millimetres or the stored unit.
fn determined(row: &FlightParameter, name: &str) -> Option<Condition> {
    let limit = DETERMINED_RATIO * row.sigma? / row.ratio?;
    let limit = match row.parameter.dimension() {
        Dimension::Angle => format!("{} deg", fixed(limit.to_degrees(), 4)),
        Dimension::Length => format!("{} mm", fixed(1e3 * limit, 3)),
        Dimension::Time | Dimension::Pixel | Dimension::Ratio => fixed(limit, 6),
    };
    format!("sigma({name}) < {limit}").parse().ok()
}

fn feature_ui(ui: &mut Ui, state: &mut MainWindow, ctx: &mut PanelContext<'_>, feature: FeatureId) {
    heading_ui(ui, ctx.theme, &format!("Feature {}", feature.0));
    let selected = ctx.selection.feature == Some(feature);
    let text = if selected { "Clear the selection" } else { "Select in all panels" };
    if entry_ui(ui, text, true, selected.then_some(Action::Dismiss)) {
        ctx.selection.feature = (!selected).then_some(feature);
    }
    if entry_ui(ui, "Fork without it…", can_fork(ctx), None) {
        state.dialogs.fork_with("drop", feature.0.to_string());
    }
}

fn run_ui(ui: &mut Ui, state: &mut MainWindow, ctx: &mut PanelContext<'_>, number: usize, actions: &mut Vec<Action>) {
    let Some(run) = ctx.recording.runs.get(number) else { return };
    heading_ui(ui, ctx.theme, &format!("Run {}", run.spec.label));
    if entry_ui(ui, "Show it in all panels", ctx.selection.run != number, None) {
        ctx.selection.run = number;
    }
    for (text, dialog, enabled) in
        [("Fork it at the cursor…", Dialog::Fork, can_fork(ctx)), ("Diagnose it…", Dialog::Diagnosis, true)]
    {
        if entry_ui(ui, text, enabled, Some(Action::Dialog(dialog))) {
            ctx.selection.run = number;
            actions.push(Action::Dialog(dialog));
        }
    }
    if entry_ui(ui, "Copy its specification", true, None) {
        copy_value(format!("--run {}", run.spec), state);
    }
    if entry_ui(ui, "Remove it…", ctx.recording.runs.len() > 1, None) {
        actions.push(Action::RemoveRun(number));
    }
}

fn marker_ui(ui: &mut Ui, state: &mut MainWindow, ctx: &mut PanelContext<'_>, stamp_ns: i64) {
    let Some(marker) = ctx.playback.markers.at(stamp_ns) else { return };
    heading_ui(ui, ctx.theme, format!("Marker {} {} s", marker.name, seconds(stamp_ns)).as_str());
    if entry_ui(ui, "Go to the marker", true, None) {
        ctx.commands.push(Command::Seek { stamp_ns });
    }
    if entry_ui(ui, "Rename the marker…", true, Some(Action::Dialog(Dialog::Markers))) {
        state.dialogs.edit_marker(stamp_ns);
    }
    if entry_ui(ui, "Delete the marker", true, None) {
        ctx.commands.push(Command::SetMarkers(ctx.playback.markers.without(stamp_ns)));
    }
}
