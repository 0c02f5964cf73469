//! Texts and legends over the scene.

use egui::{Align2, Color32, Galley, Painter, Pos2, Rect, Stroke, Vec2, pos2, vec2};
use std::sync::Arc;

use super::camera::{SceneView, round_length};
use super::chain::{ChainModel, axis_colors};
use super::layout::ScreenLabel;
use crate::geometry::principal_angle;
use crate::gui::plot::paint_line;
use crate::gui::theme::{self, RunStyle, Theme};
use crate::gui::widgets::plated_text;

/// Height of one line of text.
pub(super) const LINE_HEIGHT: f32 = 15.0;

/// Positions of a label relative to its point, best first.
const SIDES: [(Align2, Vec2); 8] = [
    (Align2::LEFT_BOTTOM, vec2(5.0, -4.0)),
    (Align2::LEFT_TOP, vec2(5.0, 4.0)),
    (Align2::RIGHT_BOTTOM, vec2(-5.0, -4.0)),
    (Align2::RIGHT_TOP, vec2(-5.0, 4.0)),
    (Align2::CENTER_BOTTOM, vec2(0.0, -12.0)),
    (Align2::CENTER_TOP, vec2(0.0, 12.0)),
    (Align2::LEFT_CENTER, vec2(16.0, 0.0)),
    (Align2::RIGHT_CENTER, vec2(-16.0, 0.0)),
];

/// Writes labels without overlaps and inside `rect`; a label that does not fit is omitted.
pub(super) fn labels(painter: &Painter, rect: Rect, pixels_per_point: f32, labels: &[ScreenLabel], ground: Color32) {
    let mut taken: Vec<Rect> = Vec::new();
    for label in labels {
        let at = rect.min + vec2(label.x_px, label.y_px) / pixels_per_point;
        let galley = painter.layout_no_wrap(label.text.clone(), theme::label_font(), label.color);
        let place = SIDES
            .iter()
            .map(|(align, offset)| align.anchor_size(at + *offset, galley.size()))
            .find(|place| rect.contains_rect(*place) && taken.iter().all(|other| !other.intersects(place.expand(1.0))));
        if let Some(place) = place {
            plated(painter, place.min, galley, label.color, ground);
            taken.push(place);
        }
    }
}

/// A text on a translucent background.
fn plated(painter: &Painter, at: Pos2, galley: Arc<Galley>, color: Color32, ground: Color32) {
    plated_text(painter, at, Align2::LEFT_TOP, (galley, color), (ground.gamma_multiply(0.8), vec2(2.0, -1.0)));
}

/// A line of the legend: style and name.
pub(super) struct LegendLine {
    pub(super) style: RunStyle,
    pub(super) text: String,
}

/// Fractions of the view's area and height from which a legend has names only.
const MAX_LEGEND_AREA: f32 = 0.2;
const MAX_LEGEND_HEIGHT: f32 = 0.5;
/// Size in points of a view below which it has no legend.
const MIN_SIZE_WITH_LEGEND: Vec2 = vec2(140.0, 100.0);

/// Draws the legend of the lines in the upper left corner, and below it the colour map of the landmarks. In a small
/// view the lines have names without values, and there is no colour map. Returns the height of the legend in points.
pub(super) fn legend(
    painter: &Painter,
    rect: Rect,
    theme: &Theme,
    lines: &[LegendLine],
    height_range_m: Option<(f64, f64)>,
) -> f32 {
    if rect.width() < MIN_SIZE_WITH_LEGEND.x || rect.height() < MIN_SIZE_WITH_LEGEND.y {
        return 0.0;
    }
    let mut at = rect.left_top() + vec2(8.0, 6.0);
    let ground = theme.plot_background;
    let width = |text: &str| painter.layout_no_wrap(text.to_owned(), theme::label_font(), theme.text).size().x;
    let size_of = |texts: &[&str]| {
        vec2(texts.iter().map(|text| width(text)).fold(0.0, f32::max) + 38.0, LINE_HEIGHT * texts.len() as f32)
    };
    let mut height_text =
        height_range_m.map(|(low_m, high_m)| format!("landmarks, height {low_m:.1} to {high_m:.1} m"));
    let mut texts: Vec<&str> = lines.iter().map(|line| line.text.as_str()).collect();
    let mut size = size_of(&texts.iter().copied().chain(height_text.as_deref()).collect::<Vec<_>>());
    if size.x * size.y > MAX_LEGEND_AREA * rect.area() || size.y > MAX_LEGEND_HEIGHT * rect.height() {
        // The values follow the name after a comma.
        for text in &mut texts {
            *text = text.split(", ").next().unwrap_or(text);
        }
        height_text = None;
        size = size_of(&texts);
    }
    painter.rect_filled(Rect::from_min_size(at, size).expand(4.0).intersect(rect), 3.0, ground.gamma_multiply(0.88));
    for (line, text) in lines.iter().zip(&texts) {
        let middle = at.y + 0.5 * LINE_HEIGHT;
        let sample = [pos2(at.x, middle), pos2(at.x + 28.0, middle)];
        if line.style.dashes.is_empty() {
            // Aligned to pixels, unlike a curve.
            painter.line_segment(sample, Stroke::new(2.0, line.style.color));
        } else {
            paint_line(painter, &sample, line.style, 2.0);
        }
        let galley = painter.layout_no_wrap((*text).to_owned(), theme::label_font(), theme.text);
        plated(painter, at + vec2(34.0, 0.0), galley, theme.text, ground);
        at.y += LINE_HEIGHT;
    }
    if let Some(text) = height_text {
        const STEPS: u16 = 14;
        for step in 0..STEPS {
            let slice = Rect::from_min_size(at + vec2(2.0 * f32::from(step), 4.0), vec2(2.0, 8.0));
            let color = theme.height_color((f64::from(step) + 0.5) / f64::from(STEPS));
            painter.rect_filled(slice, 0.0, color);
        }
        let galley = painter.layout_no_wrap(text, theme::label_font(), theme.text_weak);
        plated(painter, at + vec2(34.0, 0.0), galley, theme.text_weak, ground);
    }
    size.y
}

