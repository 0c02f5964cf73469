//! Plots of values against values: a linear or logarithmic axis on each side.

use egui::{Align2, Color32, Mesh, Painter, Pos2, Rect, Shape, Stroke, pos2};

use super::axis::ValueAxis;
use crate::gui::theme::{HAIRLINE_WIDTH, Theme, number_font};

/// The rectangle of a plot with its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ValuePlot {
    /// Screen rectangle in points.
    pub(crate) rect: Rect,
    pub(crate) x: ValueAxis,
    pub(crate) y: ValueAxis,
}

/// Grid line of an axis, with its label; without one the label is empty.
pub(crate) struct GridLine {
    pub(crate) value: f64,
    pub(crate) color: Color32,
    pub(crate) label: String,
}

impl ValuePlot {
    /// Screen position of a pair of values, outside the rectangle for values outside the axes.
    pub(crate) fn at(&self, x: f64, y: f64) -> Pos2 {
        pos2(
            self.rect.left() + self.x.fraction(x) as f32 * self.rect.width(),
            self.rect.bottom() - self.y.fraction(y) as f32 * self.rect.height(),
        )
    }

    /// Screen position of a pair of values; values outside the axes are at the nearer edge.
    pub(crate) fn at_or_edge(&self, x: f64, y: f64) -> Pos2 {
        pos2(
            self.rect.left() + self.x.position(x) as f32 * self.rect.width(),
            self.rect.bottom() - self.y.position(y) as f32 * self.rect.height(),
        )
    }

    /// Draws vertical grid lines with their labels `gap` points below the plot.
    pub(crate) fn paint_columns(
        &self,
        painter: &Painter,
        theme: &Theme,
        gap: f32,
        lines: impl IntoIterator<Item = GridLine>,
    ) {
        for line in lines {
            let x = self.at(line.value, self.y.low).x;
            painter.vline(x, self.rect.y_range(), Stroke::new(HAIRLINE_WIDTH, line.color));
            if !line.label.is_empty() {
                let at = pos2(x, self.rect.bottom() + gap);
                painter.text(at, Align2::CENTER_TOP, line.label, number_font(), theme.text_weak);
            }
        }
    }

    /// Draws horizontal grid lines with their labels `gap` points to the left of the plot.
    pub(crate) fn paint_rows(
        &self,
        painter: &Painter,
        theme: &Theme,
        gap: f32,
        lines: impl IntoIterator<Item = GridLine>,
    ) {
        for line in lines {
            let y = self.at(self.x.low, line.value).y;
            painter.hline(self.rect.x_range(), y, Stroke::new(HAIRLINE_WIDTH, line.color));
            if !line.label.is_empty() {
                let at = pos2(self.rect.left() - gap, y);
                painter.text(at, Align2::RIGHT_CENTER, line.label, number_font(), theme.text_weak);
            }
        }
    }
}

impl ValueAxis {
    /// Grid lines at the values of [`ValueAxis::decades`]; the powers of ten are stronger. `label` gets power, digit and
    /// value.
    pub(crate) fn decade_lines(
        self,
        theme: &Theme,
        label: impl Fn(i32, f64, f64) -> String,
    ) -> impl Iterator<Item = GridLine> {
        let colors = [theme.hatch, theme.grid];
        self.decades().map(move |(power, digit)| {
            let value = digit * 10_f64.powi(power);
            GridLine { value, color: colors[usize::from(digit != 1.0)], label: label(power, digit, value) }
        })
    }
}

/// Draws the area between two lines, given as pairs of a lower and an upper point.
pub(crate) fn paint_between(painter: &Painter, pairs: impl IntoIterator<Item = [Pos2; 2]>, fill: Color32) {
    let mut mesh = Mesh::default();
    for pos in pairs.into_iter().flatten() {
        mesh.colored_vertex(pos, fill);
    }
    for corner in (2..mesh.vertices.len() as u32).step_by(2) {
        mesh.add_triangle(corner - 2, corner - 1, corner);
        mesh.add_triangle(corner - 1, corner, corner + 1);
    }
    painter.add(Shape::mesh(mesh));
}
