//! Plots of the differences of each run from the reference over time.

use egui::containers::scroll_area::ScrollAreaOutput;
use egui::{ScrollArea, Ui};

use super::columns::label_of;
use super::numbers::{difference_text, shown};
use super::row::{Line, LineCurves, MIN_HEIGHT, Row, row_ui};
use crate::gui::PanelContext;
use crate::session::{ComparedQuantity, Comparison};
use crate::text::Named as _;

/// Range of the row height in points.
const HEIGHTS: std::ops::RangeInclusive<f32> = MIN_HEIGHT..=120.0;

const DRAWN: [ComparedQuantity; 8] = [
    ComparedQuantity::Position,
    ComparedQuantity::Attitude,
    ComparedQuantity::Velocity,
    ComparedQuantity::ChainTranslation,
    ComparedQuantity::ChainRotation,
    ComparedQuantity::JointAngles,
    ComparedQuantity::Reprojection,
    ComparedQuantity::RankInformed,
];

/// Curves by plotted quantity and run.
#[derive(Debug, Default)]
pub(super) struct OverTime {
    curves: [Vec<LineCurves>; DRAWN.len()],
}

impl OverTime {
    /// Draws a row for every quantity that at least one run has; `None` without one.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        reference: usize,
        comparisons: &[Comparison],
    ) -> Option<ScrollAreaOutput<()>> {
        let known = |quantity: ComparedQuantity| {
            comparisons.iter().enumerate().any(|(run, comparison)| {
                run != reference && comparison.column(quantity).iter().any(|apart| apart.is_finite())
            })
        };
        let rows: Vec<(usize, ComparedQuantity)> = DRAWN.into_iter().enumerate().filter(|(_, it)| known(*it)).collect();
        if rows.is_empty() {
            super::empty_ui(ui, "No common estimated frames");
            return None;
        }
        let height = (ui.available_height() / rows.len() as f32 - 3.0).clamp(*HEIGHTS.start(), *HEIGHTS.end());
        let shown = ScrollArea::vertical().id_salt("difference rows").auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 3.0;
            for (index, quantity) in rows {
                self.row_ui(ui, ctx, reference, comparisons, (index, quantity), height);
            }
        });
        Some(shown)
    }

    fn row_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        reference: usize,
        comparisons: &[Comparison],
        (index, quantity): (usize, ComparedQuantity),
        height: f32,
    ) {
        let curves = &mut self.curves[index];
        curves.resize_with(comparisons.len(), LineCurves::default);
        let lines: Vec<Line<'_>> = comparisons
            .iter()
            .enumerate()
            .map(|(run, comparison)| {
                let apart = comparison.at(quantity, ctx.cursor_ns).filter(|_| run != reference);
                let label = label_of(ctx.recording, run);
                Line {
                    run,
                    epoch: comparison.epoch,
                    stamps_ns: &comparison.stamps_ns,
                    values: if run == reference { &[] } else { comparison.column(quantity) },
                    bound: &[],
                    text: apart.map(|apart| format!("{} {label}", difference_text(quantity, apart))),
                    mark_ns: comparison.divergence(quantity).notable_ns.filter(|_| run != reference),
                }
            })
            .collect();
        let (factor, unit) = shown(quantity);
        let threshold = difference_text(quantity, quantity.notable());
        let row = Row {
            name: quantity.name(),
            unit,
            factor,
            threshold: Some(quantity.notable()),
            min_high: 0.1 * quantity.notable(),
            steps: quantity.unit().is_empty(),
            id: index,
            label: &format!("Difference in {} over time", quantity.name()),
            hover: &format!("{}\nTriangle: first difference ≥ {threshold}", quantity.meaning()),
        };
        row_ui(ui, ctx, &row, &lines, curves, height);
    }
}
