//! The movable panels and their arrangement.

use egui::{Color32, CursorIcon, Id, Rect, Response, Sense, Stroke, Ui, Vec2, Visuals, WidgetText, vec2};
use egui_tiles::{Behavior, Container, LinearDir, SimplificationOptions, Tabs, Tile, TileId, Tiles, Tree, UiResponse};

use super::panels::Panels;
pub use super::presets::Preset;
use super::presets::{split, tabs, tree_of, tree_of_one};
use crate::gui::help;
use crate::gui::theme::{PANEL_MARGIN, Theme};
use crate::gui::{PanelContext, PanelName};

#[derive(Clone, Debug)]
pub(crate) struct PanelLayout {
    tree: Tree<PanelName>,
    /// Panel that fills the space of all panels.
    maximized: Option<PanelName>,
    /// Preset that was chosen last; `None` for a saved layout.
    pub(crate) preset: Option<Preset>,
    /// True if the preset was arranged for a large window; `None` before it was shown, and for a saved layout.
    large: Option<bool>,
}

/// Size in points of all panels from which the overview has the convergence plots beside the calibration table.
const LARGE: Vec2 = vec2(2400.0, 1000.0);

impl PartialEq for PanelLayout {
    /// True if the same panels are in the same places.
    fn eq(&self, other: &Self) -> bool {
        let of = |layout: &Self| (layout.maximized, layout.preset);
        self.tree == other.tree && of(self) == of(other)
    }
}

impl Default for PanelLayout {
    fn default() -> Self {
        Self::of(Preset::default())
    }
}

impl PanelLayout {
    fn of(preset: Preset) -> Self {
        Self { tree: tree_of(preset, false), maximized: None, preset: Some(preset), large: None }
    }

    /// Arranges the panels as in a preset, with all panels visible.
    pub(crate) fn arrange(&mut self, preset: Preset) {
        *self = Self::of(preset);
    }

    /// Applies a saved layout.
    pub(crate) fn take(&mut self, tree: Tree<PanelName>) {
        *self = Self { tree, maximized: None, preset: None, large: None };
    }

    pub(crate) fn tree(&self) -> &Tree<PanelName> {
        &self.tree
    }

    /// Maximizes a visible panel, or restores the others if it is maximized.
    pub(crate) fn toggle_maximized(&mut self, pane: PanelName) {
        let shown = pane != PanelName::Timeline && self.is_visible(pane);
        self.maximized = if self.maximized == Some(pane) || !shown { None } else { Some(pane) };
    }

    pub(crate) fn maximized(&self) -> Option<PanelName> {
        self.maximized
    }

    /// True if another layout has the same panels in the same places, with other tabs in front or another panel
    /// maximized.
    pub(crate) fn differs_by_open_tabs_only(&self, other: &Self) -> bool {
        self != other && self.preset == other.preset && without_open_tabs(&self.tree) == without_open_tabs(&other.tree)
    }

    /// Arranges a preset for the size of the window, unless its panels were moved by hand.
    fn follow_size(&mut self, room: Vec2) {
        let Some(preset) = self.preset else { return };
        let large = room.x >= LARGE.x && room.y >= LARGE.y;
        let Some(before) = self.large.replace(large).or(Some(false)).filter(|before| *before != large) else { return };
        if without_open_tabs(&self.tree) == without_open_tabs(&tree_of(preset, before)) {
            self.tree = tree_of(preset, large);
        }
    }

    pub(crate) fn is_visible(&self, pane: PanelName) -> bool {
        self.tree.tiles.find_pane(&pane).is_some_and(|tile| self.tree.is_visible(tile))
    }

