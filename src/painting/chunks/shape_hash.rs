//! Hashes of shapes; shapes with equal hashes have equal tessellations.

use std::sync::Arc;

use egui::emath::TSTransform;
use egui::epaint::{
    BandPoint, BandShape, Brush, CircleShape, ClippedShape, ColorMode, CornerRadius, CubicBezierShape, EllipseShape,
    Mesh, PathShape, PathStroke, QuadraticBezierShape, RectShape, TextShape, Vertex,
};
use egui::{Color32, Galley, Pos2, Rect, Shape, Stroke, StrokeKind, TextureId};

use crate::mixing::mixed;

/// Number of points from which the tessellation of a shape starts, 1 for all shapes of fixed size.
pub(super) fn points_of(shape: &Shape) -> usize {
    match shape {
        Shape::Vec(shapes) => shapes.iter().map(points_of).sum(),
        Shape::Path(path) => path.points.len(),
        Shape::Band(band) => band.points.len(),
        Shape::Mesh(mesh) => mesh.vertices.len(),
        Shape::Noop
        | Shape::Circle(_)
        | Shape::Ellipse(_)
        | Shape::LineSegment { .. }
        | Shape::Rect(_)
        | Shape::Text(_)
        | Shape::QuadraticBezier(_)
        | Shape::CubicBezier(_)
        | Shape::Callback(_) => 1,
    }
}

/// Concatenated bits of two numbers.
#[inline]
fn joined(first: f32, second: f32) -> u64 {
    u64::from(first.to_bits()) << 32 | u64::from(second.to_bits())
}

#[derive(Default)]
pub(super) struct ShapeHasher {
    /// Hash of the shapes so far.
    all: u64,
    /// Hash of the last shape without the addresses of its texts, which differ between processes.
    last: u64,
    /// True if a shape contains code, which cannot be compared.
    has_code: bool,
    texts: Vec<Arc<Galley>>,
}

impl ShapeHasher {
    pub(super) fn add(&mut self, clipped: &ClippedShape) {
        let ClippedShape { clip_rect, shape, transform_after_tessellation } = clipped;
        self.last = 0;
        self.rect(*clip_rect);
        let TSTransform { scaling, translation } = *transform_after_tessellation;
        self.numbers([scaling, translation.x, translation.y]);
        self.shape(shape);
        self.all = mixed(self.all, self.last);
    }

    /// Hash of the last shape, equal in every process; texts contribute their positions and colours only.
    pub(super) fn last(&self) -> u64 {
        self.last
    }

    /// Hash of all shapes; `None` if one of them cannot be compared.
    pub(super) fn hash(&self) -> Option<u64> {
        (!self.has_code).then_some(self.all)
    }

    /// Texts of the shapes, which are hashed by their addresses.
    pub(super) fn into_texts(self) -> Vec<Arc<Galley>> {
        self.texts
    }

    fn word(&mut self, word: u64) {
        self.last = mixed(self.last, word);
    }

    fn numbers<const N: usize>(&mut self, numbers: [f32; N]) {
        for pair in numbers.chunks(2) {
            self.word(joined(pair[0], pair.get(1).copied().unwrap_or(0.0)));
        }
    }

    /// Adds words in four independent chains, which the processor computes in parallel.
    fn words<T>(&mut self, items: &[T], word_of: impl Fn(&T) -> u64) {
        self.word(items.len() as u64);
        let mut chains = [self.last; 4];
        let groups = items.chunks_exact(4);
        let rest = groups.remainder();
        for group in groups {
            for (chain, item) in chains.iter_mut().zip(group) {
                *chain = mixed(*chain, word_of(item));
            }
        }
        for (chain, item) in chains.iter_mut().zip(rest) {
            *chain = mixed(*chain, word_of(item));
        }
        self.last = chains.into_iter().fold(self.last, mixed);
    }

    fn points(&mut self, points: &[Pos2]) {
        self.words(points, |point| joined(point.x, point.y));
    }

    fn rect(&mut self, rect: Rect) {
        self.numbers([rect.min.x, rect.min.y, rect.max.x, rect.max.y]);
    }

    fn color(&mut self, color: Color32) {
        self.word(u64::from(u32::from_le_bytes(color.to_array())));
    }

    fn stroke(&mut self, stroke: Stroke) {
        let Stroke { width, color } = stroke;
        self.numbers([width]);
        self.color(color);
    }

    fn stroke_kind(&mut self, kind: StrokeKind) {
        self.word(match kind {
            StrokeKind::Inside => 0,
            StrokeKind::Middle => 1,
            StrokeKind::Outside => 2,
        });
    }

    fn path_stroke(&mut self, stroke: &PathStroke) {
        let PathStroke { width, color, kind } = stroke;
        self.numbers([*width]);
        match color {
            ColorMode::Solid(color) => self.color(*color),
            ColorMode::UV(_) => self.has_code = true,
        }
        self.stroke_kind(*kind);
    }

