//! Elements from shapes, in the order of painting.

use egui::epaint::{BandShape, ClippedShape, ColorMode, PathShape, RectShape, Shape};
use egui::{Color32, Pos2, Rect, Stroke, StrokeKind, TextureId, Vec2};

use super::element::Element;
use super::{mesh, text};

/// Number of lines that approximate a curve.
const LINES_PER_CURVE: usize = 24;

/// Elements of the shapes that are visible in a drawing of `size` points.
pub fn elements(shapes: &[ClippedShape], size: Vec2) -> Vec<Element> {
    let screen = Rect::from_min_size(Pos2::ZERO, size);
    let mut elements = Vec::new();
    let mut clip: Option<Rect> = None;
    for clipped in shapes {
        let within = clipped.clip_rect.intersect(screen);
        let bounds = clipped.shape.visual_bounding_rect();
        if !within.is_positive() || !bounds.intersects(within) {
            continue;
        }
        // Shapes inside the clip rectangle need no clipping.
        let needed =
            (!within.contains_rect(bounds) || clip == Some(within)).then_some(within).filter(|it| *it != screen);
        if needed != clip {
            elements.push(Element::Clip(needed));
            clip = needed;
        }
        add_shape(&mut elements, &clipped.shape);
    }
    if clip.is_some() {
        elements.push(Element::Clip(None));
    }
    elements
}

fn add_shape(elements: &mut Vec<Element>, shape: &Shape) {
    match shape {
        Shape::Noop | Shape::Callback(_) => {}
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| add_shape(elements, shape)),
        Shape::LineSegment { points, stroke } => add_line(elements, *points, *stroke),
        Shape::Circle(circle) => {
            let (center, radius) = (circle.center, circle.radius);
            elements.push(Element::Circle { center, radius, fill: circle.fill, stroke: circle.stroke });
        }
        Shape::Ellipse(ellipse) => elements.push(Element::Ellipse {
            center: ellipse.center,
            radius: ellipse.radius,
            angle_rad: ellipse.angle,
            fill: ellipse.fill,
            stroke: ellipse.stroke,
        }),
        Shape::Path(path) => elements.push(outline_of(path)),
        Shape::Band(band) => elements.push(area_of(band)),
        Shape::Rect(rect) => add_rect(elements, rect),
        Shape::Text(shape) => text::add_text(elements, shape),
        Shape::Mesh(triangles) if triangles.texture_id == TextureId::default() => {
            mesh::add_mesh(elements, triangles);
        }
        Shape::Mesh(triangles) => {
            let (texture, rect) = (triangles.texture_id, triangles.calc_bounds());
            elements.push(Element::Image { texture, rect, uv: uv_of(triangles) });
        }
        Shape::QuadraticBezier(curve) => {
            let points = places().map(|place| curve.sample(place)).collect();
            let stroke = Stroke::new(curve.stroke.width, solid(&curve.stroke.color));
            elements.push(outline(points, curve.closed, curve.fill, stroke));
        }
        Shape::CubicBezier(curve) => {
            let points = places().map(|place| curve.sample(place)).collect();
            let stroke = Stroke::new(curve.stroke.width, solid(&curve.stroke.color));
            elements.push(outline(points, curve.closed, curve.fill, stroke));
        }
    }
}

/// Consecutive lines of one stroke, such as dashes and grids, are one element.
fn add_line(elements: &mut Vec<Element>, line: [Pos2; 2], stroke: Stroke) {
    if stroke.is_empty() {
        return;
    }
    match elements.last_mut() {
        Some(Element::Lines { lines, stroke: known }) if *known == stroke => lines.push(line),
        _ => elements.push(Element::Lines { lines: vec![line], stroke }),
    }
}

fn outline(points: Vec<Pos2>, closed: bool, fill: Color32, stroke: Stroke) -> Element {
    Element::Outline { points, closed, fill: if closed { fill } else { Color32::TRANSPARENT }, stroke }
}

fn outline_of(path: &PathShape) -> Element {
    let stroke = Stroke::new(path.stroke.width, solid(&path.stroke.color));
    outline(path.points.clone(), path.closed, path.fill, stroke)
}

/// An area between two lines over x.
fn area_of(band: &BandShape) -> Element {
    let upper = band.points.iter().map(|point| Pos2::new(point.x, point.y.min));
    let lower = band.points.iter().rev().map(|point| Pos2::new(point.x, point.y.max));
    outline(upper.chain(lower).collect(), true, band.fill, band.stroke)
}

fn add_rect(elements: &mut Vec<Element>, shape: &RectShape) {
    if let Some(brush) = &shape.brush
        && brush.fill_texture_id != TextureId::default()
    {
        elements.push(Element::Image { texture: brush.fill_texture_id, rect: shape.rect, uv: brush.uv });
    }
    let fill = if shape.brush.is_some() { Color32::TRANSPARENT } else { shape.fill };
    let half = 0.5 * shape.stroke.width;
    let rect = match shape.stroke_kind {
        _ if shape.stroke.is_empty() => shape.rect,
        StrokeKind::Inside => shape.rect.shrink(half),
        StrokeKind::Middle => shape.rect,
        StrokeKind::Outside => shape.rect.expand(half),
    };
    if fill.a() == 0 && shape.stroke.is_empty() || !rect.is_finite() || rect.is_negative() {
        return;
    }
    let corner_radius = f32::from(shape.corner_radius.nw);
    elements.push(Element::Rect { rect, corner_radius, angle_rad: shape.angle, fill, stroke: shape.stroke });
}

fn places() -> impl Iterator<Item = f32> {
    (0..=LINES_PER_CURVE).map(|place| place as f32 / LINES_PER_CURVE as f32)
}

/// Colour of a path. Colours that vary along a path are not supported; the program does not use them.
fn solid(color: &ColorMode) -> Color32 {
    match color {
        ColorMode::Solid(color) => *color,
        ColorMode::UV(_) => Color32::TRANSPARENT,
    }
}

/// The region of its texture that an axis-aligned mesh shows.
fn uv_of(mesh: &egui::Mesh) -> Rect {
    let mut uv = Rect::NOTHING;
    for vertex in &mesh.vertices {
        uv.extend_with(vertex.uv);
    }
    uv
}
