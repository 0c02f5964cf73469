//! State of all panels.

use crate::gui::breakpoints::BreakpointsPanel;
use crate::gui::comparison::ComparisonPanel;
use crate::gui::convergence::ConvergencePanel;
use crate::gui::image_panel::ImagePanel;
use crate::gui::inspector::InspectorPanel;
use crate::gui::jacobian::JacobianPanel;
use crate::gui::laboratory::LaboratoryPanel;
use crate::gui::rank::RankPanel;
use crate::gui::residuals::ResidualsPanel;
use crate::gui::scene::ScenePanel;
use crate::gui::timeline::TimelinePanel;
use crate::gui::{Panel, PanelContext, PanelName};

/// The state of all panels.
#[derive(Default)]
pub struct Panels {
    /// State of the camera's image.
    pub image: ImagePanel,
    /// State of the 3D scene.
    pub scene: ScenePanel,
    /// State of the calibration over time.
    pub convergence: ConvergencePanel,
    /// State of rank and null directions.
    pub rank: RankPanel,
    /// State of the linearization by blocks.
    pub jacobian: JacobianPanel,
    /// State of the residuals.
    pub residuals: ResidualsPanel,
    /// State of the inspector.
    pub inspector: InspectorPanel,
    /// State of the laboratory.
    pub laboratory: LaboratoryPanel,
    /// State of the comparison of runs.
    pub comparison: ComparisonPanel,
    /// State of the breakpoints.
    pub breakpoints: BreakpointsPanel,
    /// State of the timeline.
    pub timeline: TimelinePanel,
}

impl Panels {
    /// Panels with the same view and no texture of a window.
    pub(super) fn views(&self) -> Self {
        Self {
            image: self.image.view_copy(),
            scene: self.scene.view_copy(),
            convergence: self.convergence.view_copy(),
            rank: self.rank.view_copy(),
            jacobian: self.jacobian.view_copy(),
            residuals: self.residuals.view_copy(),
            inspector: self.inspector.view_copy(),
            laboratory: self.laboratory.view_copy(),
            comparison: self.comparison.view_copy(),
            breakpoints: self.breakpoints.view_copy(),
            timeline: self.timeline.view_copy(),
        }
    }

    /// A panel by name.
    pub(super) fn get(&mut self, panel: PanelName) -> &mut dyn Panel {
        match panel {
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
        }
    }

    /// The values of a panel as a CSV table, empty without a run.
    pub(super) fn csv_table(&mut self, panel: PanelName, ctx: &PanelContext<'_>) -> String {
        if ctx.selected_run().is_none() { String::new() } else { self.get(panel).csv_table(ctx) }
    }
}
