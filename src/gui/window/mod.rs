//! Content of the window: bars, panels, timeline, dialogs.
//!
//! The real window and headless screenshots both draw [`window_ui`].

mod actions;
mod copying;
mod dialogs;
#[cfg(test)]
mod figure_tests;
#[cfg(test)]
mod fit_tests;
mod focus_ring;
mod history;
#[cfg(test)]
mod keyboard_tests;
mod legend;
mod menu;
mod notices;
mod panel_export;
mod panels;
#[cfg(test)]
mod pointer_tests;
mod progress;
mod saved_layouts;
mod settings;
mod shortcuts;
mod status_bar;
#[cfg(test)]
mod tests;
mod tiles;
mod top_bar;
mod tour;
mod warning_lines;

use std::path::PathBuf;

use egui::{CentralPanel, Frame, Margin, Panel, Rect, Ui, UiBuilder, Vec2, vec2};

use self::actions::Action;
use self::copying::PanelMenu;
pub use self::dialogs::{Dialog, Dialogs};
use self::focus_ring::FocusRing;
use self::history::{Arrangement, History};
pub use self::legend::RunLegend;
pub use self::notices::{NoticeLevel, Notices};
pub use self::panel_export::{alone_ui, panel_table};
pub use self::panels::{PanelName, Panels};
pub use self::progress::{Progress, ProgressMeter};
pub use self::saved_layouts::SavedLayouts;
pub use self::settings::{SCALES, Settings};
use self::tiles::Layout;
pub use self::tiles::Preset;
use self::tour::Tour;
use super::PanelContext;
use super::desktop::PanelExport;
use super::help::{self, Help};
use super::slide;
use super::theme::Theme;
use super::timeline::TimelinePanel;

/// Request of the window to the application, in addition to the commands of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WindowRequest {
    OpenLog(PathBuf),
    /// Store the saved layouts, given as text.
    KeepLayouts(String),
    SaveSession,
    /// Close the log and go back to the welcome view.
    CloseLog,
    Quit,
    /// Leave the session after the question about unsaved work.
    Leave {
        /// True if the session is saved first.
        save: bool,
    },
    WritePanel(Box<PanelExport>),
}

/// State of the window without the session.
#[derive(Default)]
pub struct WindowState {
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
    /// Log that is being opened while another one is shown.
    pub opening: Option<PathBuf>,
    /// Name of the study from which the session was opened.
    pub study: Option<String>,
    /// State of "What is this?" and the manual.
    pub(crate) help: Help,
    /// Recently opened logs and sessions, newest first, for the menu.
    pub recent_logs: Vec<PathBuf>,
    tour: Tour,
    ring: FocusRing,
    layout: Layout,
    history: History,
    /// Layout at its last detected change.
    noticed: Option<Layout>,
    /// Value under the pointer.
    pointed: Option<String>,
    copied: Option<String>,
    menu: Option<PanelMenu>,
    /// Panel that was clicked last.
    focus: Option<PanelName>,
    /// Height of timeline and status bar in the last frame, in points.
    below_height: Option<f32>,
    /// Rectangles of the visible panels, in the order of drawing.
    places: Vec<(PanelName, Rect)>,
}

impl WindowState {
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

    fn close_dialogs(&mut self) {
        self.dialogs.close();
        self.shortcuts_open = false;
        self.notices.list_open = false;
        self.help.manual.close();
    }

    /// Restores settings and layout to the state before the last change.
    fn undo(&mut self) {
        let before = self.history.undo();
        self.restore(before, "Nothing to undo");
    }

    /// Restores settings and layout to the state before the last undo.
    fn redo(&mut self) {
        let undone = self.history.redo();
        self.restore(undone, "Nothing to redo");
    }

    fn restore(&mut self, arrangement: Option<Arrangement>, none: &str) {
        match arrangement {
            Some(Arrangement { settings, layout }) => (self.settings, self.layout) = (settings, layout),
            None => self.notices.show_message(NoticeLevel::Info, none),
        }
    }

    /// Focused panel, to which commands about one panel apply, and its size in points.
    fn focused(&self) -> (PanelName, Vec2) {
        let panel = self.focus.unwrap_or(PanelName::Image);
        let place = self.places.iter().find(|(known, _)| *known == panel);
        (panel, place.map_or(panel_export::HIDDEN_PANEL_SIZE, |(_, rect)| rect.size()))
    }

    /// Moves the focus to the next or previous panel on the screen.
    fn focus_neighbour(&mut self, forward: bool) {
        let shown = &self.places;
        let count = shown.len();
        let at = shown.iter().position(|(panel, _)| Some(*panel) == self.focus);
        let next = at.map_or(0, |at| if forward { at + 1 } else { at + count - 1 } % count.max(1));
        self.focus = shown.get(next).map(|(panel, _)| *panel).or(self.focus);
    }

    /// Opens "What is this?" for the focused panel if it is visible, else for the first one.
    fn explain_focused(&mut self) {
        let shown = |wanted: PanelName| self.places.iter().any(|(panel, _)| *panel == wanted);
        let focused = self.focus.filter(|panel| shown(*panel));
        let first = self.places.iter().map(|(panel, _)| *panel).find(|panel| *panel != PanelName::Timeline);
        if let Some(panel) = focused.or(first) {
            self.help.ask(panel);
        }
    }

