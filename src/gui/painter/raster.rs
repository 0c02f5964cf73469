//! Triangles to spans of pixels, and spans to colours.

use std::ops::Range;

use egui::Rect;
use egui::epaint::{Mesh, Vertex};

use super::blend;
use super::texture::{TEXEL_BITS, TexelKind, Texture, weight};

/// Steps per pixel that vertices are snapped to.
pub(in crate::gui) const SUBPIXELS: i32 = 256;
/// Furthest coordinate in subpixels (32 768 pixels), so that products fit 64 bits.
const FURTHEST: f32 = (1 << 23) as f32;

/// A band of rows that one worker owns.
pub(super) struct Band<'a> {
    pixels: &'a mut [u32],
    width: usize,
    first_row: i32,
    end_row: i32,
}

impl<'a> Band<'a> {
    pub(super) fn new(pixels: &'a mut [u32], width: usize, first_row: i32) -> Self {
        let end_row = first_row + (pixels.len() / width) as i32;
        Self { pixels, width, first_row, end_row }
    }

    fn span(&mut self, row: i32, left: i32, right: i32) -> &mut [u32] {
        let start = (row - self.first_row) as usize * self.width;
        &mut self.pixels[start + left as usize..start + right as usize]
    }
}

/// Pixels `left..right` of rows `top..bottom`.
#[derive(Clone, Copy, Default)]
pub(in crate::gui) struct Clip {
    pub(in crate::gui) left: i32,
    pub(in crate::gui) top: i32,
    pub(in crate::gui) right: i32,
    pub(in crate::gui) bottom: i32,
}

impl Clip {
    /// Rounded as egui's own renderer rounds its scissor rectangle.
    fn new(rect: Rect, pixels_per_point: f32, size_px: [u32; 2]) -> Self {
        let pixel = |coordinate: f32, size: u32| ((coordinate * pixels_per_point).round() as i32).clamp(0, size as i32);
        Self {
            left: pixel(rect.min.x, size_px[0]),
            top: pixel(rect.min.y, size_px[1]),
            right: pixel(rect.max.x, size_px[0]),
            bottom: pixel(rect.max.y, size_px[1]),
        }
    }

    fn column(&self, pixel: i64) -> i32 {
        pixel.clamp(i64::from(self.left), i64::from(self.right)) as i32
    }
}

/// A mesh with its vertices snapped to subpixels.
pub(super) struct PreparedMesh<'a> {
    mesh: &'a Mesh,
    texture: &'a Texture,
    clip: Clip,
    /// Position of each vertex, `None` when it is not finite.
    points: Vec<Option<[i32; 2]>>,
}

impl<'a> PreparedMesh<'a> {
    /// `None` when nothing of it can be seen.
    pub(super) fn new(
        mesh: &'a Mesh,
        texture: &'a Texture,
        clip_rect: Rect,
        pixels_per_point: f32,
        size_px: [u32; 2],
    ) -> Option<Self> {
        let clip = Clip::new(clip_rect, pixels_per_point, size_px);
        if clip.left >= clip.right || clip.top >= clip.bottom || texture.is_empty() {
            return None;
        }
        let snap = |coordinate: f32| {
            let subpixels = (coordinate * pixels_per_point * SUBPIXELS as f32).round();
            subpixels.clamp(-FURTHEST, FURTHEST) as i32
        };
        let points = mesh
            .vertices
            .iter()
            .map(|vertex| vertex.pos.is_finite().then(|| [snap(vertex.pos.x), snap(vertex.pos.y)]))
            .collect();
        Some(Self { mesh, texture, clip, points })
    }

    /// How many triangles it has.
    pub(super) fn triangles(&self) -> usize {
        self.mesh.indices.len() / 3
    }

    /// Numbers of the corners of a triangle.
    fn corners(&self, triangle: usize) -> [usize; 3] {
        [0, 1, 2].map(|corner| self.mesh.indices[3 * triangle + corner] as usize)
    }

    /// Places of the corners of a triangle, `None` when one is not finite.
    fn points(&self, triangle: usize) -> Option<[[i32; 2]; 3]> {
        let [a, b, c] = self.corners(triangle).map(|corner| self.points.get(corner).copied().flatten());
        Some([a?, b?, c?])
    }

