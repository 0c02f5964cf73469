//! Arrangements of the panels for the keys 1 to 5.

use egui_tiles::{Container, Linear, LinearDir, TileId, Tiles, Tree};

use crate::gui::PanelName;
use crate::text::Named;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Image and scene above the calibration table, rank and inspector on the right.
    #[default]
    Overview,
    /// Convergence and rank large.
    Calibration,
    /// Image and residuals large.
    FrontEnd,
    Scene,
    /// Comparison of all runs large.
    Comparison,
}

/// In the order of the keys 1 to 5.
impl Named for Preset {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Overview, "Overview"),
        (Self::Calibration, "Calibration"),
        (Self::FrontEnd, "Front end"),
        (Self::Scene, "Scene"),
        (Self::Comparison, "Comparison"),
    ];
}

/// A tree with one panel.
pub(super) fn tree_of_one(panel: PanelName) -> Tree<PanelName> {
    let mut tiles = Tiles::default();
    let root = tabs(&mut tiles, &[panel]);
    Tree::new(egui::Id::unique("maximized panel"), root, tiles)
}

/// Panels of a preset; in a `large` window the overview has more of them in view.
pub(super) fn tree_of(preset: Preset, large: bool) -> Tree<PanelName> {
    use LinearDir::{Horizontal, Vertical};
    use PanelName::{
        Breakpoints, Calibration, Comparison, Convergence, Image, Inspector, Jacobian, Laboratory, Rank, Residuals,
        Scene,
    };
    let mut all = Tiles::default();
    let tiles = &mut all;
    if preset == Preset::Comparison {
        let left = tabs(tiles, &[Comparison, Calibration, Convergence, Residuals, Image, Scene, Jacobian, Laboratory]);
        let (rank, inspector) = (tabs(tiles, &[Rank]), tabs(tiles, &[Inspector, Breakpoints]));
        let right = split(tiles, Vertical, [rank, inspector], 0.56);
        let root = split(tiles, Horizontal, [left, right], 0.76);
        return Tree::new(egui::Id::unique(("panels", preset.name())), root, all);
    }
    let (image, scene) = (tabs(tiles, &[Image]), tabs(tiles, &[Scene]));
    let (rank, inspector) = (tabs(tiles, &[Rank]), tabs(tiles, &[Inspector, Breakpoints]));
    let (left, right) = match preset {
        Preset::Overview | Preset::Comparison => {
            let plots = if large {
                let table = tabs(tiles, &[Calibration, Comparison, Laboratory]);
                let convergence = tabs(tiles, &[Convergence, Residuals, Jacobian]);
                split(tiles, Horizontal, [table, convergence], 0.5)
            } else {
                tabs(tiles, &[Calibration, Convergence, Residuals, Jacobian, Laboratory, Comparison])
            };
            let above = split(tiles, Horizontal, [image, scene], 0.5);
            (split(tiles, Vertical, [above, plots], 0.54), split(tiles, Vertical, [rank, inspector], 0.56))
        }
        Preset::Calibration => {
            let convergence = tabs(tiles, &[Convergence, Calibration, Comparison]);
            let residuals = tabs(tiles, &[Residuals, Jacobian, Laboratory]);
            let images = split(tiles, Horizontal, [image, scene], 0.5);
            let below = split(tiles, Horizontal, [images, residuals], 0.66);
            (split(tiles, Vertical, [convergence, below], 0.62), split(tiles, Vertical, [rank, inspector], 0.68))
        }
        Preset::FrontEnd => {
            let convergence = tabs(tiles, &[Convergence, Calibration, Comparison]);
            let residuals = tabs(tiles, &[Residuals, Jacobian, Laboratory]);
            let above = split(tiles, Horizontal, [image, residuals], 0.6);
            let below = split(tiles, Horizontal, [convergence, scene], 0.7);
            (split(tiles, Vertical, [above, below], 0.64), split(tiles, Vertical, [inspector, rank], 0.42))
        }
        Preset::Scene => {
            let plots = tabs(tiles, &[Calibration, Convergence, Residuals, Jacobian, Laboratory, Comparison]);
            let below = split(tiles, Horizontal, [image, plots], 0.32);
            (split(tiles, Vertical, [scene, below], 0.68), split(tiles, Vertical, [inspector, rank], 0.42))
        }
    };
    let root = split(tiles, Horizontal, [left, right], 0.745);
    Tree::new(egui::Id::unique(("panels", preset.name())), root, all)
}

pub(super) fn tabs(tiles: &mut Tiles<PanelName>, panes: &[PanelName]) -> TileId {
    let children = panes.iter().map(|pane| tiles.insert_pane(*pane)).collect();
    tiles.insert_tab_tile(children)
}

/// Two tiles side by side or one above the other; the first takes `fraction` of the space.
pub(super) fn split(
    tiles: &mut Tiles<PanelName>,
    direction: LinearDir,
    children: [TileId; 2],
    fraction: f32,
) -> TileId {
    tiles.insert_container(Container::Linear(Linear::new_binary(direction, children, fraction)))
}
