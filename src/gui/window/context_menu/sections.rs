//! Sections of the context menu about a parameter, a feature, a run, a marker, a time in a plot, and a panel.

use egui::{Button, RichText, Role, Ui, WidgetInfo};

use crate::frontend::FeatureId;
use crate::geometry::Dimension;
use crate::gimbal::ParameterId;
use crate::gui::help::Help;
use crate::gui::plot::PlotOnScreen;
use crate::gui::theme::MAX_RUNS;
use crate::gui::under_pointer::Item;
use crate::gui::units::{fixed, seconds};
use crate::gui::window::actions::{Action, keys_of};
use crate::gui::window::copying::copy_value;
use crate::gui::window::dialogs::state::Dialogs;
use crate::gui::window::notices::Notices;
use crate::gui::{Dialog, PanelContext, PanelName, ReadingCursor};
use crate::session::breakpoints::Condition;
use crate::session::{Command, FlightParameter, Marker};
use crate::text::Named as _;

/// The menu that is being drawn, and the parts of the window on which its entries act.
pub(super) struct Sections<'a, 'b> {
    pub(super) ui: &'a mut Ui,
    pub(super) ctx: &'a mut PanelContext<'b>,
    pub(super) notices: &'a mut Notices,
    pub(super) dialogs: &'a mut Dialogs,
    pub(super) help: &'a mut Help,
    pub(super) actions: &'a mut Vec<Action>,
}

impl Sections<'_, '_> {
    /// Draws the heading of a section; one that is not the first is separated from those above.
    fn heading(&mut self, text: &str) {
        if self.ui.min_rect().height() > 1.0 {
            self.ui.separator();
        }
        self.ui.label(RichText::new(text).small().color(self.ctx.theme.text_weak));
    }

    /// Draws an entry with the keys of an action that does the same; returns true if it is clicked.
    fn entry(&mut self, text: &str, enabled: bool, same: Option<Action>) -> bool {
        let keys = same.map_or("", keys_of);
        let response = self.ui.add_enabled(enabled, Button::new(text).shortcut_text(keys));
        response.widget_info(|| WidgetInfo::labeled(Role::Button, enabled, text));
        response.clicked()
    }

    /// Draws an entry that performs an action.
    fn action(&mut self, text: &str, enabled: bool, action: Action) {
        if self.entry(text, enabled, Some(action)) {
            self.actions.push(action);
        }
    }

    fn can_fork(&self) -> bool {
        self.ctx.recording.runs.len() < MAX_RUNS
    }

    /// Draws the section of an item.
    pub(super) fn item_ui(&mut self, item: Item) {
        match item {
            Item::Parameter(parameter) => self.parameter_ui(parameter),
            Item::Feature(feature) => self.feature_ui(feature),
            Item::Run(run) => self.run_ui(run),
            Item::Marker(stamp_ns) => self.marker_ui(stamp_ns),
        }
    }

    /// Draws the entry that selects an item, or clears the selection; true if it is clicked.
    fn select_entry(&mut self, selected: bool) -> bool {
        let text = if selected { "Clear the selection" } else { "Select in all panels" };
        self.entry(text, true, selected.then_some(Action::Dismiss))
    }

    fn parameter_ui(&mut self, parameter: ParameterId) {
        let name = self.ctx.names().name(parameter);
        self.heading(&format!("Parameter {name}"));
        let selected = self.ctx.selection.parameter == Some(parameter);
        if self.select_entry(selected) {
            self.ctx.selection.parameter = (!selected).then_some(parameter);
        }
        let report = self.ctx.selected_run().map(|run| self.ctx.flight(self.ui, run));
        let row = report.iter().flat_map(|report| report.rows.iter()).find(|row| row.parameter == parameter);
        if let Some((row, stamp_ns)) = row.and_then(|row| Some((row, row.since_ns?)))
            && self.entry(&format!("Go to {} s: {} since then", seconds(stamp_ns), row.verdict.name()), true, None)
        {
            self.ctx.selection.parameter = Some(parameter);
            self.ctx.commands.push(Command::Seek { stamp_ns });
        }
        if self.entry("Show over time", true, None) {
            self.ctx.selection.parameter = Some(parameter);
            self.actions.push(Action::Show(PanelName::Convergence));
        }
        if let Some(condition) = row.and_then(|row| determined(row, &name))
            && self.entry(&format!("Breakpoint where {condition}"), true, None)
        {
            self.notices.inform(format!("Breakpoint added: {condition}"));
            self.ctx.commands.push(Command::AddBreakpoint(condition));
        }
        if self.entry("Fork with it fixed…", self.can_fork(), None) {
            self.dialogs.fork_with("freeze", name);
        }
    }

    fn feature_ui(&mut self, feature: FeatureId) {
        self.heading(&format!("Feature {}", feature.0));
        let selected = self.ctx.selection.feature == Some(feature);
        if self.select_entry(selected) {
            self.ctx.selection.feature = (!selected).then_some(feature);
        }
        if self.entry("Fork without it…", self.can_fork(), None) {
            self.dialogs.fork_with("drop", feature.0.to_string());
        }
    }

