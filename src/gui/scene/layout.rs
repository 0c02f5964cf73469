//! Projection of a scene to screen shapes, which every backend draws.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use egui::Color32;
use nalgebra::Vector3;

use super::camera::{SceneView, ScreenPoint, length};
use super::model::{ImageQuad, Line, SceneModel};
use crate::sensors::GrayImage;

/// Factor by which lines are drawn nearer than the surfaces on which they lie.
const LINE_LIFT: f64 = 1.004;
/// Distance outside the viewport in pixels up to which lines are kept.
const MARGIN_PX: f64 = 64.0;

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Segment {
    /// x, y in pixels, and depth.
    pub(super) from: [f32; 3],
    pub(super) to: [f32; 3],
    pub(super) half_width_px: f32,
    /// Red, green, blue, alpha.
    pub(super) color: [u8; 4],
}

/// A filled circle parallel to the screen.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Disc {
    pub(super) centre: [f32; 3],
    pub(super) radius_px: f32,
    pub(super) color: [u8; 4],
}

/// A corner of a triangle of one colour.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Corner {
    pub(super) position: [f32; 3],
    pub(super) color: [u8; 4],
}

/// A corner of a textured triangle; `uv` is 0 to 1 from the image's upper left corner.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct ImageCorner {
    pub(super) position: [f32; 3],
    pub(super) uv: [f32; 2],
}

/// An image as textured triangles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImageShape {
    /// Three corners per triangle.
    pub(super) corners: Vec<ImageCorner>,
    pub(super) image: Arc<GrayImage>,
}

/// A text at a screen position.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ScreenLabel {
    pub(super) x_px: f32,
    pub(super) y_px: f32,
    pub(super) text: String,
    pub(super) color: Color32,
}

/// All shapes of a view, in pixels of the viewport.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SceneDrawing {
    pub(super) size_px: [u32; 2],
    pub(super) background: Color32,
    pub(super) segments: Vec<Segment>,
    pub(super) discs: Vec<Disc>,
    /// Three corners per triangle.
    pub(super) corners: Vec<Corner>,
    pub(super) images: Vec<ImageShape>,
    pub(super) labels: Vec<ScreenLabel>,
}

pub(super) fn lay_out(
    model: &SceneModel,
    view: &SceneView,
    pixels_per_point: f32,
    background: Color32,
) -> SceneDrawing {
    let mut drawing = SceneDrawing {
        size_px: view.viewport.size_px,
        background,
        segments: Vec::new(),
        discs: Vec::new(),
        corners: Vec::new(),
        images: Vec::new(),
        labels: Vec::new(),
    };
    for line in &model.lines {
        lay_out_line(line, view, pixels_per_point, &mut drawing);
    }
    let [width, height] = view.viewport.size_px.map(f64::from);
    let is_near = |point: &ScreenPoint| {
        point.x_px > -MARGIN_PX
            && point.y_px > -MARGIN_PX
            && point.x_px < width + MARGIN_PX
            && point.y_px < height + MARGIN_PX
    };
    for dot in &model.dots {
        if let Some(point) = view.project(&dot.position_m).filter(is_near) {
            let radius_px = dot.radius * pixels_per_point;
            drawing.discs.push(Disc { centre: position(&point, 1.0), radius_px, color: dot.color.to_array() });
        }
    }
    for face in &model.faces {
        let color = face.color.to_array();
        let corners = face.corners_m.map(|corner| (view.in_view(&corner), [0.0; 2]));
        for triangle in clipped_triangles(&corners, view.near_m) {
            drawing.corners.extend(
                triangle.map(|(corner, _)| Corner { position: position(&view.on_screen(&corner), 1.0), color }),
            );
        }
    }
    drawing.images.extend(model.images.iter().filter_map(|quad| lay_out_image(quad, view)));
    for label in &model.labels {
        if let Some(point) = view.project(&label.position_m).filter(is_near) {
            let (x_px, y_px) = (point.x_px as f32, point.y_px as f32);
            drawing.labels.push(ScreenLabel { x_px, y_px, text: label.text.clone(), color: label.color });
        }
    }
    drawing
}

fn position(point: &ScreenPoint, lift: f64) -> [f32; 3] {
    [point.x_px as f32, point.y_px as f32, (point.depth * lift).min(1.0) as f32]
}

fn lay_out_line(line: &Line, view: &SceneView, pixels_per_point: f32, drawing: &mut SceneDrawing) {
    let half_width_px = 0.5 * line.width * pixels_per_point;
    let color = line.color.to_array();
    let dashes: Vec<f64> = line.dashes.iter().map(|length| f64::from(length * pixels_per_point)).collect();
    let mut travelled_px = 0.0;
    let mut before = line.points_m.first().map(|point| view.in_view(point));
    for point in line.points_m.iter().skip(1) {
        let here = view.in_view(point);
        let Some(from) = before.replace(here) else { continue };
        let Some((from, to)) = in_front(&from, &here, view.near_m) else { continue };
        let (from, to) = (view.on_screen(&from), view.on_screen(&to));
        let length_px = length(to.x_px - from.x_px, to.y_px - from.y_px);
        if let Some((enter, leave)) = within_viewport(&from, &to, view.viewport.size_px) {
            let mut piece = |begin: f64, end: f64| {
                let (begin, end) = (begin.max(enter), end.min(leave));
                if begin < end {
                    let [from, to] = [begin, end].map(|fraction| position(&from.lerp(&to, fraction), LINE_LIFT));
                    drawing.segments.push(Segment { from, to, half_width_px, color });
                }
            };
            if dashes.is_empty() || length_px <= 0.0 {
                piece(0.0, 1.0);
            } else {
                each_dash(&dashes, travelled_px + enter * length_px, (leave - enter) * length_px, |begin, end| {
                    piece(enter + begin / length_px, enter + end / length_px);
                });
            }
        }
        travelled_px += length_px;
    }
}

