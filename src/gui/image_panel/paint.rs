//! Painting of tracks, residuals and legend over an image.

use egui::{Align2, Color32, ColorImage, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2};
use nalgebra::Vector2;

use super::model::{FeatureMark, SolveSide};
use crate::gui::theme::{self, Theme, ThemeName};
use crate::gui::widgets::plated_text;
use crate::sensors::ImageMask;

/// Period of the hatch over masked pixels, in image pixels.
const HATCH_PX: usize = 12;
/// Age in frames of the last colour of the map.
const MAX_AGE: f64 = 100.0;
const LEGEND_AGES: [u32; 4] = [0, 10, 40, 100];
/// Maximum radius of the keypoint marker of a solved feature, in points.
const MARKER_RADIUS: f32 = 4.0;
/// Maximum radius of the keypoint marker in image pixels, so that markers do not hide a small image.
const MARKER_RADIUS_PX: f32 = 7.0;
/// Radius in points of a feature that is only tracked.
const DOT_RADIUS: f32 = 2.0;
/// Shadow below bright marks, for bright regions of the image.
const HALO: Color32 = Color32::from_black_alpha(150);
/// Glow below dark marks, for dark regions of the image.
const GLOW: Color32 = Color32::from_rgba_premultiplied(190, 190, 190, 190);

/// Rectangle of the image on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ImagePlacement {
    /// Rectangle of the whole image, which may be larger than the visible region.
    pub(super) rect: Rect,
    /// Width and height of the image in pixels.
    pub(super) size_px: [usize; 2],
}

impl ImagePlacement {
    /// Screen position of an image position; pixel centres have integer coordinates.
    pub(super) fn position(&self, uv_px: &Vector2<f64>) -> Pos2 {
        let fraction = |at: f64, size: usize| ((at + 0.5) / size.max(1) as f64) as f32;
        let [width, height] = self.size_px;
        self.rect.lerp_inside(vec2(fraction(uv_px.x, width), fraction(uv_px.y, height)))
    }

    /// Radius of the keypoint marker of a solved feature in points.
    pub(super) fn marker_radius(&self) -> f32 {
        (MARKER_RADIUS_PX * self.scale()).clamp(0.5 * MARKER_RADIUS, MARKER_RADIUS)
    }

    /// Points per image pixel.
    pub(super) fn scale(&self) -> f32 {
        self.rect.width() / self.size_px[0].max(1) as f32
    }
}

/// Marks drawn over the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gui) struct MarkOptions {
    /// Residuals before or after the solve.
    pub(in crate::gui) side: SolveSide,
    pub(super) magnification: f32,
    pub(super) residuals: bool,
    pub(super) trails: bool,
    pub(super) ids: bool,
    /// Tint the pixels that the mask of the camera covers.
    pub(super) mask: bool,
}

impl Default for MarkOptions {
    fn default() -> Self {
        Self { side: SolveSide::After, magnification: 20.0, residuals: true, trails: true, ids: false, mask: true }
    }
}

/// Colour of an age in frames: viridis over the square root, so that young tracks differ most.
pub(super) fn age_color(age: u32) -> Color32 {
    theme::viridis((f64::from(age) / MAX_AGE).sqrt())
}

/// Tints the masked pixels of an image: red throughout, with a darker diagonal hatch.
pub(super) fn tint(image: &mut ColorImage, mask: &ImageMask) {
    let [width, height] = image.size;
    for (index, pixel) in image.pixels.iter_mut().enumerate().take(width * height) {
        let (column, row) = (index % width, index / width);
        if mask.is_masked(column, row) {
            let hatched = (column + row) % HATCH_PX < HATCH_PX / 3;
            *pixel = pixel.lerp_to_gamma(ink().error, if hatched { 0.6 } else { 0.25 });
        }
    }
}

/// Colour below a mark.
fn halo_of(color: Color32) -> Color32 {
    let [red, green, blue, _] = color.to_array().map(u32::from);
    if 2 * red + 5 * green + blue < 900 { GLOW } else { HALO }
}

/// Theme of the overlay: the same in every theme, because the image is its background.
fn ink() -> Theme {
    Theme::of(ThemeName::Dark)
}