    /// Rows of the picture that a triangle may touch; empty when nothing of it can be seen.
    pub(super) fn rows(&self, triangle: usize) -> Range<i32> {
        let Some(points) = self.points(triangle) else { return 0..0 };
        let [across, down] = [0, 1].map(|axis| points.map(|point| point[axis]));
        let first = |values: [i32; 3]| first_centre(values[0].min(values[1]).min(values[2]));
        let end = |values: [i32; 3]| first_centre(values[0].max(values[1]).max(values[2]));
        let clip = &self.clip;
        let is_seen = first(across) < clip.right && end(across) > clip.left;
        let is_inked =
            || self.corners(triangle).iter().any(|corner| self.mesh.vertices[*corner].color.to_array() != [0; 4]);
        if is_seen && is_inked() { first(down).max(clip.top)..end(down).min(clip.bottom) } else { 0..0 }
    }

    /// Paints what of a triangle lies in a band.
    pub(super) fn paint(&self, triangle: usize, band: &mut Band<'_>) {
        let clip =
            Clip { top: self.clip.top.max(band.first_row), bottom: self.clip.bottom.min(band.end_row), ..self.clip };
        let Some(points) = self.points(triangle) else { return };
        let vertices = self.corners(triangle).map(|corner| &self.mesh.vertices[corner]);
        self.paint_triangle(points, vertices, clip, band);
    }

    fn paint_triangle(&self, points: [[i32; 2]; 3], vertices: [&Vertex; 3], clip: Clip, band: &mut Band<'_>) {
        let colors = vertices.map(|vertex| blend::pack(vertex.color.to_array()));
        let one_color = colors[0] == colors[1] && colors[1] == colors[2];
        let uvs = vertices.map(|vertex| vertex.uv);
        let untextured = uvs[0] == uvs[1] && uvs[1] == uvs[2];
        match (untextured, one_color) {
            (true, true) => {
                let texel = self.texel_at(uvs[0]);
                let color = if texel == u32::MAX { colors[0] } else { blend::multiply(texel, colors[0]) };
                spans(points, clip, |row, left, right| fill(band.span(row, left, right), color));
            }
            (true, false) => {
                let texel = self.texel_at(uvs[0]);
                let colors = colors.map(|color| if texel == u32::MAX { color } else { blend::multiply(texel, color) });
                let Some(gradient) = Gradient::of_colors(points, colors) else { return };
                spans(points, clip, |row, left, right| {
                    let (mut color, step) = gradient.start(left, row);
                    for pixel in band.span(row, left, right) {
                        *pixel = blend::over(*pixel, pack_fixed(color));
                        for channel in 0..4 {
                            color[channel] = color[channel].wrapping_add(step[channel]);
                        }
                    }
                });
            }
            (false, one_color) => {
                let Some(place) = Place::new(points, uvs, self.texture) else { return };
                if one_color {
                    spans(points, clip, |row, left, right| {
                        self.texture_span(&place, colors[0], row, left, band.span(row, left, right));
                    });
                } else {
                    let Some(gradient) = Gradient::of_colors(points, colors) else { return };
                    spans(points, clip, |row, left, right| {
                        let (mut color, step) = gradient.start(left, row);
                        let [mut u, mut v] = place.at(left, row);
                        for pixel in band.span(row, left, right) {
                            let source = blend::multiply(self.texture.sample(u, v), pack_fixed(color));
                            *pixel = blend::over(*pixel, source);
                            (u, v) = (u.wrapping_add(place.step[0]), v.wrapping_add(place.step[1]));
                            for channel in 0..4 {
                                color[channel] = color[channel].wrapping_add(step[channel]);
                            }
                        }
                    });
                }
            }
        }
    }

    fn texel_at(&self, uv: egui::Pos2) -> u32 {
        if uv == egui::epaint::WHITE_UV {
            return self.texture.corner();
        }
        let coordinate = |fraction: f32, size: usize| to_texels(f64::from(fraction) * size as f64);
        self.texture.sample(coordinate(uv.x, self.texture.width), coordinate(uv.y, self.texture.height))
    }