/// Calls `emit(start, end)` for every dash of a line, measured from the start of the line.
fn each_dash(dashes: &[f64], travelled_px: f64, length_px: f64, mut emit: impl FnMut(f64, f64)) {
    let period: f64 = dashes.iter().sum();
    if !(period > 1e-3 && length_px.is_finite() && travelled_px.is_finite()) {
        return emit(0.0, length_px);
    }
    let mut at = -travelled_px.rem_euclid(period);
    while at < length_px {
        for (number, dash) in dashes.iter().enumerate() {
            if number.is_multiple_of(2) && at + dash > 0.0 && at < length_px {
                emit(at.max(0.0), (at + dash).min(length_px));
            }
            at += dash;
        }
    }
}

/// The section of a line behind the near plane.
fn in_front(from: &Vector3<f64>, to: &Vector3<f64>, near_m: f64) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let at_near = |inside: &Vector3<f64>, outside: &Vector3<f64>| {
        let mut point = inside + (outside - inside) * ((inside.z - near_m) / (inside.z - outside.z));
        point.z = near_m;
        point
    };
    match (from.z >= near_m, to.z >= near_m) {
        (true, true) => Some((*from, *to)),
        (true, false) => Some((*from, at_near(from, to))),
        (false, true) => Some((at_near(to, from), *to)),
        (false, false) => None,
    }
}

/// Fractions at which a line enters and leaves the viewport with its margin.
fn within_viewport(from: &ScreenPoint, to: &ScreenPoint, size_px: [u32; 2]) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (start, end, size) in [(from.x_px, to.x_px, size_px[0]), (from.y_px, to.y_px, size_px[1])] {
        let (low, high) = (-MARGIN_PX, f64::from(size) + MARGIN_PX);
        let change = end - start;
        if change.abs() < 1e-12 {
            if start < low || start > high {
                return None;
            }
            continue;
        }
        let (a, b) = ((low - start) / change, (high - start) / change);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (enter < leave || (enter == leave && from == to)).then_some((enter, leave))
}

/// A corner in the view and its position in the image.
type ViewCorner = (Vector3<f64>, [f64; 2]);

/// The section of a convex polygon behind the near plane, as triangles.
fn clipped_triangles(corners: &[ViewCorner], near_m: f64) -> Vec<[ViewCorner; 3]> {
    let mut kept: Vec<ViewCorner> = Vec::with_capacity(corners.len() + 1);
    for (index, corner) in corners.iter().enumerate() {
        let next = &corners[(index + 1) % corners.len()];
        let (here, there) = (corner.0.z - near_m, next.0.z - near_m);
        if here >= 0.0 {
            kept.push(*corner);
        }
        if (here >= 0.0) != (there >= 0.0) {
            let fraction = here / (here - there);
            let uv = [0, 1].map(|axis| corner.1[axis] + (next.1[axis] - corner.1[axis]) * fraction);
            kept.push((corner.0 + (next.0 - corner.0) * fraction, uv));
        }
    }
    (2..kept.len()).map(|last| [kept[0], kept[last - 1], kept[last]]).collect()
}

fn lay_out_image(quad: &ImageQuad, view: &SceneView) -> Option<ImageShape> {
    let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let corners: Vec<ViewCorner> =
        quad.corners_m.iter().zip(uvs).map(|(corner, uv)| (view.in_view(corner), uv)).collect();
    let shape: Vec<ImageCorner> = clipped_triangles(&corners, view.near_m)
        .into_iter()
        .flatten()
        .map(|(corner, uv)| ImageCorner {
            position: position(&view.on_screen(&corner), 1.0),
            uv: uv.map(|coordinate| coordinate as f32),
        })
        .collect();
    let across = shape.iter().map(|corner| corner.position[0]);
    let width_px = across.clone().fold(f32::NEG_INFINITY, f32::max) - across.fold(f32::INFINITY, f32::min);
    (!shape.is_empty()).then(|| ImageShape { corners: shape, image: shrunk(&quad.image, width_px) })
}

/// The image at the smallest power-of-two reduction with at least one column per pixel on the screen.
fn shrunk(image: &Arc<GrayImage>, width_px: f32) -> Arc<GrayImage> {
    let mut factor = 1;
    while factor < 16 && (image.width / (2 * factor)) as f32 >= width_px.max(16.0) {
        factor *= 2;
    }
    if factor == 1 {
        return Arc::clone(image);
    }
    let (width, height) = (image.width / factor, image.height / factor);
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let mut sum = 0;
            for line in 0..factor {
                let start = (row * factor + line) * image.width + column * factor;
                sum += image.pixels.get(start..start + factor).map_or(0, |run| run.iter().map(|p| u32::from(*p)).sum());
            }
            pixels.push((sum / (factor * factor) as u32) as u8);
        }
    }
    Arc::new(GrayImage { width, height, pixels })
}
