//! State of the window without the session.

use std::path::PathBuf;

use egui::{Rect, Ui, Vec2};

use super::context_menu::place::MenuPlace;
use super::dialogs::state::Dialogs;
use super::focus_ring::FocusRing;
use super::history::{Arrangement, SettingsHistory};
use super::legend::RunLegend;
use super::notices::{NoticeLevel, Notices};
use super::panels::Panels;
use super::progress::Progress;
use super::request::WindowRequest;
use super::saved_layouts::{self, SavedLayouts};
use super::settings::{self, Settings};
use super::tiles::{PanelLayout, Preset};
use super::tour::state::Tour;
use crate::gui::help::Help;
use crate::gui::plot::PlotOnScreen;
use crate::gui::reading::EventLines;
use crate::gui::theme::Theme;
use crate::gui::{PanelContext, PanelName};
use crate::session::{Command, Markers};
use crate::text::Named as _;

/// Size in points of a panel that is not on the screen.
const HIDDEN_PANEL_SIZE: Vec2 = Vec2::new(960.0, 540.0);

/// State of the window without the session.
#[derive(Default)]
pub struct MainWindow {
    pub panels: Panels,
    /// The runs with their accuracy.
    pub legend: RunLegend,
    pub notices: Notices,
    pub dialogs: Dialogs,
    /// True if the list of shortcuts is open.
    pub shortcuts_open: bool,
    /// Memory of the process in bytes, if known. It differs between executions, so screenshots omit it.
    pub memory_bytes: Option<u64>,
    /// Show step times; screenshots omit them for the same reason.
    pub show_times: bool,
    /// Requests to the application, which takes them after each frame.
    pub requests: Vec<WindowRequest>,
    pub saved_layouts: SavedLayouts,
    /// User settings, applied by the application.
    pub settings: Settings,
    /// Progress of the estimation; `None` when all steps are computed.
    pub progress: Option<Progress>,
    /// Progress of a log that is being opened while another one is shown, as text.
    pub opening: Option<String>,
    /// Name of the study from which the session was opened.
    pub study: Option<String>,
    /// State of "What is this?" and the manual.
    pub(crate) help: Help,
    /// Recently opened logs and sessions, newest first, for the menu.
    pub recent_logs: Vec<PathBuf>,
    pub(super) tour: Tour,
    pub(super) ring: FocusRing,
    pub(super) layout: PanelLayout,
    pub(super) history: SettingsHistory,
    /// The layout when its last change was noticed.
    pub(super) noticed: Option<PanelLayout>,
    /// The value under the pointer.
    pub(super) pointed: Option<String>,
    /// Text for the clipboard.
    pub(super) copied: Option<String>,
    pub(super) menu: Option<MenuPlace>,
    /// The plot over time under the pointer.
    pub(super) pointed_plot: Option<PlotOnScreen>,
    pub(super) event_lines: EventLines,
    /// The panel that was clicked last.
    pub(super) focus: Option<PanelName>,
    /// Height of timeline and status bar in the last frame.
    pub(super) below_height: Option<f32>,
    /// The rectangles of the panels on the screen, in the order of drawing.
    pub(super) places: Vec<(PanelName, Rect)>,
}

impl MainWindow {
    /// Closes all dialogs and lists when a session ends.
    pub(in crate::gui) fn close_everything(&mut self) {
        self.close_dialogs();
        self.tour.end();
        (self.progress, self.opening) = (None, None);
    }

    /// Starts the tour at its first stop.
    pub(in crate::gui) fn start_tour(&mut self) {
        self.tour.start();
    }

    /// Draws the ring around the widget with the keyboard focus in a view without a session.
    pub(in crate::gui) fn focus_ring_ui(&mut self, ui: &Ui, theme: &Theme) {
        self.ring.ui(ui, theme);
    }

    pub(super) fn close_dialogs(&mut self) {
        self.dialogs.close();
        self.shortcuts_open = false;
        self.notices.list_open = false;
        self.help.manual.close();
    }

    /// Starts the history of the markers of a session that is opened.
    pub(in crate::gui) fn begin_session(&mut self, markers: &Markers) {
        self.history.begin_session(markers);
    }

    /// Restores settings, layout and markers as before the last change.
    pub(super) fn undo(&mut self, ctx: &mut PanelContext<'_>) {
        if let Some(message) = self.history.take_barrier() {
            self.notices.show_message(NoticeLevel::Info, message);
            return;
        }
        let before = self.history.undo();
        self.restore(before, "Nothing to undo", ctx);
    }