/// Draws one feature: trail, keypoint marker, residual, cross, id.
pub(super) fn feature(painter: &Painter, place: &ImagePlacement, mark: &FeatureMark, options: &MarkOptions) {
    let at = place.position(&mark.measured_px);
    let (color, marker_radius) = (age_color(mark.age), place.marker_radius());
    if options.trails && !mark.trail_px.is_empty() {
        let points: Vec<Pos2> = std::iter::once(at).chain(mark.trail_px.iter().map(|uv| place.position(uv))).collect();
        painter.add(Shape::line(points.clone(), Stroke::new(2.0, halo_of(color).gamma_multiply(0.4))));
        painter.add(Shape::line(points, Stroke::new(1.0, color.gamma_multiply(0.8))));
    }
    if let Some(solved) = &mark.solved {
        // Small markers have thin lines.
        let thickness = 0.5 * marker_radius;
        painter.circle_stroke(at, marker_radius, Stroke::new(thickness + 1.5, halo_of(color)));
        painter.circle_stroke(at, marker_radius, Stroke::new(thickness, color));
        if options.residuals
            && let Some(residual) = solved.residual_px(options.side)
        {
            let reach = residual * f64::from(options.magnification * place.scale());
            let tip = at + vec2(reach.x as f32, reach.y as f32);
            painter.line_segment([at, tip], Stroke::new(3.0, HALO));
            residual_arrow(painter, at, tip, ink().runs[1]);
        }
        if solved.rejected {
            let arm = (marker_radius + 3.0) * std::f32::consts::FRAC_1_SQRT_2;
            for stroke in [Stroke::new(4.0, HALO), Stroke::new(2.0, ink().error)] {
                cross(painter, at, arm, stroke);
            }
        } else if solved.slides {
            for stroke in [Stroke::new(4.0, HALO), Stroke::new(2.0, ink().warn)] {
                slash(painter, at, marker_radius + 3.0, stroke);
            }
        }
    } else {
        painter.circle_filled(at, DOT_RADIUS + 1.0, halo_of(color));
        painter.circle_filled(at, DOT_RADIUS, color);
    }
    if options.ids {
        label(painter, at + vec2(marker_radius + 2.0, 0.0), Align2::LEFT_CENTER, &mark.id.0.to_string());
    }
}

/// Draws the predicted position of a feature for the moved chain: a cross, and a line from the unmoved prediction.
pub(super) fn moved_prediction(painter: &Painter, place: &ImagePlacement, now: &Vector2<f64>, moved: &Vector2<f64>) {
    let (from, to) = (place.position(now), place.position(moved));
    let reach = place.marker_radius() + 2.0;
    for stroke in [Stroke::new(3.0, HALO), Stroke::new(1.5, ink().runs[3])] {
        painter.line_segment([from, to], stroke);
        upright_cross(painter, to, reach, stroke);
    }
}

fn upright_cross(painter: &Painter, at: Pos2, reach: f32, stroke: Stroke) {
    painter.line_segment([at - vec2(reach, 0.0), at + vec2(reach, 0.0)], stroke);
    painter.line_segment([at - vec2(0.0, reach), at + vec2(0.0, reach)], stroke);
}

/// Draws a line from the measurement to the (magnified) prediction, with a diamond at its end.
fn residual_arrow(painter: &Painter, from: Pos2, tip: Pos2, color: Color32) {
    painter.line_segment([from, tip], Stroke::new(1.5, color));
    let side = 2.2;
    let diamond = [vec2(side, 0.0), vec2(0.0, side), vec2(-side, 0.0), vec2(0.0, -side)].map(|corner| tip + corner);
    painter.add(Shape::convex_polygon(diamond.to_vec(), color, Stroke::NONE));
}

/// Draws the mark of a sliding feature.
fn slash(painter: &Painter, at: Pos2, radius: f32, stroke: Stroke) {
    let arm = radius * std::f32::consts::FRAC_1_SQRT_2;
    painter.line_segment([at + vec2(-arm, arm), at + vec2(arm, -arm)], stroke);
}

/// Draws the mark of a rejected feature.
fn cross(painter: &Painter, at: Pos2, arm: f32, stroke: Stroke) {
    painter.line_segment([at + vec2(-arm, -arm), at + vec2(arm, arm)], stroke);
    painter.line_segment([at + vec2(-arm, arm), at + vec2(arm, -arm)], stroke);
}

/// Draws a circle around the selected feature.
pub(super) fn selection(painter: &Painter, place: &ImagePlacement, at: Pos2) {
    let radius = place.marker_radius() + 5.0;
    painter.circle_stroke(at, radius, Stroke::new(4.0, HALO));
    painter.circle_stroke(at, radius, Stroke::new(2.0, ink().cursor));
}

