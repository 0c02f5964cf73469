//! The convergence panel: one small plot per calibration parameter, along the chain.

mod layout;
mod model;
pub(crate) mod names;
mod paint;

use std::collections::BTreeMap;

use egui::{Rect, RichText, ScrollArea, Ui, vec2};

use self::model::CalibrationHistory;
pub(crate) use self::model::{Knowledge, knowledge};
use super::PanelContext;
use super::plot::Curve;

/// The curves of one parameter of one run.
#[derive(Debug, Default)]
struct ParameterCurves {
    value: Curve,
    lower: Curve,
    upper: Curve,
}

/// State of the convergence panel.
#[derive(Debug, Default)]
pub struct ConvergencePanel {
    histories: Vec<CalibrationHistory>,
    /// By run and parameter name.
    curves: BTreeMap<(usize, String), ParameterCurves>,
}

impl ConvergencePanel {
    /// Draws the panel.
    pub fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        self.histories.resize_with(ctx.recording.runs.len(), CalibrationHistory::default);
        for (history, run) in self.histories.iter_mut().zip(&ctx.recording.runs) {
            history.read(run);
        }
        let runs = self.histories.len();
        self.curves.retain(|(run, _), _| *run < runs);

        let shown = ctx.selection.run.min(self.histories.len().saturating_sub(1));
        let Some(history) = self.histories.get(shown) else {
            empty_ui(ui, "No run yet");
            return;
        };
        if history.stamps_ns.is_empty() {
            empty_ui(ui, "Waiting for the first step");
            return;
        }
        // Only what the chart in use at the cursor estimates: after a switch the old chart's names are gone.
        let row = history.row_at(ctx.cursor_ns).unwrap_or(0);
        let mut names: Vec<String> = history
            .parameters
            .iter()
            .filter(|(_, parameter)| parameter.values[row].is_finite())
            .map(|(name, _)| name.clone())
            .collect();
        if names.is_empty() {
            let label = &ctx.recording.runs[shown].spec.label;
            empty_ui(ui, &format!("Run {label} estimates no calibration"));
            return;
        }
        names.sort_by_key(|name| names::part_of(name));

        let available = ui.available_rect_before_wrap();
        let layout = layout::lay_out(&names, available);
        if layout.height > available.height() + 1.0 {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                let top = ui.available_rect_before_wrap().min;
                let narrow = Rect::from_min_size(top, vec2(available.width() - 10.0, available.height()));
                let layout = layout::lay_out(&names, narrow);
                ui.allocate_space(vec2(1.0, layout.height));
                self.cells_ui(ui, ctx, shown, &names, &layout);
            });
        } else {
            self.cells_ui(ui, ctx, shown, &names, &layout);
        }
    }

    fn cells_ui(
        &mut self,
        ui: &Ui,
        ctx: &mut PanelContext<'_>,
        shown: usize,
        names: &[String],
        layout: &layout::Layout,
    ) {
        for (part, rect) in &layout.headings {
            paint::heading(ui, ctx, *part, *rect);
        }
        for (name, rect) in names.iter().zip(&layout.cells) {
            if ui.is_rect_visible(*rect) {
                paint::cell_ui(ui, ctx, &self.histories, &mut self.curves, shown, name, *rect);
            }
        }
    }
}

/// A panel that has nothing to show says why.
pub(crate) fn empty_ui(ui: &mut Ui, why: &str) {
    ui.centered_and_justified(|ui| ui.label(RichText::new(why).weak()));
}
