//! Pixels of a triangle by rows, and linear interpolation over it.

use egui::Rect;

use super::blend;
use super::texture::{TEXEL_BITS, Texture};

/// Subpixel resolution to which vertices are snapped, per pixel.
pub const SUBPIXELS: i32 = 256;

/// Pixels `left..right` of rows `top..bottom`.
#[derive(Clone, Copy, Default)]
pub struct Clip {
    pub left: i32,
    pub top: i32,
    pub right: i32,
    pub bottom: i32,
}

impl Clip {
    /// A clip rectangle with the rounding of the scissor rectangle in egui's renderer.
    pub(super) fn new(rect: Rect, pixels_per_point: f32, size_px: [u32; 2]) -> Self {
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

/// The first pixel whose centre is at or after a subpixel coordinate.
pub(super) fn first_centre(subpixels: i32) -> i32 {
    (subpixels + SUBPIXELS / 2 - 1) >> SUBPIXELS.trailing_zeros()
}

/// Calls `emit(row, left, right)` for each row of a triangle with at least one pixel centre inside (top-left rule).
#[inline]
pub fn spans(mut points: [[i32; 2]; 3], clip: Clip, mut emit: impl FnMut(i32, i32, i32)) {
    points.sort_unstable_by_key(|point| point[1]);
    let [top, middle, bottom] = points;
    let doubled_area = cross(top, bottom, middle);
    if doubled_area == 0 {
        return;
    }
    let first = first_centre(top[1]).max(clip.top);
    let last = first_centre(bottom[1]).min(clip.bottom);
    if first >= last {
        return;
    }
    let bend = first_centre(middle[1]).clamp(first, last);
    let mut long = Edge::new(top, bottom, first);
    let middle_is_right = doubled_area < 0;
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

/// An edge traversed by rows in integers: `pixel` is the first pixel whose centre is at or to the right of the edge.
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
        // Rounded up by adding the divisor minus one before the division.
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

/// The common terms of all planes over one triangle.
struct Slopes {
    /// First corner, and vectors from it to the others, in subpixels.
    corner: [f64; 2],
    second: [f64; 2],
    third: [f64; 2],
    scale: f64,
}

impl Slopes {
    /// `None` for a triangle without area.
    fn of(points: [[i32; 2]; 3]) -> Option<Self> {
        let area = cross(points[0], points[1], points[2]);
        let [a, b, c] = points.map(|point| point.map(f64::from));
        let from_a = |corner: [f64; 2]| [corner[0] - a[0], corner[1] - a[1]];
        let scale = f64::from(SUBPIXELS) / area as f64;
        (area != 0).then(|| Self { corner: a, second: from_a(b), third: from_a(c), scale })
    }

    /// Plane through values at the corners.
    #[inline]
    fn plane(&self, values: [f64; 3]) -> Plane {
        let (db, dc) = (values[1] - values[0], values[2] - values[0]);
        let per_column = (db * self.third[1] - dc * self.second[1]) * self.scale;
        let per_row = (dc * self.second[0] - db * self.third[0]) * self.scale;
        let [x, y] = self.corner.map(|coordinate| coordinate / f64::from(SUBPIXELS));
        Plane { at_corner: values[0] - per_column * x - per_row * y, per_column, per_row }
    }
}

/// A value that is linear over the image, per pixel.
#[derive(Clone, Copy)]
pub struct Plane {
    at_corner: f64,
    per_column: f64,
    per_row: f64,
}

impl Plane {
    /// Plane given by its value at the image's corner and its slopes.
    pub fn new(at_corner: f64, per_column: f64, per_row: f64) -> Self {
        Self { at_corner, per_column, per_row }
    }

    /// Plane through values at three corners; `None` for a triangle without area.
    pub fn through(points: [[i32; 2]; 3], values: [f64; 3]) -> Option<Self> {
        Slopes::of(points).map(|slopes| slopes.plane(values))
    }

    /// The value at a position in pixels from the image's corner.
    #[inline]
    pub fn at_place(&self, x_px: f64, y_px: f64) -> f64 {
        self.at_corner + self.per_column * x_px + self.per_row * y_px
    }

    /// The value at a pixel's centre.
    fn at(&self, column: i32, row: i32) -> f64 {
        self.at_place(f64::from(column) + 0.5, f64::from(row) + 0.5)
    }
}

/// Four channels that are linear over a triangle.
pub(super) struct Gradient {
    at_corner: [f64; 4],
    per_column: [f64; 4],
    per_row: [f64; 4],
    /// Increment per pixel, in fixed point.
    pub(super) step: [i32; 4],
}

/// Fractional bits of a channel along a span.
const CHANNEL_BITS: u32 = 16;
/// One unit of a channel in fixed point.
const CHANNEL_ONE: f64 = (1 << CHANNEL_BITS) as f64;

impl Gradient {
    pub(super) fn of_colors(points: [[i32; 2]; 3], colors: [u32; 3]) -> Option<Self> {
        let colors = colors.map(blend::unpack);
        let slopes = Slopes::of(points)?;
        let planes = [0, 1, 2, 3].map(|channel| slopes.plane(colors.map(|color| f64::from(color[channel]))));
        Some(Self {
            at_corner: planes.map(|plane| plane.at_corner),
            per_column: planes.map(|plane| plane.per_column),
            per_row: planes.map(|plane| plane.per_row),
            step: planes.map(|plane| (plane.per_column.clamp(-255.0, 255.0) * CHANNEL_ONE) as i32),
        })
    }

    /// Value at the pixel `steps` to the right of a span's first one, in fixed point.
    #[inline]
    pub(super) fn start(&self, column: i32, row: i32, steps: i32) -> [i32; 4] {
        let (x_px, y_px) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
        let mut exact = [0.0; 4];
        for channel in 0..4 {
            let value = self.at_corner[channel] + self.per_column[channel] * x_px + self.per_row[channel] * y_px;
            exact[channel] = (value.clamp(0.0, 255.0) + 0.5) * CHANNEL_ONE;
        }
        let mut start = exact.map(|value| value as i32);
        for channel in 0..4 {
            start[channel] = start[channel].wrapping_add(self.step[channel].wrapping_mul(steps));
        }
        start
    }
}

/// Packs channels in fixed point, limited to 0 to 255.
#[inline]
pub(super) fn pack_fixed(channels: [i32; 4]) -> u32 {
    blend::pack(channels.map(|channel| (channel >> CHANNEL_BITS).clamp(0, 255) as u8))
}

/// Texture position of a pixel.
pub(super) struct Place {
    planes: [Plane; 2],
    pub(super) step: [i64; 2],
}

impl Place {
    pub(super) fn new(points: [[i32; 2]; 3], uvs: [egui::Pos2; 3], texture: &Texture) -> Option<Self> {
        let us = uvs.map(|uv| f64::from(uv.x) * texture.width as f64);
        let vs = uvs.map(|uv| f64::from(uv.y) * texture.height as f64);
        let slopes = Slopes::of(points)?;
        let planes = [slopes.plane(us), slopes.plane(vs)];
        Some(Self { planes, step: planes.map(|plane| to_texels(plane.per_column)) })
    }

    /// The position at the pixel `steps` to the right of a span's first one.
    #[inline]
    pub(super) fn at(&self, column: i32, row: i32, steps: i32) -> [i64; 2] {
        let [u, v] = self.planes.map(|plane| to_texels(plane.at(column, row)));
        let skipped = |step: i64| step.wrapping_mul(i64::from(steps));
        [u.wrapping_add(skipped(self.step[0])), v.wrapping_add(skipped(self.step[1]))]
    }
}

/// Texels in fixed point.
pub(super) fn to_texels(texels: f64) -> i64 {
    let bounded = if texels.is_finite() { texels.clamp(-1e6, 1e6) } else { 0.0 };
    (bounded * (1_i64 << TEXEL_BITS) as f64).round() as i64
}
