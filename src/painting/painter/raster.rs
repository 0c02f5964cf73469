//! Painting of textured meshes by triangles.

use egui::Rect;
use egui::epaint::{Mesh, Vertex};

use crate::mixing::mixed;

use super::blend;
use super::texture::{TEXEL_BITS, TexelKind, Texture, weight};
use super::triangle::{Clip, Gradient, Place, SUBPIXELS, first_centre, pack_fixed, spans, to_texels};

/// Largest coordinate in subpixels (32 768 pixels), so that products fit into 64 bits.
const MAX_COORDINATE: f32 = (1 << 23) as f32;

/// Rectangle of the image that one worker paints.
pub(super) struct Target<'a> {
    /// Pixels by row, each row as wide as `clip`.
    pub(super) pixels: &'a mut [u32],
    pub(super) clip: Clip,
}

impl Target<'_> {
    /// The pixels of a span inside the rectangle, and the number of its pixels to the left of them.
    #[inline]
    fn span(&mut self, row: i32, left: i32, right: i32) -> (i32, &mut [u32]) {
        let Clip { left: first, right: end, top, .. } = self.clip;
        let (begin, end) = (left.max(first), right.min(end));
        if begin >= end {
            return (0, &mut []);
        }
        let start = (row - top) as usize * (self.clip.right - first) as usize;
        (begin - left, &mut self.pixels[start + (begin - first) as usize..start + (end - first) as usize])
    }
}

/// The vertices of a mesh in subpixels.
pub(super) struct Snapped {
    /// Clip rectangle inside the image.
    clip: Clip,
    /// Position of each vertex; `None` if it is not finite.
    points: Vec<Option<[i32; 2]>>,
}

impl Snapped {
    /// `None` if the clip rectangle is outside the image.
    pub(super) fn new(mesh: &Mesh, clip_rect: Rect, pixels_per_point: f32, size_px: [u32; 2]) -> Option<Self> {
        let clip = Clip::new(clip_rect, pixels_per_point, size_px);
        if clip.left >= clip.right || clip.top >= clip.bottom {
            return None;
        }
        let snap = |coordinate: f32| {
            let subpixels = coordinate * pixels_per_point * SUBPIXELS as f32;
            rounded(subpixels.clamp(-MAX_COORDINATE, MAX_COORDINATE))
        };
        let points = mesh
            .vertices
            .iter()
            .map(|vertex| vertex.pos.is_finite().then(|| [snap(vertex.pos.x), snap(vertex.pos.y)]))
            .collect();
        Some(Self { clip, points })
    }
}

/// The nearest integer, halves away from zero.
#[inline]
fn rounded(number: f32) -> i32 {
    // In `f64` the sum is exact, so that halves are rounded correctly.
    let number = f64::from(number);
    (number + 0.5_f64.copysign(number)) as i32
}

#[derive(Clone, Copy)]
pub(super) struct PreparedMesh<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) texture: &'a Texture,
    pub(super) snapped: &'a Snapped,
}

