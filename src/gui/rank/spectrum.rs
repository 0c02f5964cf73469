//! Singular values on a logarithmic axis with both thresholds.

use egui::{Align2, Rect, Role, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use crate::gimbal::ParameterNames;
use crate::gui::plot::{GridLine, ValueAxis, ValuePlot, paint_ground};
use crate::gui::theme::{Theme, label_font};
use crate::gui::units::significant;
use crate::gui::widgets::{describe, plated_text};
use crate::observability::{RankReport, parameters_of};

/// Draws the spectrum in `height` points.
pub(super) fn ui(ui: &mut Ui, theme: &Theme, names: &ParameterNames, rank: &RankReport, height: f32) {
    let (_, rect) = ui.allocate_space(vec2(ui.available_width(), height));
    paint(ui, theme, names, rank, &[rank], rect, 0);
}

/// Draws the spectrum into a rectangle, on an axis common to all `peers`; `number` makes its id unique.
pub(super) fn paint(
    ui: &Ui,
    theme: &Theme,
    names: &ParameterNames,
    rank: &RankReport,
    peers: &[&RankReport],
    rect: Rect,
    number: usize,
) {
    let painter = ui.painter_at(rect);
    paint_ground(&painter, theme, rect);
    let plot = Rect::from_min_max(rect.min + vec2(36.0, 3.0), rect.max - vec2(4.0, 3.0));
    let Some(y) = axis_of(peers).filter(|_| !rank.singular_values.is_empty()) else { return };
    let x = ValueAxis { logarithmic: false, low: -0.5, high: rank.singular_values.len() as f64 - 0.5 };
    let axes = ValuePlot { rect: plot, x, y };
    // Every third power of ten has a grid line.
    let powers = y.decades().filter(|(power, digit)| *digit == 1.0 && power.rem_euclid(3) == 0);
    let line = |(power, _)| GridLine { value: 10_f64.powi(power), color: theme.grid, label: format!("1e{power}") };
    axes.paint_rows(&painter, theme, 3.0, powers.map(line));

    let y_of = |value: f64| axes.at_or_edge(0.0, value).y.min(plot.bottom());
    let pitch = plot.width() / rank.singular_values.len() as f32;
    let width = (pitch * 0.62).clamp(2.0, 22.0);
    for (index, value) in rank.singular_values.iter().enumerate() {
        let x = plot.left() + (index as f32 + 0.5) * pitch;
        let color = if *value <= rank.structural_threshold {
            theme.error
        } else if *value < rank.informed_threshold {
            theme.warn
        } else {
            theme.ok
        };
        let bar = Rect::from_min_max(pos2(x - width / 2.0, y_of(*value)), pos2(x + width / 2.0, plot.bottom()));
        if *value <= rank.structural_threshold {
            // A zero has no position on the axis; an open box at the bottom represents it.
            let zero = Rect::from_min_max(pos2(bar.left(), plot.bottom() - 5.0), bar.max);
            painter.rect_stroke(zero, 0.0, Stroke::new(1.0, color), StrokeKind::Inside);
        } else {
            painter.rect_filled(bar, 0.0, color.gamma_multiply(0.85));
        }
        if let Some(with_priors) = rank.singular_values_with_priors.get(index) {
            painter.hline(bar.x_range().expand(1.0), y_of(*with_priors), Stroke::new(1.5, theme.text));
        }
    }
    threshold(&painter, theme, plot, y_of(rank.informed_threshold), "informed");
    threshold(&painter, theme, plot, y_of(rank.structural_threshold), "structural");

    let response = ui.interact(rect, ui.unique_id().with(("spectrum", number)), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Singular values"));
    describe(&response, &ranks_text(rank));
    if let Some(pointer) = response.hover_pos() {
        let index = ((pointer.x - plot.left()) / pitch) as usize;
        if let Some(value) = rank.singular_values.get(index).filter(|_| plot.x_range().contains(pointer.x)) {
            let mut lines =
                vec![format!("singular value {}: {} (1: σ of 10° or 3 cm)", index + 1, significant(*value))];
            if let Some(with_priors) = rank.singular_values_with_priors.get(index) {
                lines.push(format!("with priors: {}", significant(*with_priors)));
            }
            // Directions start with the least observable one, singular values with the largest.
            let direction = (rank.singular_values.len() - 1).checked_sub(index).and_then(|d| rank.directions.get(d));
            if let Some(direction) = direction {
                lines.push(parameters_of(names, &rank.parameters, direction, 4));
            }
            response.on_hover_text_at_pointer(lines.join("\n"));
        }
    }
}

fn threshold(painter: &egui::Painter, theme: &Theme, plot: Rect, y: f32, name: &str) {
    let points = [pos2(plot.left(), y), pos2(plot.right(), y)];
    painter.extend(egui::Shape::dashed_line(&points, Stroke::new(1.0, theme.text_strong), 4.0, 3.0));
    let galley = painter.layout_no_wrap(name.to_owned(), label_font(), theme.text_strong);
    let plate = (theme.plot_background.gamma_multiply(0.8), vec2(2.0, -1.0));
    let at = pos2(plot.right() - galley.size().x - 2.0, y);
    plated_text(painter, at, Align2::LEFT_BOTTOM, (galley, theme.text_strong), plate);
}

/// Logarithmic axis that contains the spectra of all reports.
fn axis_of(reports: &[&RankReport]) -> Option<ValueAxis> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for rank in reports.iter().filter(|rank| !rank.singular_values.is_empty()) {
        let largest = rank.singular_values.iter().chain(&rank.singular_values_with_priors).copied();
        let largest = largest.filter(|value| value.is_finite()).fold(rank.informed_threshold, f64::max);
        let smallest = if rank.structural_threshold > 0.0 { rank.structural_threshold } else { largest * 1e-12 };
        (low, high) = (low.min(smallest * 10_f64.powf(-1.2)), high.max(largest * 10_f64.powf(0.6)));
    }
    (low > 0.0 && low < high && high.is_finite()).then_some(ValueAxis { logarithmic: true, low, high })
}

/// Both ranks in words.
pub(super) fn ranks_text(rank: &RankReport) -> String {
    let count = rank.parameters.len();
    format!("structural rank {} of {count}, informed rank {} of {count}", rank.rank_structural, rank.rank_informed)
}