    fn texture(&mut self, texture: TextureId) {
        let (kind, number) = match texture {
            TextureId::Managed(number) => (0, number),
            TextureId::User(number) => (1, number),
        };
        self.word(kind);
        self.word(number);
    }

    fn shape(&mut self, shape: &Shape) {
        let kind = match shape {
            Shape::Noop => 0,
            Shape::Vec(_) => 1,
            Shape::Circle(_) => 2,
            Shape::Ellipse(_) => 3,
            Shape::LineSegment { .. } => 4,
            Shape::Path(_) => 5,
            Shape::Band(_) => 6,
            Shape::Rect(_) => 7,
            Shape::Text(_) => 8,
            Shape::Mesh(_) => 9,
            Shape::QuadraticBezier(_) => 10,
            Shape::CubicBezier(_) => 11,
            Shape::Callback(_) => 12,
        };
        self.word(kind);
        match shape {
            Shape::Noop => {}
            Shape::Vec(shapes) => {
                self.word(shapes.len() as u64);
                for shape in shapes {
                    self.shape(shape);
                }
            }
            Shape::Circle(CircleShape { center, radius, fill, stroke }) => {
                self.numbers([center.x, center.y, *radius]);
                self.color(*fill);
                self.stroke(*stroke);
            }
            Shape::Ellipse(EllipseShape { center, radius, fill, stroke, angle }) => {
                self.numbers([center.x, center.y, radius.x, radius.y, *angle]);
                self.color(*fill);
                self.stroke(*stroke);
            }
            Shape::LineSegment { points, stroke } => {
                self.points(points);
                self.stroke(*stroke);
            }
            Shape::Path(PathShape { points, closed, fill, stroke }) => self.path(points, *closed, *fill, stroke),
            Shape::QuadraticBezier(QuadraticBezierShape { points, closed, fill, stroke }) => {
                self.path(points, *closed, *fill, stroke);
            }
            Shape::CubicBezier(CubicBezierShape { points, closed, fill, stroke }) => {
                self.path(points, *closed, *fill, stroke);
            }
            Shape::Band(band) => self.band(band),
            Shape::Rect(rect) => self.rectangle(rect),
            Shape::Text(text) => self.text(text),
            Shape::Mesh(mesh) => self.mesh(mesh),
            Shape::Callback(_) => self.has_code = true,
        }
    }

    fn path(&mut self, points: &[Pos2], closed: bool, fill: Color32, stroke: &PathStroke) {
        self.points(points);
        self.word(u64::from(closed));
        self.color(fill);
        self.path_stroke(stroke);
    }

    fn band(&mut self, band: &BandShape) {
        let BandShape { points, fill, stroke, stroke_kind, angle } = band;
        self.word(points.len() as u64);
        for BandPoint { x, y } in points {
            self.numbers([*x, y.min, y.max]);
        }
        self.color(*fill);
        self.stroke(*stroke);
        self.stroke_kind(*stroke_kind);
        self.numbers([*angle]);
    }

    fn rectangle(&mut self, shape: &RectShape) {
        let RectShape { rect, corner_radius, fill, stroke, stroke_kind, round_to_pixels, blur_width, brush, angle } =
            shape;
        self.rect(*rect);
        let CornerRadius { nw, ne, sw, se } = *corner_radius;
        self.word(u64::from(u32::from_le_bytes([nw, ne, sw, se])));
        self.color(*fill);
        self.stroke(*stroke);
        self.stroke_kind(*stroke_kind);
        self.word(round_to_pixels.map_or(2, u64::from));
        self.numbers([*blur_width, *angle]);
        self.word(u64::from(brush.is_some()));
        if let Some(brush) = brush {
            let Brush { fill_texture_id, uv } = &**brush;
            self.texture(*fill_texture_id);
            self.rect(*uv);
        }
    }

    fn text(&mut self, shape: &TextShape) {
        let TextShape { pos, galley, underline, fallback_color, override_text_color, opacity_factor, angle } = shape;
        self.numbers([pos.x, pos.y]);
        self.all = mixed(self.all, Arc::as_ptr(galley).addr() as u64);
        self.texts.push(Arc::clone(galley));
        self.stroke(*underline);
        self.color(*fallback_color);
        self.word(u64::from(override_text_color.is_some()));
        self.color(override_text_color.unwrap_or_default());
        self.numbers([*opacity_factor, *angle]);
    }

    fn mesh(&mut self, mesh: &Mesh) {
        let Mesh { indices, vertices, texture_id } = mesh;
        self.texture(*texture_id);
        self.words(vertices, |Vertex { pos, uv, color }| {
            let color = u64::from(u32::from_le_bytes(color.to_array()));
            mixed(joined(pos.x, pos.y), mixed(joined(uv.x, uv.y), color))
        });
        self.words(indices, |index| u64::from(*index));
    }
}
