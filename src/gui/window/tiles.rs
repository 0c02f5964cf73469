//! The movable panels and their layouts.

use egui::{Color32, Rect, Stroke, Ui, Visuals, WidgetText};
use egui_tiles::{
    Behavior, Container, Linear, LinearDir, SimplificationOptions, Tile, TileId, Tiles, Tree, UiResponse,
};

use serde::{Deserialize, Serialize};

use super::{PanelName, Panels};
use crate::gui::PanelContext;
use crate::gui::theme::{PANEL_MARGIN, Theme};

/// A panel that can be moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
pub(crate) enum Pane {
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
}

impl Pane {
    /// All of them.
    pub(crate) const ALL: [Self; 9] = [
        Self::Image,
        Self::Scene,
        Self::Convergence,
        Self::Rank,
        Self::Jacobian,
        Self::Residuals,
        Self::Inspector,
        Self::Laboratory,
        Self::Breakpoints,
    ];

    /// Which panel it is.
    fn panel(self) -> PanelName {
        match self {
            Self::Image => PanelName::Image,
            Self::Scene => PanelName::Scene,
            Self::Convergence => PanelName::Convergence,
            Self::Rank => PanelName::Rank,
            Self::Jacobian => PanelName::Jacobian,
            Self::Residuals => PanelName::Residuals,
            Self::Inspector => PanelName::Inspector,
            Self::Laboratory => PanelName::Laboratory,
            Self::Breakpoints => PanelName::Breakpoints,
        }
    }

    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Image => "Image",
            Self::Scene => "Scene",
            Self::Convergence => "Convergence",
            Self::Rank => "Rank",
            Self::Jacobian => "Jacobian",
            Self::Residuals => "Residuals",
            Self::Inspector => "Inspector",
            Self::Laboratory => "Laboratory",
            Self::Breakpoints => "Breakpoints",
        }
    }
}

/// A ready-made layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Image and scene above convergence, rank and inspector on the right.
    #[default]
    Overview,
    /// Convergence and rank large.
    Calibration,
    /// Image and residuals large.
    FrontEnd,
    /// Scene large.
    Scene,
}

impl Preset {
    /// All of them, in the order of their keys 1 to 4.
    pub(crate) const ALL: [Self; 4] = [Self::Overview, Self::Calibration, Self::FrontEnd, Self::Scene];

    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Overview => "Overview",
            Self::Calibration => "Calibration",
            Self::FrontEnd => "Front end",
            Self::Scene => "Scene",
        }
    }
}

/// Where the panels are.
#[derive(Debug)]
pub(crate) struct Layout {
    tree: Tree<Pane>,
    /// The preset that was chosen last, `None` for a layout of one's own.
    pub(crate) preset: Option<Preset>,
}

impl Default for Layout {
    fn default() -> Self {
        Self { tree: tree_of(Preset::default()), preset: Some(Preset::default()) }
    }
}

impl Layout {
    /// Arranges the panels as in a preset, all visible.
    pub(crate) fn arrange(&mut self, preset: Preset) {
        self.tree = tree_of(preset);
        self.preset = Some(preset);
    }

    /// Arranges the panels as in a layout of one's own.
    pub(crate) fn take(&mut self, tree: Tree<Pane>) {
        self.tree = tree;
        self.preset = None;
    }

    /// Where the panels are, for keeping.
    pub(crate) fn tree(&self) -> &Tree<Pane> {
        &self.tree
    }

    /// Whether a panel is shown.
    pub(crate) fn is_visible(&self, pane: Pane) -> bool {
        self.tree.tiles.find_pane(&pane).is_some_and(|tile| self.tree.is_visible(tile))
    }

    /// Shows or hides a panel.
    pub(crate) fn set_visible(&mut self, pane: Pane, visible: bool) {
        if visible && self.tree.tiles.find_pane(&pane).is_none() {
            // A layout of one's own may be older than the panel.
            let tile = tabs(&mut self.tree.tiles, &[pane]);
            let whole =
                self.tree.root().map(|root| split(&mut self.tree.tiles, LinearDir::Horizontal, [root, tile], 0.7));
            self.tree.root = whole.or(Some(tile));
        }
        if let Some(tile) = self.tree.tiles.find_pane(&pane) {
            self.tree.set_visible(tile, visible);
            if visible {
                self.tree.make_active(|candidate, _| candidate == tile);
            }
        }
    }

    /// Draws the panels, marks the one with the focus, and notes where they lie.
    pub(crate) fn ui(
        &mut self,
        ui: &mut Ui,
        panels: &mut Panels,
        ctx: &mut PanelContext<'_>,
        focus: Option<PanelName>,
        places: &mut Vec<(PanelName, Rect)>,
    ) {
        self.tree.ui(&mut Shown { panels, ctx, focus, places }, ui);
    }
}

