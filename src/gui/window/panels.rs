//! State of all panels.

use crate::gui::breakpoints::BreakpointsPanel;
use crate::gui::calibration::CalibrationPanel;
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

#[derive(Default)]
pub struct Panels {
    pub image: ImagePanel,
    pub scene: ScenePanel,
    pub calibration: CalibrationPanel,
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
            calibration: self.calibration.view_copy(),
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

    /// Drops the textures before the panels are drawn by another context: textures belong to the one that made them.
    pub(super) fn drop_textures(&mut self) {
        *self = self.views();
    }

    pub(super) fn get(&mut self, panel: PanelName) -> &mut dyn Panel {
        match panel {
            PanelName::Image => &mut self.image,
            PanelName::Scene => &mut self.scene,
            PanelName::Calibration => &mut self.calibration,
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

    /// Values of a panel as a CSV table; empty without a run.
    pub(super) fn csv_table(&mut self, panel: PanelName, ctx: &PanelContext<'_>) -> String {
        if ctx.selected_run().is_none() { String::new() } else { self.get(panel).csv_table(ctx) }
    }
}