    /// A span of one colour times the texture.
    fn texture_span(&self, place: &Place, color: u32, row: i32, left: i32, pixels: &mut [u32]) {
        let texture = self.texture;
        let [mut u, mut v] = place.at(left, row);
        let [step_u, step_v] = place.step;
        if step_v != 0 || texture.is_nearest() {
            for pixel in pixels {
                let source = tinted(texture.kind, texture.sample(u, v), color);
                *pixel = blend::over(*pixel, source);
                (u, v) = (u.wrapping_add(step_u), v.wrapping_add(step_v));
            }
            return;
        }
        // The texture lies upright, as glyphs and images do: two rows of texels serve the whole span.
        let half = 1 << (TEXEL_BITS - 1);
        (u, v) = (u - half, v - half);
        let (upper, lower) = (texture.row(v >> TEXEL_BITS), texture.row((v >> TEXEL_BITS) + 1));
        let down = weight(v);
        for pixel in pixels {
            let texel = texture.between(upper, lower, u, down);
            if texel != 0 {
                *pixel = blend::over(*pixel, tinted(texture.kind, texel, color));
            }
            u = u.wrapping_add(step_u);
        }
    }
}

/// A texel times a colour.
#[inline]
fn tinted(kind: TexelKind, texel: u32, color: u32) -> u32 {
    if color == u32::MAX {
        texel
    } else if kind == TexelKind::Coverage {
        blend::scale(color, texel >> 24)
    } else {
        blend::multiply(texel, color)
    }
}

fn fill(pixels: &mut [u32], color: u32) {
    if color >> 24 == 255 {
        pixels.fill(color);
    } else if color != 0 {
        for pixel in pixels {
            *pixel = blend::over(*pixel, color);
        }
    }
}

/// The first pixel whose centre lies at or behind a subpixel coordinate.
fn first_centre(subpixels: i32) -> i32 {
    (subpixels + SUBPIXELS / 2 - 1) >> SUBPIXELS.trailing_zeros()
}

/// Calls `emit(row, left, right)` for each row of a triangle with at least one pixel centre inside, top-left rule.
#[inline]
pub(in crate::gui) fn spans(mut points: [[i32; 2]; 3], clip: Clip, mut emit: impl FnMut(i32, i32, i32)) {
    points.sort_unstable_by_key(|point| point[1]);
    let [top, middle, bottom] = points;
    let turn = cross(top, bottom, middle);
    if turn == 0 {
        return;
    }
    let first = first_centre(top[1]).max(clip.top);
    let last = first_centre(bottom[1]).min(clip.bottom);
    if first >= last {
        return;
    }
    let bend = first_centre(middle[1]).clamp(first, last);
    let mut long = Edge::new(top, bottom, first);
    let middle_is_right = turn < 0;
    for (mut short, rows) in [
        ((bend > first).then(|| Edge::new(top, middle, first)), first..bend),
        ((last > bend).then(|| Edge::new(middle, bottom, bend)), bend..last),
    ] {
        let Some(short) = &mut short else { continue };
        for row in rows {
            let (left, right) = if middle_is_right { (long.pixel, short.pixel) } else { (short.pixel, long.pixel) };
            let [left, right] = [left, right].map(|pixel| clip.column(pixel));
            if left < right {
                emit(row, left, right);
            }
            long.descend();
            short.descend();
        }
    }
}

/// Twice the signed area of `a b c`.
fn cross(a: [i32; 2], b: [i32; 2], c: [i32; 2]) -> i64 {
    let [ux, uy] = [i64::from(b[0] - a[0]), i64::from(b[1] - a[1])];
    let [vx, vy] = [i64::from(c[0] - a[0]), i64::from(c[1] - a[1])];
    ux * vy - uy * vx
}

/// Walks down an edge row by row in whole numbers: `pixel` is the first whose centre lies at or right of the edge.
struct Edge {
    pixel: i64,
    remainder: i64,
    step: i64,
    step_remainder: i64,
    divisor: i64,
}

impl Edge {
    fn new(from: [i32; 2], to: [i32; 2], row: i32) -> Self {
        let scale = i64::from(SUBPIXELS);
        let [dx, dy] = [i64::from(to[0] - from[0]), i64::from(to[1] - from[1])];
        let divisor = scale * dy;
        let down = i64::from(row) * scale + scale / 2 - i64::from(from[1]);
        // Rounding up: one less than the divisor is added before dividing.
        let numerator = (i64::from(from[0]) - scale / 2) * dy + down * dx + divisor - 1;
        Self {
            pixel: numerator.div_euclid(divisor),
            remainder: numerator.rem_euclid(divisor),
            step: (scale * dx).div_euclid(divisor),
            step_remainder: (scale * dx).rem_euclid(divisor),
            divisor,
        }
    }