impl PreparedMesh<'_> {
    pub(super) fn triangles(&self) -> usize {
        self.mesh.indices.len() / 3
    }

    #[inline]
    fn corners(&self, triangle: usize) -> [usize; 3] {
        [0, 1, 2].map(|corner| self.mesh.indices[3 * triangle + corner] as usize)
    }

    /// Positions of the corners of a triangle; `None` if one is not finite.
    #[inline]
    fn points(&self, triangle: usize) -> Option<[[i32; 2]; 3]> {
        let [a, b, c] = self.corners(triangle).map(|corner| self.snapped.points.get(corner).copied().flatten());
        Some([a?, b?, c?])
    }

    /// Pixels that a triangle may touch; `None` if it is outside the clip rectangle.
    fn reach(&self, triangle: usize) -> Option<Clip> {
        let points = self.points(triangle)?;
        let [across, down] = [0, 1].map(|axis| points.map(|point| point[axis]));
        let first = |values: [i32; 3]| first_centre(values[0].min(values[1]).min(values[2]));
        let end = |values: [i32; 3]| first_centre(values[0].max(values[1]).max(values[2]));
        let clip = &self.snapped.clip;
        let reach = Clip {
            left: first(across).max(clip.left),
            top: first(down).max(clip.top),
            right: end(across).min(clip.right),
            bottom: end(down).min(clip.bottom),
        };
        let is_inked =
            || self.corners(triangle).iter().any(|corner| self.mesh.vertices[*corner].color.to_array() != [0; 4]);
        (reach.left < reach.right && reach.top < reach.bottom && is_inked()).then_some(reach)
    }

    /// Hash of each vertex: position, texture position and colour.
    fn vertex_hashes(&self) -> Vec<u64> {
        self.mesh.vertices.iter().zip(&self.snapped.points).map(|(vertex, point)| hash_of(vertex, *point)).collect()
    }

    /// Calls `emit(triangle, reach, hash)` for each triangle inside the clip rectangle: the pixels that it may touch and a
    /// hash; triangles with the same hash have the same pixels.
    pub(super) fn for_each_visible(&self, mut emit: impl FnMut(usize, Clip, u64)) {
        let vertices = self.vertex_hashes();
        let Clip { left, top, right, bottom } = self.snapped.clip;
        let pair = |a: i32, b: i32| (a as u64) << 32 | u64::from(b as u32);
        let clip = mixed(pair(left, top), pair(right, bottom));
        for triangle in 0..self.triangles() {
            let Some(reach) = self.reach(triangle) else { continue };
            let corners = self.corners(triangle);
            let [a, b, c] = corners.map(|corner| vertices[corner]);
            let uvs = corners.map(|corner| self.mesh.vertices[corner].uv);
            let texels = if uvs[0] == uvs[1] && uvs[1] == uvs[2] {
                u64::from(self.texel_at(uvs[0]))
            } else {
                // A bit above every texel value, which has 32 bits.
                self.texture.version(uvs.map(|uv| uv.y)) | 1 << 63
            };
            emit(triangle, reach, mixed(mixed(mixed(a, b), c), mixed(clip, texels)));
        }
    }

    /// Paints the pixels of a triangle inside a rectangle.
    pub(super) fn paint(&self, triangle: usize, target: &mut Target<'_>) {
        let (rows, clip) = (&target.clip, self.snapped.clip);
        let clip = Clip { top: clip.top.max(rows.top), bottom: clip.bottom.min(rows.bottom), ..clip };
        let Some(points) = self.points(triangle) else { return };
        let vertices = self.corners(triangle).map(|corner| &self.mesh.vertices[corner]);
        self.paint_triangle(points, vertices, clip, target);
    }

    fn paint_triangle(&self, points: [[i32; 2]; 3], vertices: [&Vertex; 3], clip: Clip, target: &mut Target<'_>) {
        let colors = vertices.map(|vertex| blend::pack(vertex.color.to_array()));
        let one_color = colors[0] == colors[1] && colors[1] == colors[2];
        let uvs = vertices.map(|vertex| vertex.uv);
        let untextured = uvs[0] == uvs[1] && uvs[1] == uvs[2];
        match (untextured, one_color) {
            (true, true) => {
                let texel = self.texel_at(uvs[0]);
                let color = if texel == u32::MAX { colors[0] } else { blend::multiply(texel, colors[0]) };
                spans(points, clip, |row, left, right| fill(target.span(row, left, right).1, color));
            }
            (true, false) => {
                let texel = self.texel_at(uvs[0]);
                let colors = colors.map(|color| if texel == u32::MAX { color } else { blend::multiply(texel, color) });
                let Some(gradient) = Gradient::of_colors(points, colors) else { return };
                spans(points, clip, |row, left, right| {
                    let (skipped, pixels) = target.span(row, left, right);
                    if pixels.is_empty() {
                        return;
                    }
                    let mut color = gradient.start(left, row, skipped);
                    for pixel in pixels {
                        *pixel = blend::over(*pixel, pack_fixed(color));
                        for channel in 0..4 {
                            color[channel] = color[channel].wrapping_add(gradient.step[channel]);
                        }
                    }
                });
            }
            (false, one_color) => {
                let Some(place) = Place::new(points, uvs, self.texture) else { return };
                if one_color {
                    spans(points, clip, |row, left, right| {
                        let (skipped, pixels) = target.span(row, left, right);
                        if !pixels.is_empty() {
                            self.texture_span(place.at(left, row, skipped), place.step, colors[0], pixels);
                        }
                    });
                } else {
                    let Some(gradient) = Gradient::of_colors(points, colors) else { return };
                    spans(points, clip, |row, left, right| {
                        let (skipped, pixels) = target.span(row, left, right);
                        if pixels.is_empty() {
                            return;
                        }
                        let mut color = gradient.start(left, row, skipped);
                        let [mut u, mut v] = place.at(left, row, skipped);
                        for pixel in pixels {
                            let source = blend::multiply(self.texture.sample(u, v), pack_fixed(color));
                            *pixel = blend::over(*pixel, source);
                            (u, v) = (u.wrapping_add(place.step[0]), v.wrapping_add(place.step[1]));
                            for channel in 0..4 {
                                color[channel] = color[channel].wrapping_add(gradient.step[channel]);
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

    /// Paints a span of one colour times the texture, starting at a texture position.
    fn texture_span(&self, [mut u, mut v]: [i64; 2], [step_u, step_v]: [i64; 2], color: u32, pixels: &mut [u32]) {
        const ONE: i64 = 1 << TEXEL_BITS;
        const HALF: i64 = ONE / 2;
        let texture = self.texture;
        // An image in its own colours hides what is below it.
        let covers = texture.kind == TexelKind::Opaque && color == u32::MAX;
        let put = |pixel: &mut u32, texel: u32| {
            if covers {
                *pixel = texel;
            } else if texel != 0 {
                *pixel = blend::over(*pixel, tinted(texture.kind, texel, color));
            }
        };
        if step_v != 0 {
            for pixel in pixels {
                put(pixel, texture.sample(u, v));
                (u, v) = (u.wrapping_add(step_u), v.wrapping_add(step_v));
            }
            return;
        }
        if texture.is_nearest() {
            let row = texture.row(v >> TEXEL_BITS);
            for pixel in pixels {
                put(pixel, row[texture.column(u >> TEXEL_BITS)]);
                u = u.wrapping_add(step_u);
            }
            return;
        }
        // The texture is axis-aligned, as for glyphs and images: two rows of texels are enough for the span.
        (u, v) = (u - HALF, v - HALF);
        let (upper, lower) = (texture.row(v >> TEXEL_BITS), texture.row((v >> TEXEL_BITS) + 1));
        let down = weight(v);
        // One texel per pixel, as for glyphs: positions are so close to texel centres that every weight is 0 or 1.
        let nearest = (u + HALF) >> TEXEL_BITS;
        let off = (u - (nearest << TEXEL_BITS)).abs() + (step_u - ONE).abs().saturating_mul(pixels.len() as i64);
        if off < ONE / 512 && (down == 0 || down == 256) {
            let row = if down == 0 { upper } else { lower };
            let inside = usize::try_from(nearest).ok().and_then(|first| row.get(first..first + pixels.len()));
            if let Some(texels) = inside {
                pixels.iter_mut().zip(texels).for_each(|(pixel, texel)| put(pixel, *texel));
            } else {
                for (pixel, column) in pixels.iter_mut().zip(nearest..) {
                    put(pixel, row[texture.column(column)]);
                }
            }
            return;
        }
        for pixel in pixels {
            put(pixel, texture.between(upper, lower, u, down));
            u = u.wrapping_add(step_u);
        }
    }
}

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

fn hash_of(vertex: &Vertex, point: Option<[i32; 2]>) -> u64 {
    let [x, y] = point.unwrap_or([i32::MIN; 2]);
    let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    let place = mixed(pair(x as u32, y as u32), pair(vertex.uv.x.to_bits(), vertex.uv.y.to_bits()));
    mixed(place, u64::from(u32::from_le_bytes(vertex.color.to_array())))
}
