//! Panels by name, and their state.

use egui::Ui;
use serde::{Deserialize, Serialize};

use crate::gui::PanelContext;
use crate::gui::breakpoints::BreakpointsPanel;
use crate::gui::comparison::ComparisonPanel;
use crate::gui::convergence::ConvergencePanel;
use crate::gui::csv_table::CsvTable;
use crate::gui::image_panel::ImagePanel;
use crate::gui::inspector::InspectorPanel;
use crate::gui::jacobian::JacobianPanel;
use crate::gui::laboratory::LaboratoryPanel;
use crate::gui::rank::RankPanel;
use crate::gui::residuals::ResidualsPanel;
use crate::gui::scene::ScenePanel;
use crate::gui::timeline::TimelinePanel;

/// A panel by its name on the command line, in file names and in saved layouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
pub enum PanelName {
    Image,
    Scene,
    /// Calibration over time.
    Convergence,
    /// Rank and null directions.
    Rank,
    /// The linearization by blocks.
    Jacobian,
    /// Residuals as a histogram, over time and by factor.
    Residuals,
    /// Values of the selection.
    Inspector,
    /// Observability of a mechanism and a motion without a log.
    Laboratory,
    /// Comparison of all runs.
    Comparison,
    /// Breakpoints and their hits.
    Breakpoints,
    /// The timeline at the bottom of the window.
    Timeline,
}

impl PanelName {
    pub const ALL: [Self; 11] = [
        Self::Image,
        Self::Scene,
        Self::Convergence,
        Self::Rank,
        Self::Jacobian,
        Self::Residuals,
        Self::Inspector,
        Self::Laboratory,
        Self::Comparison,
        Self::Breakpoints,
        Self::Timeline,
    ];

    /// The panels that can be moved and hidden: all but the timeline.
    pub fn movable() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|panel| *panel != Self::Timeline)
    }

    /// Name on the command line, and title.
    const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Image => ("image", "Image"),
            Self::Scene => ("scene", "Scene"),
            Self::Convergence => ("convergence", "Convergence"),
            Self::Rank => ("rank", "Rank"),
            Self::Jacobian => ("jacobian", "Jacobian"),
            Self::Residuals => ("residuals", "Residuals"),
            Self::Inspector => ("inspector", "Inspector"),
            Self::Laboratory => ("laboratory", "Laboratory"),
            Self::Comparison => ("comparison", "Comparison"),
            Self::Breakpoints => ("breakpoints", "Breakpoints"),
            Self::Timeline => ("timeline", "Timeline"),
        }
    }

    /// Name on the command line.
    pub const fn as_str(self) -> &'static str {
        self.names().0
    }

    /// Anchor of the panel's section in the manual.
    pub(crate) const fn section(self) -> &'static str {
        self.as_str()
    }

    /// Title in the window.
    pub const fn title(self) -> &'static str {
        self.names().1
    }
}

#[derive(Default)]
pub struct Panels {
    pub image: ImagePanel,
    pub scene: ScenePanel,
    pub convergence: ConvergencePanel,
    pub rank: RankPanel,
    pub jacobian: JacobianPanel,
    pub residuals: ResidualsPanel,
    pub inspector: InspectorPanel,
    pub laboratory: LaboratoryPanel,
    pub comparison: ComparisonPanel,
    pub breakpoints: BreakpointsPanel,
    pub timeline: TimelinePanel,
}

impl Panels {
    /// Panels with the same view, without textures of a window.
    pub(super) fn views(&self) -> Self {
        Self {
            image: self.image.view_copy(),
            scene: self.scene.view_copy(),
            laboratory: self.laboratory.view_copy(),
            comparison: self.comparison.view_copy(),
            ..Self::default()
        }
    }

    /// Draws a panel into the available space of `ui`.
    pub(super) fn ui(&mut self, panel: PanelName, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        match panel {
            PanelName::Image => self.image.ui(ui, ctx),
            PanelName::Scene => self.scene.ui(ui, ctx),
            PanelName::Convergence => self.convergence.ui(ui, ctx),
            PanelName::Rank => self.rank.ui(ui, ctx),
            PanelName::Jacobian => self.jacobian.ui(ui, ctx),
            PanelName::Residuals => self.residuals.ui(ui, ctx),
            PanelName::Inspector => self.inspector.ui(ui, ctx),
            PanelName::Laboratory => self.laboratory.ui(ui, ctx),
            PanelName::Comparison => self.comparison.ui(ui, ctx),
            PanelName::Breakpoints => self.breakpoints.ui(ui, ctx),
            PanelName::Timeline => self.timeline.ui(ui, ctx),
        }
    }

    /// Values of a panel as a CSV table; empty without a run.
    pub(super) fn csv_table(&mut self, panel: PanelName, ctx: &PanelContext<'_>) -> String {
        if ctx.selected_run().is_none() {
            return String::new();
        }
        let source: &mut dyn CsvTable = match panel {
            PanelName::Image => &mut self.image,
            PanelName::Scene => &mut self.scene,
            PanelName::Convergence => &mut self.convergence,
            PanelName::Rank => &mut self.rank,
            PanelName::Jacobian => &mut self.jacobian,
            PanelName::Residuals => &mut self.residuals,
            PanelName::Inspector => &mut self.inspector,
            PanelName::Laboratory => &mut self.laboratory,
            PanelName::Comparison => &mut self.comparison,
            PanelName::Breakpoints => &mut self.breakpoints,
            PanelName::Timeline => &mut self.timeline,
        };
        source.csv_table(ctx)
    }
}
