//! Everything inside the window: bars, panels, timeline, dialogs.
//!
//! The real window and the headless pictures draw the same [`window_ui`].

mod actions;
mod add_run;
mod fork;
mod legend;
mod notices;
mod palette;
mod panel_export;
mod panel_table;
mod saved_layouts;
mod status_bar;
#[cfg(test)]
mod tests;
mod tiles;
mod top_bar;

use std::path::PathBuf;

use egui::{CentralPanel, Frame, Margin, Panel, Rect, Ui, Vec2};

use self::actions::Action;
pub use self::add_run::AddRunDialog;
pub use self::fork::ForkDialog;
pub use self::legend::RunLegend;
pub use self::notices::{NoticeLevel, Notices};
pub use self::palette::CommandPalette;
pub use self::panel_export::{PanelExport, alone_ui};
pub use self::saved_layouts::SavedLayouts;
pub use self::tiles::Preset;
use self::tiles::{Layout, Pane};
use super::PanelContext;
use super::breakpoints::BreakpointsPanel;
use super::convergence::ConvergencePanel;
use super::image_panel::ImagePanel;
use super::inspector::InspectorPanel;
use super::jacobian::JacobianPanel;
use super::laboratory::LaboratoryPanel;
use super::open_dialog::OpenDialog;
use super::rank::RankPanel;
use super::residuals::ResidualsPanel;
use super::scene::ScenePanel;
use super::slide;
use super::theme::Theme;
use super::timeline::TimelinePanel;

/// What the window wants of the program, beyond what a session can do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WindowRequest {
    /// Open a log.
    OpenLog(PathBuf),
    /// Dark when light, light when dark.
    ToggleTheme,
    /// Keep the saved layouts, written as text.
    KeepLayouts(String),
    /// Write the session to a file.
    SaveSession,
    /// Write a panel to files.
    WritePanel(Box<PanelExport>),
}

/// A panel by its name on the command line and in the names of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PanelName {
    /// The camera's image.
    Image,
    /// The scene in three dimensions.
    Scene,
    /// Calibration over time.
    Convergence,
    /// Rank and null directions.
    Rank,
    /// The linearization by blocks.
    Jacobian,
    /// Residuals.
    Residuals,
    /// Numbers of what is selected.
    Inspector,
    /// What a mechanism and a motion can identify.
    Laboratory,
    /// Breakpoints.
    Breakpoints,
    /// The lanes over time.
    Timeline,
}

impl PanelName {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Image,
        Self::Scene,
        Self::Convergence,
        Self::Rank,
        Self::Jacobian,
        Self::Residuals,
        Self::Inspector,
        Self::Laboratory,
        Self::Breakpoints,
        Self::Timeline,
    ];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Image => "image",
            Self::Scene => "scene",
            Self::Convergence => "convergence",
            Self::Rank => "rank",
            Self::Jacobian => "jacobian",
            Self::Residuals => "residuals",
            Self::Inspector => "inspector",
            Self::Laboratory => "laboratory",
            Self::Breakpoints => "breakpoints",
            Self::Timeline => "timeline",
        }
    }
}

/// The panels' own state.
#[derive(Default)]
pub struct Panels {
    /// The camera's image.
    pub image: ImagePanel,
    /// The scene in three dimensions.
    pub scene: ScenePanel,
    /// Calibration over time.
    pub convergence: ConvergencePanel,
    /// Rank and null directions.
    pub rank: RankPanel,
    /// The linearization by blocks.
    pub jacobian: JacobianPanel,
    /// Residuals.
    pub residuals: ResidualsPanel,
    /// Numbers of what is selected.
    pub inspector: InspectorPanel,
    /// What a mechanism and a motion can identify.
    pub laboratory: LaboratoryPanel,
    /// Breakpoints.
    pub breakpoints: BreakpointsPanel,
}

impl Panels {
    /// Panels that show the same and hold nothing of a window.
    fn views(&self) -> Self {
        Self {
            image: self.image.view_copy(),
            scene: self.scene.view_copy(),
            laboratory: self.laboratory.view_copy(),
            ..Self::default()
        }
    }