    fn run_ui(&mut self, number: usize) {
        let Some(run) = self.ctx.recording.runs.get(number) else { return };
        self.heading(&format!("Run {}", run.spec.label));
        if self.entry("Show it in all panels", self.ctx.selection.run != number, None) {
            self.ctx.selection.run = number;
        }
        for (text, dialog, enabled) in
            [("Fork it at the cursor…", Dialog::Fork, self.can_fork()), ("Diagnose it…", Dialog::Diagnosis, true)]
        {
            if self.entry(text, enabled, Some(Action::Dialog(dialog))) {
                self.ctx.selection.run = number;
                self.actions.push(Action::Dialog(dialog));
            }
        }
        if self.entry("Copy its specification", true, None) {
            copy_value(self.ui, self.notices, format!("--run {}", run.spec));
        }
        if self.entry("Remove it…", self.ctx.recording.runs.len() > 1, None) {
            self.actions.push(Action::RemoveRun(number));
        }
    }

    fn marker_ui(&mut self, stamp_ns: i64) {
        let Some(marker) = self.ctx.playback.markers.at(stamp_ns) else { return };
        self.heading(&format!("Marker {} {} s", marker.name, seconds(stamp_ns)));
        if self.entry("Go to the marker", true, None) {
            self.ctx.commands.push(Command::Seek { stamp_ns });
        }
        if self.entry("Rename the marker…", true, Some(Action::Dialog(Dialog::Markers))) {
            self.dialogs.edit_marker(stamp_ns);
        }
        if self.entry("Delete the marker", true, None) {
            self.ctx.commands.push(Command::SetMarkers(self.ctx.playback.markers.without(stamp_ns)));
        }
    }

    /// Draws the section of a plot with the time under the pointer.
    pub(super) fn time_ui(&mut self, plot: &PlotOnScreen, stamp_ns: i64) {
        let stamp_ns = stamp_ns.clamp(0, self.ctx.recording.duration_ns.max(0));
        self.heading(&format!("At {} s", seconds(stamp_ns)));
        if self.entry("Move the cursor here", true, None) {
            self.ctx.commands.push(Command::Seek { stamp_ns });
        }
        for cursor in ReadingCursor::ALL {
            let text = format!("Set reading cursor {} here", cursor.letter());
            if self.entry(&text, true, Some(Action::SetReading(cursor))) {
                self.ctx.selection.reading.set_cursor(cursor, stamp_ns);
            }
        }
        if ReadingCursor::ALL.iter().any(|cursor| self.ctx.selection.reading.cursor_ns(*cursor).is_some()) {
            self.action("Clear the reading cursors", true, Action::ClearReading);
        }
        if self.entry("Add a marker here…", true, None) {
            let markers = &self.ctx.playback.markers;
            if markers.at(stamp_ns).is_none() {
                self.ctx.commands.push(Command::SetMarkers(markers.with(Marker::new(stamp_ns, ""))));
            }
            self.dialogs.edit_marker(stamp_ns);
        }
        if self.entry("Fork the shown run here…", self.can_fork(), None) {
            self.ctx.commands.push(Command::Seek { stamp_ns });
            self.actions.push(Action::Dialog(Dialog::Fork));
        }
        self.action("Diagnose the shown run…", true, Action::Dialog(Dialog::Diagnosis));
        if self.entry("Copy the time", true, None) {
            copy_value(self.ui, self.notices, format!("{} s", seconds(stamp_ns)));
        }
        self.ui.separator();
        if !plot.key.is_empty() {
            let fixed = self.ctx.selection.reading.fixed_values.contains_key(&plot.key);
            let text = if fixed { "Free the value axis" } else { "Fix the value axis" };
            if self.entry(text, true, Some(Action::LockValues)) {
                self.ctx.selection.reading.toggle_fixed(&plot.key, [plot.area.low, plot.area.high]);
            }
        }
        self.action("Events and rank losses in all plots", true, Action::EventLines);
        self.action("Zoom out to the whole log", true, Action::WholeLog);
    }

    /// Draws the section of a panel; `value` is the one under the pointer.
    pub(super) fn panel_ui(&mut self, panel: PanelName, maximized: bool, value: Option<&str>) {
        self.heading(panel.title());
        if let Some(value) = value
            && self.entry("Copy value", true, Some(Action::Copy))
        {
            copy_value(self.ui, self.notices, value.to_owned());
        }
        if self.entry("Copy table (CSV)", true, None) {
            self.actions.push(Action::CopyTable(panel));
        }
        self.focused_action("Export the panel (PNG, SVG, CSV)", panel, Action::Export);
        if panel != PanelName::Timeline {
            let text = if maximized { "Restore all panels" } else { "Maximize the panel" };
            self.focused_action(text, panel, Action::Maximize);
            if self.entry("Close the panel", true, None) {
                self.actions.push(Action::Hide(panel));
            }
        }
        if self.entry("What is this?", true, Some(Action::Explain)) {
            self.help.ask(panel);
        }
    }

    /// Draws an entry that focuses a panel and performs an action on it.
    fn focused_action(&mut self, text: &str, panel: PanelName, action: Action) {
        if self.entry(text, true, Some(action)) {
            self.actions.extend([Action::Focus(panel), action]);
        }
    }
}

/// Condition that a parameter is as accurate as required: σ below the limit, in degrees, millimetres or the stored unit.
fn determined(row: &FlightParameter, name: &str) -> Option<Condition> {
    let limit = row.required;
    let limit = match row.parameter.dimension() {
        Dimension::Angle => format!("{} deg", fixed(limit.to_degrees(), 4)),
        Dimension::Length => format!("{} mm", fixed(1e3 * limit, 3)),
        Dimension::Time | Dimension::Pixel | Dimension::Ratio => fixed(limit, 6),
    };
    format!("sigma({name}) < {limit}").parse().ok()
}
