//! Everything inside the window: bars, panels, timeline, dialogs.
//!
//! The real window and the headless pictures draw the same [`window_ui`].

mod actions;
mod dialogs;
mod focus_ring;
#[cfg(test)]
mod keyboard_tests;
mod legend;
mod notices;
mod panel_export;
mod panels;
mod progress;
mod saved_layouts;
mod settings;
mod shortcuts;
mod status_bar;
#[cfg(test)]
mod tests;
mod tiles;
mod top_bar;

use std::cmp::Ordering;
use std::path::PathBuf;

use egui::{CentralPanel, Frame, Margin, Panel, Rect, Ui, Vec2};

use self::actions::Action;
pub use self::dialogs::{Dialog, Dialogs};
use self::focus_ring::FocusRing;
pub use self::legend::RunLegend;
pub use self::notices::{NoticeLevel, Notices};
pub use self::panel_export::{alone_ui, panel_table};
pub use self::panels::{PanelName, Panels};
pub use self::progress::{Progress, ProgressMeter};
pub use self::saved_layouts::SavedLayouts;
pub use self::settings::{SCALES, Settings};
use self::tiles::Layout;
pub use self::tiles::Preset;
use super::PanelContext;
use super::desktop::PanelExport;
use super::slide;
use super::timeline::TimelinePanel;

/// What the window wants of the program, beyond what a session can do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WindowRequest {
    /// Open a log.
    OpenLog(PathBuf),
    /// Keep the saved layouts, written as text.
    KeepLayouts(String),
    /// Write the session to a file.
    SaveSession,
    /// Write a panel to files.
    WritePanel(Box<PanelExport>),
}

/// State of everything in the window that is not the session's.
#[derive(Default)]
pub struct WindowState {
    /// The panels.
    pub panels: Panels,
    /// Runs with their accuracy.
    pub legend: RunLegend,
    /// What went wrong, for people to see.
    pub notices: Notices,
    /// Dialogs that the rest of the window waits for.
    pub dialogs: Dialogs,
    /// Whether the sheet of shortcuts is open.
    pub shortcuts_open: bool,
    /// Memory of the process in bytes, when it is known; pictures leave it out, because it differs from run to run.
    pub memory_bytes: Option<u64>,
    /// Whether step times are shown; pictures leave them out for the same reason.
    pub show_times: bool,
    /// What the window wants of the program; the program takes them after each picture.
    pub requests: Vec<WindowRequest>,
    /// Layouts that a person has made.
    pub saved_layouts: SavedLayouts,
    /// What a person has set; the program applies it.
    pub settings: Settings,
    /// How far the estimation has come, `None` when all is computed.
    pub progress: Option<Progress>,
    /// A log that is being opened while another one is shown.
    pub opening: Option<PathBuf>,
    ring: FocusRing,
    layout: Layout,
    /// The panel that was clicked last.
    focus: Option<PanelName>,
    /// Where the panels lie that are on the screen.
    places: Vec<(PanelName, Rect)>,
}

impl WindowState {
    fn close_dialogs(&mut self) {
        self.dialogs.close();
        self.shortcuts_open = false;
        self.notices.list_open = false;
    }

    /// The panel that commands about one panel mean, and its size in points.
    fn focused(&self) -> (PanelName, Vec2) {
        let panel = self.focus.unwrap_or(PanelName::Image);
        let place = self.places.iter().find(|(known, _)| *known == panel);
        (panel, place.map_or(panel_export::HIDDEN_PANEL_SIZE, |(_, rect)| rect.size()))
    }

    /// Gives the panel after the one with the focus the focus, or the one before it, in the order on the screen.
    fn focus_neighbour(&mut self, forward: bool) {
        let mut shown = self.places.clone();
        shown
            .sort_by(|(_, a), (_, b)| (a.top(), a.left()).partial_cmp(&(b.top(), b.left())).unwrap_or(Ordering::Equal));
        let count = shown.len();
        let at = shown.iter().position(|(panel, _)| Some(*panel) == self.focus);
        let next = at.map_or(0, |at| if forward { at + 1 } else { at + count - 1 } % count.max(1));
        self.focus = shown.get(next).map(|(panel, _)| *panel).or(self.focus);
    }