    fn pane_ui(&mut self, pane: Pane, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        match pane {
            Pane::Image => self.image.ui(ui, ctx),
            Pane::Scene => self.scene.ui(ui, ctx),
            Pane::Convergence => self.convergence.ui(ui, ctx),
            Pane::Rank => self.rank.ui(ui, ctx),
            Pane::Jacobian => self.jacobian.ui(ui, ctx),
            Pane::Residuals => self.residuals.ui(ui, ctx),
            Pane::Inspector => self.inspector.ui(ui, ctx),
            Pane::Laboratory => self.laboratory.ui(ui, ctx),
            Pane::Breakpoints => self.breakpoints.ui(ui, ctx),
        }
    }
}

/// State of everything in the window that is not the session's.
#[derive(Default)]
pub struct WindowState {
    /// The panels.
    pub panels: Panels,
    /// The timeline.
    pub timeline: TimelinePanel,
    /// Runs with their accuracy.
    pub legend: RunLegend,
    /// What went wrong, for people to see.
    pub notices: Notices,
    /// Adds a run.
    pub add_run: AddRunDialog,
    /// Forks a run.
    pub fork: ForkDialog,
    /// Opens a log.
    pub open_dialog: OpenDialog,
    /// Lists commands.
    pub palette: CommandPalette,
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
    layout: Layout,
    /// The panel that was clicked last.
    focus: Option<PanelName>,
    /// Where the panels lie that are on the screen.
    places: Vec<(PanelName, Rect)>,
}

impl WindowState {
    fn close_dialogs(&mut self) {
        self.add_run.hide();
        self.fork.hide();
        self.open_dialog.hide();
        self.palette.hide();
        self.shortcuts_open = false;
        self.notices.list_open = false;
    }

    /// The panel that commands about one panel mean, and its size in points.
    fn focused(&self) -> (PanelName, Vec2) {
        let panel = self.focus.unwrap_or(PanelName::Image);
        let place = self.places.iter().find(|(known, _)| *known == panel);
        (panel, place.map_or(panel_export::HIDDEN_PANEL_SIZE, |(_, rect)| rect.size()))
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
}

/// Draws all of the window's content over a session.
pub fn window_ui(ui: &mut Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>) {
    let theme = *ctx.theme;
    slide::update(ctx);
    let mut actions: Vec<Action> = actions::pressed(ui);
    state.panels.inspector.show_times = state.show_times;

    let bar = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 3));
    Panel::top("top bar").exact_size(30.0).frame(bar).show(ui, |ui| top_bar::ui(ui, state, ctx, &mut actions));
    let status = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 2));
    Panel::bottom("status bar").exact_size(22.0).frame(status).show(ui, |ui| status_bar::ui(ui, state, ctx));
    notices::banner_ui(ui, ctx);

    let wanted = TimelinePanel::height_for(ctx.recording.runs.len()).min(0.22 * ui.available_height());
    let frame = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(6, 4));
    let timeline = Panel::bottom("timeline").resizable(true).default_size(wanted).min_size(60.0).frame(frame);
    let timeline = timeline.show(ui, |ui| state.timeline.ui(ui, ctx));
    state.places.clear();
    state.places.push((PanelName::Timeline, timeline.response.rect));

    let ground = Frame::new().fill(theme.background).inner_margin(Margin::same(3));
    CentralPanel::no_frame().frame(ground).show(ui, |ui| {
        state.layout.ui(ui, &mut state.panels, ctx, state.focus, &mut state.places);
    });
    state.follow_focus(ui);

    dialogs_ui(ui, state, ctx, &mut actions);
    for action in actions {
        actions::perform(action, state, ctx);
    }
}

fn dialogs_ui(ui: &Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>, actions: &mut Vec<Action>) {
    state.add_run.ui(ui, ctx);
    state.fork.ui(ui, ctx);
    if let Some(path) = state.open_dialog.ui(ui, ctx.theme) {
        state.requests.push(WindowRequest::OpenLog(path));
    }
    state.palette.ui(ui, ctx.theme, actions);
    palette::shortcuts_ui(ui, ctx.theme, &mut state.shortcuts_open);
    state.notices.list_ui(ui, ctx);
    state.notices.toasts_ui(ui, ctx.theme);
}

/// A frame for small windows and menus.
pub(crate) fn dialog_frame(theme: &Theme) -> Frame {
    Frame::new()
        .fill(theme.surface)
        .stroke(egui::Stroke::new(1.0, theme.outline))
        .corner_radius(super::theme::CORNER_RADIUS)
        .inner_margin(12)
        .shadow(egui::Shadow { offset: [0, 6], blur: 18, spread: 0, color: egui::Color32::from_black_alpha(90) })
}
