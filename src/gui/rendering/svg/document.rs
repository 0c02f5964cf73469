//! An SVG document from the shapes of one frame.

use egui::epaint::{BandShape, ClippedShape, ColorMode, PathShape, RectShape, Shape};
use egui::{Color32, Pos2, Rect, Stroke, StrokeKind, TextureId, Vec2};

use super::element::{attribute, escape, lines_through, number, paint, put, stroke};
use super::textures::Textures;
use super::{mesh, text};

/// Number of lines that approximate a curve.
const LINES_PER_CURVE: usize = 24;

/// SVG drawing of shapes over an opaque background.
///
/// `size` is in points and `size_px` the size in a viewer; `prefix` is the prefix of the ids of the elements, so that
/// one page can hold several drawings; `title` is its title.
pub(in crate::gui) fn document(
    shapes: &[ClippedShape],
    textures: &Textures,
    size: Vec2,
    size_px: [u32; 2],
    background: Color32,
    prefix: &str,
    title: &str,
) -> String {
    let screen = Rect::from_min_size(Pos2::ZERO, size);
    let mut writer = Writer { textures, prefix, body: String::new(), clips: Vec::new(), lines: None };
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
            writer.finish_lines();
            if clip.is_some() {
                writer.body.push_str("</g>\n");
            }
            if let Some(rect) = needed {
                writer.begin_clip(rect);
            }
            clip = needed;
        }
        writer.shape(&clipped.shape);
    }
    writer.finish_lines();
    if clip.is_some() {
        writer.body.push_str("</g>\n");
    }
    let [width, height] = [size.x, size.y].map(number);
    let ground = paint("fill", background);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {width} {height}\" \
         role=\"img\">\n<title>{}</title>\n{}<rect width=\"{width}\" height=\"{height}\"{ground}/>\n{}</svg>\n",
        size_px[0],
        size_px[1],
        escape(title),
        writer.definitions(),
        writer.body
    )
}

struct Writer<'a> {
    textures: &'a Textures,
    prefix: &'a str,
    body: String,
    clips: Vec<Rect>,
    /// Pending straight lines of one stroke, which are written as one path.
    lines: Option<(Stroke, String)>,
}