/// The text of a length: millimetres below 0.1 m.
fn length_text(length_m: f64) -> String {
    if length_m < 0.0995 { format!("{:.0} mm", length_m * 1e3) } else { format!("{length_m} m") }
}

/// Draws a bar of a round length, valid at the depth of the view's target, in the lower left corner.
pub(super) fn scale_bar(
    painter: &Painter,
    rect: Rect,
    pixels_per_point: f32,
    theme: &Theme,
    view: &SceneView,
    note: &str,
) {
    const WANTED_PX: f64 = 90.0;
    let metres_per_point = view.metres_per_px() * f64::from(pixels_per_point);
    let length_m = round_length(WANTED_PX * metres_per_point);
    let width = (length_m / metres_per_point) as f32;
    let left = rect.left_bottom() + vec2(8.0, -8.0);
    let right = left + vec2(width, 0.0);
    let stroke = Stroke::new(1.5, theme.text);
    let tick = vec2(0.0, -5.0);
    painter.line(vec![left + tick, left, right, right + tick], stroke);
    let text = format!("{}{note}", length_text(length_m));
    let galley = painter.layout_no_wrap(text, theme::label_font(), theme.text);
    plated(painter, left + vec2(4.0, -6.0 - galley.size().y), galley, theme.text, theme.plot_background);
}

/// Draws the directions of x, y, z as small axes in a corner.
pub(super) fn gizmo(painter: &Painter, centre: Pos2, theme: &Theme, view: &SceneView) {
    const REACH: f32 = 20.0;
    let camera = view.camera;
    let mut arms: Vec<(f64, Vec2, Color32, &str)> = [("x", 0), ("y", 1), ("z", 2)]
        .map(|(name, axis)| {
            let mut tip = camera.target_m;
            tip[axis] += 1.0;
            let in_view = view.in_view(&tip);
            let reach = vec2(in_view.x as f32, -in_view.y as f32) * REACH;
            (in_view.z, reach, axis_colors(theme)[axis], name)
        })
        .into();
    arms.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, reach, color, name) in arms {
        painter.line_segment([centre, centre + reach], Stroke::new(2.0, color));
        if reach.length() > 5.0 {
            let at = centre + reach + reach.normalized() * 7.0;
            painter.text(at, Align2::CENTER_CENTER, name, theme::label_font(), color);
        }
    }
}

/// Height of [`chain_table`] in points.
pub(super) fn chain_table_height(chain: &ChainModel) -> f32 {
    let rows = if chain.rows.is_empty() { 0 } else { chain.rows.len() + 1 };
    let footer = usize::from(chain.camera_error.is_some());
    (rows + footer) as f32 * LINE_HEIGHT + 6.0
}

/// Error of the camera's extrinsics, or the displacement of a moved camera.
pub(super) fn camera_error_text(chain: &ChainModel) -> Option<String> {
    let (distance_m, angle_rad) = chain.camera_error?;
    let what = if chain.moved { "camera moved by" } else { "extrinsics error:" };
    Some(format!("{what} {:.1} mm, {:.2}°", distance_m * 1e3, angle_rad.to_degrees()))
}

/// Table of the link values in degrees and millimetres.
pub(super) fn chain_table(painter: &Painter, rect: Rect, theme: &Theme, chain: &ChainModel) {
    let font = theme::number_font();
    let mut y = rect.top() + 2.0;
    // Right edges of the columns of numbers, as fractions of the width.
    const EDGES: [f32; 5] = [0.31, 0.51, 0.67, 0.82, 1.0];
    let inner = rect.shrink2(vec2(8.0, 0.0));
    let mut row = |cells: [String; 6], color: Color32| {
        let [name, numbers @ ..] = cells;
        let line = Rect::from_min_size(pos2(inner.left(), y), vec2(inner.width(), LINE_HEIGHT));
        painter.text(line.left_center(), Align2::LEFT_CENTER, name, font.clone(), color);
        for (number, edge) in numbers.into_iter().zip(EDGES) {
            let at = pos2(inner.left() + inner.width() * edge, line.center().y);
            painter.text(at, Align2::RIGHT_CENTER, number, font.clone(), color);
        }
        y += LINE_HEIGHT;
    };
    if !chain.rows.is_empty() {
        row(["joint", "q °", "θ₀ °", "d mm", "a mm", "α °"].map(str::to_owned), theme.text_weak);
    }
    for link in &chain.rows {
        let degrees = |angle_rad: f64, decimals: usize| {
            if angle_rad.is_finite() {
                format!("{:.decimals$}", principal_angle(angle_rad).to_degrees())
            } else {
                "–".to_owned()
            }
        };
        let millimetres = |length_m: f64| format!("{:.1}", length_m * 1e3);
        row(
            [
                link.joint.clone(),
                degrees(link.angle_rad, 1),
                degrees(link.theta_offset_rad, 2),
                millimetres(link.d_m),
                millimetres(link.a_m),
                degrees(link.alpha_rad, 2),
            ],
            theme.text,
        );
    }
    if let Some(text) = camera_error_text(chain) {
        let at = pos2(inner.left(), y + 0.5 * LINE_HEIGHT);
        painter.text(at, Align2::LEFT_CENTER, text, theme::label_font(), theme.text_strong);
    }
}