    fn descend(&mut self) {
        self.pixel += self.step;
        self.remainder += self.step_remainder;
        if self.remainder >= self.divisor {
            self.remainder -= self.divisor;
            self.pixel += 1;
        }
    }
}

/// A value that changes linearly over the picture, by pixels.
#[derive(Clone, Copy)]
pub(in crate::gui) struct Plane {
    at_corner: f64,
    per_column: f64,
    per_row: f64,
}

impl Plane {
    /// From its value at the picture's corner and its slopes.
    pub(in crate::gui) fn new(at_corner: f64, per_column: f64, per_row: f64) -> Self {
        Self { at_corner, per_column, per_row }
    }

    /// Through values at three corners; `None` for a triangle without area.
    pub(in crate::gui) fn through(points: [[i32; 2]; 3], values: [f64; 3]) -> Option<Self> {
        let area = cross(points[0], points[1], points[2]);
        if area == 0 {
            return None;
        }
        let [a, b, c] = points.map(|point| point.map(f64::from));
        let (db, dc) = (values[1] - values[0], values[2] - values[0]);
        let scale = f64::from(SUBPIXELS) / area as f64;
        let per_column = (db * (c[1] - a[1]) - dc * (b[1] - a[1])) * scale;
        let per_row = (dc * (b[0] - a[0]) - db * (c[0] - a[0])) * scale;
        let [x, y] = a.map(|coordinate| coordinate / f64::from(SUBPIXELS));
        Some(Self { at_corner: values[0] - per_column * x - per_row * y, per_column, per_row })
    }

    /// The value at a place in pixels from the picture's corner.
    #[inline]
    pub(in crate::gui) fn at_place(&self, x_px: f64, y_px: f64) -> f64 {
        self.at_corner + self.per_column * x_px + self.per_row * y_px
    }

    /// The value at a pixel's centre.
    fn at(&self, column: i32, row: i32) -> f64 {
        self.at_place(f64::from(column) + 0.5, f64::from(row) + 0.5)
    }
}

/// Four channels that change linearly.
struct Gradient([Plane; 4]);

/// Fractional bits of a channel while it changes along a span.
const CHANNEL_BITS: u32 = 16;

impl Gradient {
    fn of_colors(points: [[i32; 2]; 3], colors: [u32; 3]) -> Option<Self> {
        let colors = colors.map(blend::unpack);
        let plane = |channel: usize| Plane::through(points, colors.map(|color| f64::from(color[channel])));
        Some(Self([plane(0)?, plane(1)?, plane(2)?, plane(3)?]))
    }

    /// Value at the first pixel and step to the next, in fixed point.
    fn start(&self, column: i32, row: i32) -> ([i32; 4], [i32; 4]) {
        const ONE: f64 = (1 << CHANNEL_BITS) as f64;
        let start = self.0.map(|plane| ((plane.at(column, row).clamp(0.0, 255.0) + 0.5) * ONE) as i32);
        let step = self.0.map(|plane| (plane.per_column.clamp(-255.0, 255.0) * ONE) as i32);
        (start, step)
    }
}

/// Packs channels in fixed point, held within 0 to 255.
#[inline]
fn pack_fixed(channels: [i32; 4]) -> u32 {
    blend::pack(channels.map(|channel| (channel >> CHANNEL_BITS).clamp(0, 255) as u8))
}

/// Where a pixel lies in the texture.
struct Place {
    planes: [Plane; 2],
    step: [i64; 2],
}

impl Place {
    fn new(points: [[i32; 2]; 3], uvs: [egui::Pos2; 3], texture: &Texture) -> Option<Self> {
        let us = uvs.map(|uv| f64::from(uv.x) * texture.width as f64);
        let vs = uvs.map(|uv| f64::from(uv.y) * texture.height as f64);
        let planes = [Plane::through(points, us)?, Plane::through(points, vs)?];
        Some(Self { planes, step: planes.map(|plane| to_texels(plane.per_column)) })
    }

    fn at(&self, column: i32, row: i32) -> [i64; 2] {
        self.planes.map(|plane| to_texels(plane.at(column, row)))
    }
}

/// Texels in fixed point.
fn to_texels(texels: f64) -> i64 {
    let bounded = if texels.is_finite() { texels.clamp(-1e6, 1e6) } else { 0.0 };
    (bounded * (1_i64 << TEXEL_BITS) as f64).round() as i64
}