impl Writer<'_> {
    fn definitions(&self) -> String {
        if self.clips.is_empty() {
            return String::new();
        }
        let mut text = "<defs>\n".to_owned();
        for (index, rect) in self.clips.iter().enumerate() {
            let [x, y, width, height] = [rect.left(), rect.top(), rect.width(), rect.height()].map(number);
            put(
                &mut text,
                format_args!(
                    "<clipPath id=\"{}{index}\"><rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/></clipPath>\n",
                    self.prefix
                ),
            );
        }
        text.push_str("</defs>\n");
        text
    }

    fn begin_clip(&mut self, rect: Rect) {
        let known = self.clips.iter().position(|clip| *clip == rect);
        let index = known.unwrap_or(self.clips.len());
        if known.is_none() {
            self.clips.push(rect);
        }
        put(&mut self.body, format_args!("<g clip-path=\"url(#{}{index})\">\n", self.prefix));
    }

    fn finish_lines(&mut self) {
        if let Some((line, path)) = self.lines.take() {
            put(&mut self.body, format_args!("<path d=\"{path}\" fill=\"none\"{}/>\n", stroke(line)));
        }
    }

    fn line(&mut self, points: &[Pos2], line: Stroke) {
        if line.is_empty() || points.len() < 2 {
            return;
        }
        if self.lines.as_ref().is_some_and(|(known, _)| *known != line) {
            self.finish_lines();
        }
        let (_, path) = self.lines.get_or_insert_with(|| (line, String::new()));
        lines_through(path, points, false);
    }

    fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::Noop | Shape::Callback(_) => return,
            Shape::Vec(shapes) => {
                for shape in shapes {
                    self.shape(shape);
                }
                return;
            }
            // Consecutive lines of one stroke, such as dashes and grids, become one path; separate translucent lines
            // would add up where they overlap.
            Shape::LineSegment { points, stroke } => return self.line(points, *stroke),
            _ => self.finish_lines(),
        }
        match shape {
            Shape::Circle(circle) => {
                let place = [attribute("cx", circle.center.x), attribute("cy", circle.center.y)].concat();
                let look = [paint("fill", circle.fill), stroke(circle.stroke)].concat();
                self.element("circle", &format!("{place}{}{look}", attribute("r", circle.radius)));
            }
            Shape::Ellipse(ellipse) => {
                let [x, y] = [number(ellipse.center.x), number(ellipse.center.y)];
                let radii = [attribute("rx", ellipse.radius.x), attribute("ry", ellipse.radius.y)].concat();
                let angle_deg = number(ellipse.angle.to_degrees());
                let look = [paint("fill", ellipse.fill), stroke(ellipse.stroke)].concat();
                let rest = format!(" cx=\"{x}\" cy=\"{y}\"{radii} transform=\"rotate({angle_deg} {x} {y})\"{look}");
                self.element("ellipse", &rest);
            }
            Shape::Path(path) => self.path(path),
            Shape::Band(band) => self.band(band),
            Shape::Rect(rect) => self.rect(rect),
            Shape::Text(shape) => text::text(&mut self.body, shape),
            Shape::Mesh(triangles) if triangles.texture_id == TextureId::default() => {
                mesh::mesh(&mut self.body, triangles);
            }
            Shape::Mesh(triangles) => {
                let (rect, uv) = (triangles.calc_bounds(), uv_of(triangles));
                self.body.push_str(&self.textures.element(triangles.texture_id, rect, uv));
            }
            Shape::QuadraticBezier(curve) => {
                let points: Vec<Pos2> = places().map(|place| curve.sample(place)).collect();
                self.curve(&points, curve.closed, curve.fill, solid(&curve.stroke.color), curve.stroke.width);
            }
            Shape::CubicBezier(curve) => {
                let points: Vec<Pos2> = places().map(|place| curve.sample(place)).collect();
                self.curve(&points, curve.closed, curve.fill, solid(&curve.stroke.color), curve.stroke.width);
            }
            Shape::Noop | Shape::Vec(_) | Shape::LineSegment { .. } | Shape::Callback(_) => {}
        }
    }

    fn element(&mut self, name: &str, attributes: &str) {
        put(&mut self.body, format_args!("<{name}{attributes}/>\n"));
    }

    fn curve(&mut self, points: &[Pos2], closed: bool, fill: Color32, color: Color32, width: f32) {
        let mut path = String::new();
        lines_through(&mut path, points, closed);
        let fill = paint("fill", if closed { fill } else { Color32::TRANSPARENT });
        let line = stroke(Stroke::new(width, color));
        self.element("path", &format!(" d=\"{path}\"{fill}{line} stroke-linejoin=\"round\""));
    }

    fn path(&mut self, path: &PathShape) {
        self.curve(&path.points, path.closed, path.fill, solid(&path.stroke.color), path.stroke.width);
    }

    /// An area between two lines over x.
    fn band(&mut self, band: &BandShape) {
        let upper = band.points.iter().map(|point| Pos2::new(point.x, point.y.min));
        let lower = band.points.iter().rev().map(|point| Pos2::new(point.x, point.y.max));
        let points: Vec<Pos2> = upper.chain(lower).collect();
        self.curve(&points, true, band.fill, band.stroke.color, band.stroke.width);
    }

    fn rect(&mut self, shape: &RectShape) {
        if let Some(brush) = &shape.brush
            && brush.fill_texture_id != TextureId::default()
        {
            self.body.push_str(&self.textures.element(brush.fill_texture_id, shape.rect, brush.uv));
        }
        let fill = if shape.brush.is_some() { Color32::TRANSPARENT } else { shape.fill };
        // SVG strokes are centred on the outline.
        let half = 0.5 * shape.stroke.width;
        let outline = match shape.stroke_kind {
            _ if shape.stroke.is_empty() => shape.rect,
            StrokeKind::Inside => shape.rect.shrink(half),
            StrokeKind::Middle => shape.rect,
            StrokeKind::Outside => shape.rect.expand(half),
        };
        if fill.a() == 0 && shape.stroke.is_empty() || !outline.is_finite() || outline.is_negative() {
            return;
        }
        let [x, y, width, height] = [outline.left(), outline.top(), outline.width(), outline.height()].map(number);
        let mut attributes = format!(" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"");
        let radius = f32::from(shape.corner_radius.nw);
        if radius > 0.0 {
            attributes.push_str(&attribute("rx", radius));
        }
        attributes.push_str(&paint("fill", fill));
        attributes.push_str(&stroke(shape.stroke));
        if shape.angle != 0.0 {
            let [x, y] = [number(outline.center().x), number(outline.center().y)];
            put(&mut attributes, format_args!(" transform=\"rotate({} {x} {y})\"", number(shape.angle.to_degrees())));
        }
        self.element("rect", &attributes);
    }
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