    /// A click into a panel focuses it.
    fn follow_focus(&mut self, ui: &Ui) {
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

    /// Arranges the panels as in a preset.
    pub fn arrange(&mut self, preset: Preset) {
        self.layout.arrange(preset);
    }

    /// Arranges the panels as in a preset or a saved layout, by name; no change for an unknown name.
    pub fn arrange_by_name(&mut self, name: &str) {
        if let Some(preset) = Preset::ALL.into_iter().find(|preset| preset.name() == name) {
            self.layout.arrange(preset);
        } else if let Some(number) = self.saved_layouts.names().position(|known| known == name) {
            self.saved_layouts.take(number, &mut self.layout);
        }
    }
}

/// Height of the status bar in points.
const STATUS_HEIGHT: f32 = 22.0;

/// Draws the window for a session.
pub fn window_ui(ui: &mut Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>) {
    let theme = *ctx.theme;
    slide::update(ctx);
    tour::keys(ui, state);
    // Shortcuts have no effect while a dialog is open.
    let mut actions: Vec<Action> = if state.dialogs.is_open() { Vec::new() } else { actions::pressed(ui) };
    // A dialog receives the keys after the one that opens it, even in the same frame.
    if let Some(opening) = actions.iter().copied().find(|action| matches!(action, Action::Dialog(_))) {
        actions.clear();
        actions::perform(opening, state, ctx);
    }
    state.panels.inspector.show_times = state.show_times;

    let bar = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 3));
    Panel::top("top bar").exact_size(30.0).frame(bar).show(ui, |ui| top_bar::ui(ui, state, ctx, &mut actions));
    notices::banner_ui(ui, ctx);

    // The panels are drawn before the timeline below them, because the Tab key follows the order of drawing.
    let wanted = TimelinePanel::height_for(ctx.recording.runs.len() + ctx.recording.trajectories.len());
    let wanted = wanted.min(0.25 * (ui.available_height() - STATUS_HEIGHT));
    let below = state.below_height.unwrap_or(wanted + STATUS_HEIGHT);
    let rest = ui.available_rect_before_wrap();
    let above = rest.with_max_y((rest.bottom() - below).max(rest.top()));
    let mut asked = None;
    state.places.clear();
    let ground = Frame::new().fill(theme.background).inner_margin(Margin::same(3));
    let mut panels_ui = ui.new_child(UiBuilder::new().max_rect(above));
    CentralPanel::no_frame().frame(ground).show(&mut panels_ui, |ui| {
        asked = state.layout.ui(ui, &mut state.panels, ctx, state.focus, &mut state.places);
    });

    // The status bar is laid out first, because it is the lowest.
    let status = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 2));
    let status = Panel::bottom("status bar").exact_size(STATUS_HEIGHT).frame(status);
    let status = status.show(ui, |ui| ui.max_rect());
    let frame = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(6, 4));
    let timeline = Panel::bottom("timeline").resizable(true).default_size(wanted).min_size(60.0).frame(frame);
    let timeline = timeline.show(ui, |ui| {
        let corner = ui.max_rect().right_top() + vec2(-24.0, 2.0);
        state.panels.timeline.ui(ui, ctx);
        let place = UiBuilder::new().max_rect(Rect::from_min_size(corner, vec2(20.0, 18.0)));
        let pressed = ui.scope_builder(place, |ui| help::button_ui(ui, &theme, PanelName::Timeline)).inner;
        asked = pressed.then_some(PanelName::Timeline).or(asked);
    });
    state.places.push((PanelName::Timeline, timeline.response.rect));
    ui.scope_builder(UiBuilder::new().max_rect(status.inner), |ui| status_bar::ui(ui, state, ctx));
    let below = rest.bottom() - timeline.response.rect.top();
    if state.below_height.replace(below).is_none_or(|known| known != below) {
        ui.request_repaint();
    }
    state.follow_focus(ui);
    if let Some(panel) = asked {
        state.help.toggle(ui.ctx(), panel);
    }
    actions.extend(state.panels.comparison.asked.take().map(Action::Dialog));

    dialogs::ui(ui, state, ctx, &mut actions);
    shortcuts::ui(ui, &theme, &mut state.shortcuts_open);
    state.notices.list_ui(ui, ctx);
    tour::ui(ui, state, ctx);
    state.help.ui(ui, &theme, &state.places);
    state.notices.toasts_ui(ui, &theme);
    state.ring.ui(ui, &theme);
    copying::menu_ui(ui, state, ctx);
    if actions.contains(&Action::Copy) {
        state.pointed = copying::value_under_pointer(ui);
    }
    for action in actions {
        actions::perform(action, state, ctx);
    }
    let settled = !ui.input(|input| input.pointer.any_down());
    if state.history.follow(&state.settings, &state.layout, settled) {
        ui.request_repaint();
    }
    if let Some(text) = state.copied.take() {
        ui.copy_text(text);
    }
}