/// Draws a text on the image with a dark background; returns its rectangle.
pub(super) fn label(painter: &Painter, at: Pos2, align: Align2, text: &str) -> Rect {
    let galley = painter.layout_no_wrap(text.to_owned(), theme::label_font(), ink().text_strong);
    plated_text(painter, at, align, (galley, ink().text_strong), (HALO, vec2(2.0, 0.0)))
}

/// Draws the legend of the marks in one line; entries that do not fit are omitted from the right.
///
/// `moved`: predictions of a moved chain are drawn.
pub(super) fn legend(painter: &Painter, rect: Rect, theme: &Theme, options: &MarkOptions, moved: bool) {
    let painter = painter.with_clip_rect(rect);
    let mut pen = LegendPen { painter: &painter, theme, at: rect.left_center(), end: rect.right() };
    pen.text("age");
    pen.color_bar();
    pen.text("frames");
    pen.gap();
    if moved {
        let stroke = Stroke::new(1.5, theme.runs[3]);
        pen.symbol("predicted, moved chain", |painter, at| upright_cross(painter, at, 5.0, stroke));
    }
    pen.symbol("used in the solve", |painter, at| {
        painter.circle_stroke(at, MARKER_RADIUS, Stroke::new(1.5, theme.text));
    });
    pen.symbol("tracked only", |painter, at| {
        painter.circle_filled(at, DOT_RADIUS, theme.text);
    });
    pen.symbol("rejected", |painter, at| cross(painter, at, 4.0, Stroke::new(2.0, theme.error)));
    pen.symbol("slides", |painter, at| slash(painter, at, 5.7, Stroke::new(2.0, theme.warn)));
    if options.residuals {
        let name = format!("prediction − measurement, ×{:.0}", options.magnification);
        pen.symbol(&name, |painter, at| {
            painter.circle_stroke(at + vec2(-5.0, 0.0), 2.5, Stroke::new(1.0, theme.text));
            residual_arrow(painter, at + vec2(-5.0, 0.0), at + vec2(6.0, 0.0), theme.runs[1]);
        });
    }
}

struct LegendPen<'a> {
    painter: &'a Painter,
    theme: &'a Theme,
    at: Pos2,
    end: f32,
}

impl LegendPen<'_> {
    fn gap(&mut self) {
        self.at.x += 6.0;
    }

    fn text(&mut self, text: &str) {
        let galley = self.painter.layout_no_wrap(text.to_owned(), theme::label_font(), self.theme.text_weak);
        if self.at.x + galley.size().x > self.end {
            self.at.x = f32::INFINITY;
            return;
        }
        let rect = Align2::LEFT_CENTER.anchor_size(self.at, galley.size());
        self.painter.galley(rect.min, galley, self.theme.text_weak);
        self.at.x = rect.right() + 4.0;
    }

    fn color_bar(&mut self) {
        const WIDTH: f32 = 96.0;
        let bar = Rect::from_min_size(self.at - vec2(0.0, 7.0), vec2(WIDTH, 14.0));
        const STEPS: u16 = 28;
        for step in 0..STEPS {
            let [left, right] = [step, step + 1].map(|edge| bar.left() + WIDTH * f32::from(edge) / f32::from(STEPS));
            let color = theme::viridis((f64::from(step) + 0.5) / f64::from(STEPS));
            let slice = Rect::from_min_max(pos2(left, bar.top()), pos2(right, bar.bottom()));
            self.painter.rect_filled(slice, 0.0, color);
        }
        for age in LEGEND_AGES {
            let fraction = (f64::from(age) / MAX_AGE).sqrt() as f32;
            let (align, inset) = match age {
                0 => (Align2::LEFT_CENTER, 2.0),
                100 => (Align2::RIGHT_CENTER, -2.0),
                _ => (Align2::CENTER_CENTER, 0.0),
            };
            let at = pos2(bar.left() + WIDTH * fraction + inset, bar.center().y);
            let ink = Theme::text_on(age_color(age));
            self.painter.text(at, align, age.to_string(), theme::label_font(), ink);
        }
        self.at.x = bar.right() + 4.0;
    }

    fn symbol(&mut self, name: &str, draw: impl FnOnce(&Painter, Pos2)) {
        let width = self.painter.layout_no_wrap(name.to_owned(), theme::label_font(), self.theme.text).size().x;
        if self.at.x + 20.0 + width > self.end {
            self.at.x = f32::INFINITY;
            return;
        }
        draw(self.painter, self.at + vec2(8.0, 0.0));
        self.at.x += 18.0;
        self.text(name);
        self.gap();
    }
}