fn tree_of(preset: Preset) -> Tree<Pane> {
    use LinearDir::{Horizontal, Vertical};
    let mut all = Tiles::default();
    let tiles = &mut all;
    let (image, scene) = (tabs(tiles, &[Pane::Image]), tabs(tiles, &[Pane::Scene]));
    let (rank, inspector) = (tabs(tiles, &[Pane::Rank]), tabs(tiles, &[Pane::Inspector, Pane::Breakpoints]));
    let (left, right) = match preset {
        Preset::Overview => {
            let plots = tabs(tiles, &[Pane::Convergence, Pane::Residuals, Pane::Jacobian, Pane::Laboratory]);
            let above = split(tiles, Horizontal, [image, scene], 0.5);
            (split(tiles, Vertical, [above, plots], 0.54), split(tiles, Vertical, [rank, inspector], 0.56))
        }
        Preset::Calibration => {
            let (convergence, residuals) =
                (tabs(tiles, &[Pane::Convergence]), tabs(tiles, &[Pane::Residuals, Pane::Jacobian, Pane::Laboratory]));
            let pictures = split(tiles, Horizontal, [image, scene], 0.5);
            let below = split(tiles, Horizontal, [pictures, residuals], 0.66);
            (split(tiles, Vertical, [convergence, below], 0.62), split(tiles, Vertical, [rank, inspector], 0.68))
        }
        Preset::FrontEnd => {
            let (convergence, residuals) =
                (tabs(tiles, &[Pane::Convergence]), tabs(tiles, &[Pane::Residuals, Pane::Jacobian, Pane::Laboratory]));
            let above = split(tiles, Horizontal, [image, residuals], 0.6);
            let below = split(tiles, Horizontal, [convergence, scene], 0.7);
            (split(tiles, Vertical, [above, below], 0.64), split(tiles, Vertical, [inspector, rank], 0.6))
        }
        Preset::Scene => {
            let plots = tabs(tiles, &[Pane::Convergence, Pane::Residuals, Pane::Jacobian, Pane::Laboratory]);
            let below = split(tiles, Horizontal, [image, plots], 0.32);
            (split(tiles, Vertical, [scene, below], 0.68), split(tiles, Vertical, [inspector, rank], 0.5))
        }
    };
    let root = split(tiles, Horizontal, [left, right], 0.745);
    Tree::new(egui::Id::unique(("panels", preset.name())), root, all)
}

fn tabs(tiles: &mut Tiles<Pane>, panes: &[Pane]) -> TileId {
    let children = panes.iter().map(|pane| tiles.insert_pane(*pane)).collect();
    tiles.insert_tab_tile(children)
}

/// Two tiles side by side or one above the other; the first takes `fraction` of the room.
fn split(tiles: &mut Tiles<Pane>, direction: LinearDir, children: [TileId; 2], fraction: f32) -> TileId {
    tiles.insert_container(Container::Linear(Linear::new_binary(direction, children, fraction)))
}

/// The panels while they are drawn.
struct Shown<'a, 'b> {
    panels: &'a mut Panels,
    ctx: &'a mut PanelContext<'b>,
    focus: Option<PanelName>,
    places: &'a mut Vec<(PanelName, Rect)>,
}

impl Behavior<Pane> for Shown<'_, '_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, pane: &mut Pane) -> UiResponse {
        let theme: &Theme = self.ctx.theme;
        let place = ui.max_rect();
        self.places.push((pane.panel(), place));
        egui::Frame::new().fill(theme.surface).inner_margin(PANEL_MARGIN).show(ui, |ui| {
            ui.set_min_size(ui.available_size());
            self.panels.pane_ui(*pane, ui, self.ctx);
        });
        if self.focus == Some(pane.panel()) {
            ui.painter().hline(place.x_range(), place.top() + 1.0, Stroke::new(2.0, theme.accent));
        }
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> WidgetText {
        pane.name().into()
    }

    fn is_tab_closable(&self, tiles: &Tiles<Pane>, tile: TileId) -> bool {
        matches!(tiles.get(tile), Some(Tile::Pane(_)))
    }

    /// A closed panel is hidden, so that the menu can bring it back.
    fn on_tab_close(&mut self, tiles: &mut Tiles<Pane>, tile: TileId) -> bool {
        tiles.set_visible(tile, false);
        false
    }

    fn tab_bar_height(&self, _style: &egui::Style) -> f32 {
        20.0
    }

    fn gap_width(&self, _style: &egui::Style) -> f32 {
        3.0
    }

    fn min_size(&self) -> f32 {
        80.0
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: true, ..SimplificationOptions::default() }
    }

    fn tab_bar_color(&self, _visuals: &Visuals) -> Color32 {
        self.ctx.theme.background
    }

    fn tab_bg_color(
        &self,
        _visuals: &Visuals,
        _tiles: &Tiles<Pane>,
        _tile: TileId,
        state: &egui_tiles::TabState,
    ) -> Color32 {
        if state.active { self.ctx.theme.surface } else { self.ctx.theme.background }
    }

    fn tab_text_color(
        &self,
        _visuals: &Visuals,
        _tiles: &Tiles<Pane>,
        _tile: TileId,
        state: &egui_tiles::TabState,
    ) -> Color32 {
        if state.active { self.ctx.theme.text_strong } else { self.ctx.theme.text_weak }
    }

    fn tab_outline_stroke(
        &self,
        _visuals: &Visuals,
        _tiles: &Tiles<Pane>,
        _tile: TileId,
        _state: &egui_tiles::TabState,
    ) -> Stroke {
        Stroke::NONE
    }

    fn tab_bar_hline_stroke(&self, _visuals: &Visuals) -> Stroke {
        Stroke::NONE
    }
}