    /// A click into a panel gives it the focus.
    fn follow_focus(&mut self, ui: &Ui) {
        let pressed = ui.input(|input| input.pointer.any_pressed().then(|| input.pointer.interact_pos()).flatten());
        let Some(pressed) = pressed.filter(|at| ui.ctx().layer_id_at(*at) == Some(ui.layer_id())) else { return };
        let place = self.places.iter().find(|(_, rect)| rect.contains(pressed));
        self.focus = place.map_or(self.focus, |(panel, _)| Some(*panel));
    }

    /// Where the panels are, for a saved session.
    pub fn layout_value(&self) -> Option<serde_json::Value> {
        saved_layouts::layout_value(&self.layout)
    }

    /// Arranges the panels as in a saved session.
    pub fn take_layout(&mut self, value: &serde_json::Value) {
        saved_layouts::take_layout(&mut self.layout, value);
    }

    /// Arranges the panels as in a preset.
    pub fn arrange(&mut self, preset: Preset) {
        self.layout.arrange(preset);
    }

    /// Arranges the panels as in a preset or a layout of one's own, by name; the layout stays when there is none.
    pub fn arrange_by_name(&mut self, name: &str) {
        if let Some(preset) = Preset::ALL.into_iter().find(|preset| preset.name() == name) {
            self.layout.arrange(preset);
        } else if let Some(number) = self.saved_layouts.names().position(|known| known == name) {
            self.saved_layouts.take(number, &mut self.layout);
        }
    }
}

/// Draws all of the window's content over a session.
pub fn window_ui(ui: &mut Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>) {
    let theme = *ctx.theme;
    slide::update(ctx);
    // Behind a dialog keys mean nothing.
    let mut actions: Vec<Action> = if state.dialogs.is_open() { Vec::new() } else { actions::pressed(ui) };
    // A dialog takes the keys that come after the one that opens it, even in the same picture.
    if let Some(opening) = actions.iter().copied().find(|action| matches!(action, Action::Dialog(_))) {
        actions.clear();
        actions::perform(opening, state, ctx);
    }
    state.panels.inspector.show_times = state.show_times;

    let bar = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 3));
    Panel::top("top bar").exact_size(30.0).frame(bar).show(ui, |ui| top_bar::ui(ui, state, ctx, &mut actions));
    let status = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 2));
    Panel::bottom("status bar").exact_size(22.0).frame(status).show(ui, |ui| status_bar::ui(ui, state, ctx));
    notices::banner_ui(ui, ctx);

    let wanted = TimelinePanel::height_for(ctx.recording.runs.len()).min(0.25 * ui.available_height());
    let frame = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(6, 4));
    let timeline = Panel::bottom("timeline").resizable(true).default_size(wanted).min_size(60.0).frame(frame);
    let timeline = timeline.show(ui, |ui| state.panels.timeline.ui(ui, ctx));
    state.places.clear();
    state.places.push((PanelName::Timeline, timeline.response.rect));

    let ground = Frame::new().fill(theme.background).inner_margin(Margin::same(3));
    CentralPanel::no_frame().frame(ground).show(ui, |ui| {
        state.layout.ui(ui, &mut state.panels, ctx, state.focus, &mut state.places);
    });
    state.follow_focus(ui);

    dialogs::ui(ui, state, ctx, &mut actions);
    shortcuts::ui(ui, &theme, &mut state.shortcuts_open);
    state.notices.list_ui(ui, ctx);
    state.notices.toasts_ui(ui, &theme);
    state.ring.ui(ui, &theme);
    for action in actions {
        actions::perform(action, state, ctx);
    }
}