    pub(crate) fn set_visible(&mut self, pane: PanelName, visible: bool) {
        if visible != (self.maximized == Some(pane)) {
            self.maximized = None;
        }
        if visible && self.tree.tiles.find_pane(&pane).is_none() {
            // A saved layout may be older than the panel.
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

    /// Draws the panels, marks the focused one, and stores their rectangles.
    pub(crate) fn ui(
        &mut self,
        ui: &mut Ui,
        panels: &mut Panels,
        ctx: &mut PanelContext<'_>,
        focus: Option<PanelName>,
        places: &mut Vec<(PanelName, Rect)>,
    ) -> TabClicks {
        self.follow_size(ui.available_size());
        let mut alone = self.maximized.map(tree_of_one);
        let drawn = alone.as_mut().unwrap_or(&mut self.tree);
        let tree = TreeIds { id: drawn.id(), root: drawn.root() };
        let mut shown = Shown { panels, ctx, focus, places, tree, clicks: TabClicks::default() };
        drawn.ui(&mut shown, ui);
        let clicks = shown.clicks;
        // The close button of a maximized panel restores the others.
        let is_open = |alone: &Tree<PanelName>| alone.tiles.tile_ids().all(|tile| alone.is_visible(tile));
        if alone.as_ref().is_some_and(|alone| !is_open(alone)) {
            self.maximized = None;
        }
        if let Some(panel) = clicks.maximized {
            self.toggle_maximized(panel);
        }
        clicks
    }
}

/// The same panels in the same places, without the tabs that are in front.
fn without_open_tabs(tree: &Tree<PanelName>) -> Tree<PanelName> {
    let mut tree = tree.clone();
    for (_, tile) in tree.tiles.iter_mut() {
        if let Tile::Container(Container::Tabs(tabs)) = tile {
            tabs.active = None;
        }
    }
    tree
}

/// Clicks on the tab bars in a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TabClicks {
    /// The panel whose "?" was pressed.
    pub(crate) asked: Option<PanelName>,
    /// The panel whose tab was clicked.
    pub(crate) focused: Option<PanelName>,
    /// The panel whose tab was clicked with the secondary button.
    pub(crate) menu: Option<PanelName>,
    /// The panel whose tab was double-clicked.
    maximized: Option<PanelName>,
}

#[derive(Clone, Copy)]
struct TreeIds {
    id: Id,
    root: Option<TileId>,
}

struct Shown<'a, 'b> {
    panels: &'a mut Panels,
    ctx: &'a mut PanelContext<'b>,
    focus: Option<PanelName>,
    places: &'a mut Vec<(PanelName, Rect)>,
    tree: TreeIds,
    clicks: TabClicks,
}

impl Behavior<PanelName> for Shown<'_, '_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, pane: &mut PanelName) -> UiResponse {
        let theme: &Theme = self.ctx.theme;
        let place = ui.max_rect();
        self.places.push((*pane, place));
        egui::Frame::new().fill(theme.surface).inner_margin(PANEL_MARGIN).show(ui, |ui| {
            ui.set_min_size(ui.available_size());
            self.panels.get(*pane).ui(ui, self.ctx);
        });
        if self.focus == Some(*pane) {
            ui.painter().hline(place.x_range(), place.top() + 1.0, Stroke::new(2.0, theme.accent));
        }
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &PanelName) -> WidgetText {
        pane.title().into()
    }

    /// Draws a "?" for the panel in front.
    fn top_bar_right_ui(
        &mut self,
        tiles: &Tiles<PanelName>,
        ui: &mut Ui,
        _tile: TileId,
        tabs: &Tabs,
        _scroll_offset: &mut f32,
    ) {
        let Some(Tile::Pane(panel)) = tabs.active.and_then(|tile| tiles.get(tile)) else { return };
        if help::button_ui(ui, self.ctx.theme, *panel) {
            self.clicks.asked = Some(*panel);
        }
    }

    /// A click on a tab focuses its panel, a double-click maximizes it or restores the others.
    fn on_tab_button(&mut self, tiles: &mut Tiles<PanelName>, tile: TileId, response: Response) -> Response {
        let panel = tiles.get_pane(&tile).copied();
        if response.clicked() {
            self.clicks.focused = panel.or(self.clicks.focused);
        }
        if response.secondary_clicked() {
            self.clicks.menu = panel;
        }
        if response.double_clicked() {
            self.clicks.maximized = panel;
        }
        response
    }

    fn is_tab_closable(&self, tiles: &Tiles<PanelName>, tile: TileId) -> bool {
        matches!(tiles.get(tile), Some(Tile::Pane(_)))
    }

    /// Lets the empty part of a tab bar drag all its tabs. Unlike the library's, it is skipped by the Tab key.
    fn tab_bar_trailing_ui(&mut self, _tiles: &Tiles<PanelName>, ui: &mut Ui, tile: TileId, _tabs: &Tabs) {
        let room = ui.available_rect_before_wrap().intersect(ui.clip_rect());
        if self.tree.root == Some(tile) || !room.is_positive() {
            return;
        }
        let bar = ui.interact(room, ui.scope_id().with("move tabs"), Sense::DRAG);
        if bar.on_hover_cursor(CursorIcon::Grab).drag_started() {
            ui.set_dragged_id(tile.egui_id(self.tree.id));
        }
    }

    /// Title of a dragged group: the names of its panels.
    fn tab_title_for_tile(&mut self, tiles: &Tiles<PanelName>, tile: TileId) -> WidgetText {
        let names: Vec<&str> = match tiles.get(tile) {
            Some(Tile::Pane(panel)) => vec![panel.title()],
            Some(Tile::Container(container)) => {
                let panes = container.children().filter_map(|child| tiles.get_pane(child));
                panes.map(|panel| panel.title()).collect()
            }
            None => Vec::new(),
        };
        names.join(", ").into()
    }

    fn drag_preview_stroke(&self, _visuals: &Visuals) -> Stroke {
        Stroke::new(1.5, self.ctx.theme.accent)
    }

    fn drag_preview_color(&self, _visuals: &Visuals) -> Color32 {
        self.ctx.theme.accent.gamma_multiply(0.25)
    }

    /// Panels are dragged by their tabs.
    fn is_tile_draggable(&self, tiles: &Tiles<PanelName>, tile: TileId) -> bool {
        matches!(tiles.get(tile), Some(Tile::Pane(_)))
    }

    /// Hides a closed panel, so that the menu can show it again.
    fn on_tab_close(&mut self, tiles: &mut Tiles<PanelName>, tile: TileId) -> bool {
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
        _tiles: &Tiles<PanelName>,
        _tile: TileId,
        state: &egui_tiles::TabState,
    ) -> Color32 {
        if state.active { self.ctx.theme.surface } else { self.ctx.theme.background }
    }

    fn tab_text_color(
        &self,
        _visuals: &Visuals,
        _tiles: &Tiles<PanelName>,
        _tile: TileId,
        state: &egui_tiles::TabState,
    ) -> Color32 {
        if state.active { self.ctx.theme.text_strong } else { self.ctx.theme.text_weak }
    }

    fn tab_outline_stroke(
        &self,
        _visuals: &Visuals,
        _tiles: &Tiles<PanelName>,
        _tile: TileId,
        _state: &egui_tiles::TabState,
    ) -> Stroke {
        Stroke::NONE
    }

    fn tab_bar_hline_stroke(&self, _visuals: &Visuals) -> Stroke {
        Stroke::NONE
    }
}
