//! Groups of the rows of a heat map: names at their left and lines between them.

use egui::epaint::TextShape;
use egui::{Painter, Rangef, Stroke, pos2};

use crate::gimbal::{ParameterGroup, ParameterId};
use crate::gui::theme::{Theme, label_font};
use crate::text::Named as _;

/// Width of the names of groups in points.
const STRIP_WIDTH: f32 = 15.0;

/// Width in points of the group names; 0 if all parameters are of one group.
pub(super) fn strip_width(parameters: &[ParameterId]) -> f32 {
    let several = parameters.windows(2).any(|pair| pair[0].group() != pair[1].group());
    if several { STRIP_WIDTH } else { 0.0 }
}

/// Paints the name of each group upwards at the left end of its rows if it fits, and lines between groups; `rows` are
/// in order from top to bottom.
pub(super) fn paint_groups(painter: &Painter, theme: &Theme, rows: &[(ParameterGroup, Rangef)], across: Rangef) {
    for (number, chunk) in rows.chunk_by(|(a, _), (b, _)| a == b).enumerate() {
        let [(group, first), .., (_, last)] = chunk else {
            // A name rarely fits into a single row; only the line is drawn.
            separator(painter, theme, number, chunk.first().map_or(0.0, |(_, row)| row.min), across);
            continue;
        };
        separator(painter, theme, number, first.min, across);
        let range = Rangef::new(first.min, last.max);
        let galley = painter.layout_no_wrap(group.name().to_owned(), label_font(), theme.text_weak);
        if galley.size().x <= range.span() {
            let foot =
                pos2(across.min + 0.5 * (STRIP_WIDTH - galley.size().y) - 1.0, range.center() + 0.5 * galley.size().x);
            painter.add(TextShape::new(foot, galley, theme.text_weak).with_angle(-std::f32::consts::FRAC_PI_2));
        }
    }
}

fn separator(painter: &Painter, theme: &Theme, number: usize, y: f32, across: Rangef) {
    if number > 0 {
        painter.hline(across, y, Stroke::new(1.0, theme.text_weak));
    }
}