    /// Restores settings, layout and markers as before the last undo.
    pub(super) fn redo(&mut self, ctx: &mut PanelContext<'_>) {
        let undone = self.history.redo();
        self.restore(undone, "Nothing to redo", ctx);
    }

    fn restore(&mut self, arrangement: Option<Arrangement>, none: &str, ctx: &mut PanelContext<'_>) {
        match arrangement {
            Some(Arrangement { settings, layout, markers }) => {
                (self.settings, self.layout) = (settings, layout);
                if markers != ctx.playback.markers {
                    ctx.commands.push(Command::SetMarkers(markers));
                }
            }
            None => self.notices.show_message(NoticeLevel::Info, none),
        }
    }

    /// The focused panel, to which commands about one panel apply, and its size in points.
    pub(super) fn focused(&self) -> (PanelName, Vec2) {
        let panel = self.focus.unwrap_or(PanelName::Image);
        let place = self.places.iter().find(|(known, _)| *known == panel);
        (panel, place.map_or(HIDDEN_PANEL_SIZE, |(_, rect)| rect.size()))
    }

    /// Moves the focus to the next or previous panel on the screen.
    pub(super) fn focus_neighbour(&mut self, forward: bool) {
        let shown = &self.places;
        let count = shown.len();
        let at = shown.iter().position(|(panel, _)| Some(*panel) == self.focus);
        let next = at.map_or(0, |at| if forward { at + 1 } else { at + count - 1 } % count.max(1));
        self.focus = shown.get(next).map(|(panel, _)| *panel).or(self.focus);
    }

    /// Opens "What is this?" about the focused panel where it is on the screen, else about the first one.
    pub(super) fn explain_focused(&mut self) {
        let shown = |wanted: PanelName| self.places.iter().any(|(panel, _)| *panel == wanted);
        let focused = self.focus.filter(|panel| shown(*panel));
        let first = self.places.iter().map(|(panel, _)| *panel).find(|panel| *panel != PanelName::Timeline);
        if let Some(panel) = focused.or(first) {
            self.help.ask(panel);
        }
    }

    /// A click into a panel focuses it.
    pub(super) fn follow_focus(&mut self, ui: &Ui) {
        let pressed = ui.input(|input| input.pointer.any_pressed().then(|| input.pointer.interact_pos()).flatten());
        let Some(pressed) = pressed.filter(|at| ui.ctx().layer_id_at(*at) == Some(ui.layer_id())) else { return };
        let place = self.places.iter().find(|(_, rect)| rect.contains(pressed));
        self.focus = place.map_or(self.focus, |(panel, _)| Some(*panel));
    }

    /// Layout of the panels for a saved session.
    pub fn layout_value(&self) -> Option<serde_json::Value> {
        saved_layouts::layout_value(&self.layout)
    }

    /// Restores the layout of a saved session.
    pub fn take_layout(&mut self, value: &serde_json::Value) {
        saved_layouts::take_layout(&mut self.layout, value);
    }

    /// True if the layout has changed since the last call.
    pub(in crate::gui) fn take_layout_changed(&mut self) -> bool {
        let changed = self.noticed.as_ref().is_some_and(|noticed| *noticed != self.layout);
        if changed || self.noticed.is_none() {
            self.noticed = Some(self.layout.clone());
        }
        changed
    }

    /// Layout of the panels for the next start.
    pub(in crate::gui) fn last_layout_value(&self) -> Option<serde_json::Value> {
        saved_layouts::last_layout_value(&self.layout)
    }

    /// Arranges the panels for the start: as at the end of the last use, or as in the settings.
    pub(in crate::gui) fn arrange_for_start(&mut self, last: Option<&serde_json::Value>) {
        let name = self.settings.layout.clone();
        match last.filter(|_| name == settings::LAST_LAYOUT) {
            Some(last) => saved_layouts::take_last_layout(&mut self.layout, last),
            None => self.arrange_by_name(&name),
        }
    }

    pub fn arrange(&mut self, preset: Preset) {
        self.layout.arrange(preset);
    }

    /// Arranges the panels as in a preset or a saved layout, by name; no change for an unknown name.
    pub fn arrange_by_name(&mut self, name: &str) {
        if let Some(preset) = Preset::from_name(name) {
            self.layout.arrange(preset);
        } else if let Some(number) = self.saved_layouts.names().position(|known| known == name) {
            self.saved_layouts.take(number, &mut self.layout);
        }
    }
}
