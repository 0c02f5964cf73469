//! Plots of the differences of each run from the reference over time.

use egui::{Align2, Rect, ScrollArea, Shape, Stroke, Ui, pos2, vec2};

use super::numbers::{difference_text, shown};
use crate::gui::PanelContext;
use crate::gui::plot::{
    Clicks, Curve, PlotArea, navigate, paint_cursor, paint_curve, paint_ground, paint_steps, paint_value_grid,
    visible_range,
};
use crate::gui::theme::{self, CURVE_WIDTH};
use crate::session::{Comparison, Quantity};

/// Range of the row height in points.
const HEIGHTS: std::ops::RangeInclusive<f32> = 46.0..=120.0;
/// Width of names and values on the left.
const NAMES: f32 = 150.0;

/// The plotted quantities.
const DRAWN: [Quantity; 8] = [
    Quantity::Position,
    Quantity::Attitude,
    Quantity::Velocity,
    Quantity::ChainTranslation,
    Quantity::ChainRotation,
    Quantity::JointAngles,
    Quantity::Reprojection,
    Quantity::RankInformed,
];

/// Curves by plotted quantity and run.
#[derive(Debug, Default)]
pub(super) struct OverTime {
    curves: [Vec<Curve>; DRAWN.len()],
}

impl OverTime {
    /// Draws a row for every quantity that some run has.
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, reference: usize, comparisons: &[Comparison]) {
        let known = |quantity: Quantity| {
            comparisons.iter().enumerate().any(|(run, comparison)| {
                run != reference && comparison.column(quantity).iter().any(|apart| apart.is_finite())
            })
        };
        let rows: Vec<(usize, Quantity)> = DRAWN.into_iter().enumerate().filter(|(_, it)| known(*it)).collect();
        if rows.is_empty() {
            super::empty_ui(ui, "No common estimated frames");
            return;
        }
        let height = (ui.available_height() / rows.len() as f32 - 3.0).clamp(*HEIGHTS.start(), *HEIGHTS.end());
        ScrollArea::vertical().id_salt("difference rows").auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 3.0;
            for (index, quantity) in rows {
                self.row_ui(ui, ctx, reference, comparisons, (index, quantity), height);
            }
        });
    }

    fn row_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        reference: usize,
        comparisons: &[Comparison],
        (index, quantity): (usize, Quantity),
        height: f32,
    ) {
        let theme = *ctx.theme;
        let (_, whole) = ui.allocate_space(vec2(ui.available_width(), height));
        let rect = Rect::from_min_max(pos2(whole.left() + NAMES.min(0.4 * whole.width()), whole.top()), whole.max);
        let (begin_ns, end_ns) = visible_range(ctx);
        let mut area = PlotArea { rect, begin_ns, end_ns, low: 0.0, high: 1.0 };
        let curves = &mut self.curves[index];
        curves.resize_with(comparisons.len(), Curve::default);
        let mut max_value = 0.0_f64;
        for (comparison, curve) in comparisons.iter().zip(curves.iter_mut()) {
            curve.update(&area, comparison.epoch, &comparison.stamps_ns, comparison.column(quantity));
            max_value = max_value.max(curve.extent.map_or(0.0, |(_, max_value)| max_value));
        }
        // Rounding errors are not magnified to the height of the plot.
        area = area.with_values(0.0, 1.15 * max_value.max(0.1 * quantity.notable()));
        let painter = ui.painter_at(whole);
        paint_ground(&painter, &theme, rect);
        let (factor, unit) = shown(quantity);
        paint_value_grid(&painter, &theme, &area, factor, (height / 22.0) as usize);
        let notable = area.y(quantity.notable());
        if rect.y_range().contains(notable) {
            let dots = Shape::dotted_line(
                &[pos2(rect.left(), notable), pos2(rect.right(), notable)],
                theme.warn.gamma_multiply(0.7),
                6.0,
                0.7,
            );
            painter.extend(dots);
        }
        let name = if unit.is_empty() { quantity.name().to_owned() } else { format!("{}, {unit}", quantity.name()) };
        let mut line = whole.left_top();
        painter.text(line, Align2::LEFT_TOP, name, theme::label_font(), theme.text);
        for (run, (comparison, curve)) in comparisons.iter().zip(curves.iter()).enumerate() {
            if run == reference {
                continue;
            }
            let style = theme.run(run);
            if quantity.unit().is_empty() {
                paint_steps(&painter.with_clip_rect(rect), &area, curve, style, CURVE_WIDTH);
            } else {
                paint_curve(&painter.with_clip_rect(rect), &area, curve, style, CURVE_WIDTH);
            }
            if let Some(stamp_ns) = comparison.divergence(quantity).notable_ns {
                let x = area.x(stamp_ns);
                if rect.x_range().contains(x) {
                    let foot = vec![pos2(x - 4.0, rect.top()), pos2(x + 4.0, rect.top()), pos2(x, rect.top() + 7.0)];
                    painter.add(Shape::convex_polygon(foot, style.color, Stroke::NONE));
                }
            }
            if let Some(apart) = comparison.at(quantity, ctx.cursor_ns) {
                line.y += 13.0;
                let label = ctx.recording.runs.get(run).map_or("", |run| run.spec.label.as_str());
                let text = format!("{} {label}", difference_text(quantity, apart));
                painter.with_clip_rect(whole.with_max_x(rect.left() - 4.0)).text(
                    line,
                    Align2::LEFT_TOP,
                    text,
                    theme::label_font(),
                    style.color,
                );
            }
        }
        paint_cursor(&painter, &theme, &area, ctx.cursor_ns);
        let id = ui.unique_id().with(("difference", index));
        let name = format!("Difference in {} over time", quantity.name());
        let response = navigate(ui, ctx, &area, id, &name, Clicks::Seek, false);
        let threshold = difference_text(quantity, quantity.notable());
        response.on_hover_text(format!("{}\nTriangle: first difference ≥ {threshold}", quantity.meaning()));
    }
}
