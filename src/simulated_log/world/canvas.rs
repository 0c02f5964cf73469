//! Painted surface: grey values over metres, with noise, strokes and shapes.

use super::texture::WorldTexture;
use crate::simulation::random::{RandomStream, mix};

/// Grey values from 0 to 255 over a rectangle in metres, rows from top to bottom.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    width: usize,
    height: usize,
    texels_per_m: f32,
    wrap: bool,
    values: Vec<f32>,
}

/// Rectangle on a canvas: left, top, width and height in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CanvasRectangle {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) w: f32,
    pub(crate) h: f32,
}

impl CanvasRectangle {
    pub(crate) fn new(x: f32, y: f32, w: f32, h: f32) -> Self {
        Self { x, y, w, h }
    }

    /// The area, reduced by a margin on every side (enlarged if negative).
    pub(crate) fn inset(self, margin: f32) -> Self {
        Self::new(self.x + margin, self.y + margin, self.w - 2.0 * margin, self.h - 2.0 * margin)
    }
}

/// Lattice of random values in `[−1, 1]`, with as many columns and rows as cells.
fn lattice(cells: [usize; 2], seed: u64) -> Vec<f32> {
    (0..cells[0] * cells[1])
        .map(|index| (mix(seed ^ (index as u64)) >> 40) as f32 * (2.0 / 16_777_216.0) - 1.0)
        .collect()
}

/// Position of each texel on a lattice along one axis: the cells before and after, and the smoothed weight of the
/// latter.
fn stations(texels: usize, cells: usize) -> Vec<(usize, usize, f32)> {
    (0..texels)
        .map(|index| {
            let place = (index as f32 + 0.5) * cells as f32 / texels as f32;
            let before = (place as usize).min(cells - 1);
            let fraction = place - before as f32;
            (before, (before + 1) % cells, fraction * fraction * (3.0 - 2.0 * fraction))
        })
        .collect()
}

impl Canvas {
    /// Canvas of this size in metres. The sides of a wrapping one are rounded to powers of two.
    pub(crate) fn new(width_m: f32, height_m: f32, texels_per_m: f32, wrap: bool, value: f32) -> Self {
        let side = |length_m: f32| (length_m * texels_per_m).round().max(1.0) as usize;
        let (mut width, mut height) = (side(width_m), side(height_m));
        let mut scale = texels_per_m;
        if wrap {
            (width, height) = (width.next_power_of_two(), height.next_power_of_two());
            scale = width as f32 / width_m;
        }
        Self { width, height, texels_per_m: scale, wrap, values: vec![value; width * height] }
    }

    pub(crate) fn size_m(&self) -> [f32; 2] {
        [self.width as f32 / self.texels_per_m, self.height as f32 / self.texels_per_m]
    }

    pub(crate) fn area(&self) -> CanvasRectangle {
        let [w, h] = self.size_m();
        CanvasRectangle::new(0.0, 0.0, w, h)
    }

    pub(crate) fn finish(self) -> WorldTexture {
        let texels: Vec<u8> = self.values.iter().map(|value| value.round().clamp(0.0, 255.0) as u8).collect();
        WorldTexture::new(self.width, self.height, &texels, self.wrap, self.texels_per_m)
    }

    /// Blends a value into one texel.
    fn blend(&mut self, x: i64, y: i64, value: f32, fraction: f32) {
        let (width, height) = (self.width as i64, self.height as i64);
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        if !inside && !self.wrap {
            return;
        }
        let place = (y.rem_euclid(height) * width + x.rem_euclid(width)) as usize;
        let slot = &mut self.values[place];
        *slot += (value - *slot) * fraction;
    }

    /// Adds fractal noise everywhere; `grain_m` is the size of the coarsest blotches.
    pub(crate) fn noise(&mut self, grain_m: f32, amplitude: f32, octaves: u32, random: &mut RandomStream) {
        let [w, h] = self.size_m();
        let mut cells = [w, h].map(|side| (side / grain_m).round().max(1.0) as usize);
        let mut weight = amplitude;
        for _ in 0..octaves {
            let values = lattice(cells, random.next_u64());
            let columns = stations(self.width, cells[0]);
            let rows = stations(self.height, cells[1]);
            for (line, (above, below, down)) in self.values.chunks_mut(self.width).zip(rows) {
                let (above, below) = (&values[above * cells[0]..][..cells[0]], &values[below * cells[0]..][..cells[0]]);
                for (value, (left, right, across)) in line.iter_mut().zip(&columns) {
                    let upper = above[*left] + (above[*right] - above[*left]) * across;
                    let lower = below[*left] + (below[*right] - below[*left]) * across;
                    *value += weight * (upper + (lower - upper) * down);
                }
            }
            weight *= 0.55;
            cells = cells.map(|count| 2 * count);
        }
    }

    /// Adds white noise of this amplitude to every texel.
    pub(crate) fn grain(&mut self, amplitude: f32, random: &mut RandomStream) {
        for value in &mut self.values {
            *value += amplitude * (random.unit() as f32 * 2.0 - 1.0);
        }
    }

    /// Fills a rectangle by `paint(x, y)` of metres from its corner, which returns a grey value and its weight.
    pub(crate) fn fill(&mut self, area: CanvasRectangle, mut paint: impl FnMut(f32, f32) -> (f32, f32)) {
        let scale = self.texels_per_m;
        let first = |from: f32| (from * scale - 0.5).ceil() as i64;
        for y in first(area.y)..first(area.y + area.h) {
            for x in first(area.x)..first(area.x + area.w) {
                let (value, fraction) = paint((x as f32 + 0.5) / scale - area.x, (y as f32 + 0.5) / scale - area.y);
                if fraction > 0.0 {
                    self.blend(x, y, value, fraction);
                }
            }
        }
    }

    pub(crate) fn rectangle(&mut self, area: CanvasRectangle, value: f32) {
        self.fill(area, |_, _| (value, 1.0));
    }

    /// Multiplies a rectangle by a brightness factor; its texture is kept.
    pub(crate) fn shade(&mut self, area: CanvasRectangle, factor: f32) {
        let scale = self.texels_per_m;
        let range = |from: f32, length: f32, size: usize| {
            let edge = |place: f32| ((place * scale).round().max(0.0) as usize).min(size);
            edge(from)..edge(from + length)
        };
        let columns = range(area.x, area.w, self.width);
        for row in range(area.y, area.h, self.height) {
            for value in &mut self.values[row * self.width..][columns.clone()] {
                *value *= factor;
            }
        }
    }

    /// Ellipse, rotated by an angle, with a border smoothed over a texel.
    pub(crate) fn ellipse(&mut self, centre: [f32; 2], radii: [f32; 2], angle: f32, value: f32, fraction: f32) {
        let reach = radii[0].max(radii[1]);
        let (sine, cosine) = angle.sin_cos();
        let soft = 1.0 / (self.texels_per_m * radii[0].min(radii[1]).max(1e-4));
        let area = CanvasRectangle::new(centre[0] - reach, centre[1] - reach, 2.0 * reach, 2.0 * reach);
        self.fill(area, |x, y| {
            let (dx, dy) = (x - reach, y - reach);
            let along = (dx * cosine + dy * sine) / radii[0];
            let across = (dy * cosine - dx * sine) / radii[1];
            let inside = (1.0 - along.hypot(across)) / soft + 0.5;
            (value, fraction * inside.clamp(0.0, 1.0))
        });
    }

    /// Straight stroke of this width, smoothed over a texel.
    pub(crate) fn stroke(&mut self, from: [f32; 2], to: [f32; 2], width: f32, value: f32, fraction: f32) {
        let half = 0.5 * width;
        let margin = half + 1.0 / self.texels_per_m;
        let area = CanvasRectangle::new(
            from[0].min(to[0]) - margin,
            from[1].min(to[1]) - margin,
            (from[0] - to[0]).abs() + 2.0 * margin,
            (from[1] - to[1]).abs() + 2.0 * margin,
        );
        let scale = self.texels_per_m;
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let square = (dx * dx + dy * dy).max(1e-9);
        self.fill(area, |x, y| {
            let (px, py) = (x + area.x - from[0], y + area.y - from[1]);
            let along = ((px * dx + py * dy) / square).clamp(0.0, 1.0);
            let distance = (px - along * dx).hypot(py - along * dy);
            (value, fraction * ((half - distance) * scale + 0.5).clamp(0.0, 1.0))
        });
    }

    /// Random curved line, such as a crack or a twig.
    pub(crate) fn wander(&mut self, start: [f32; 2], length: f32, width: f32, value: f32, random: &mut RandomStream) {
        let mut at = start;
        let mut angle = random.uniform(0.0, std::f64::consts::TAU) as f32;
        let step = 0.12_f32.min(0.25 * length);
        let mut walked = 0.0;
        while walked < length {
            angle += 0.7 * random.normal() as f32;
            let next = [at[0] + step * angle.cos(), at[1] + step * angle.sin()];
            self.stroke(at, next, width, value, 0.85);
            at = next;
            walked += step;
        }
    }

    /// Many short strokes in all directions: grass, straw, needles.
    pub(crate) fn hatch(&mut self, count: usize, length: f32, width: f32, grey: [f32; 2], random: &mut RandomStream) {
        let [w, h] = self.size_m();
        for _ in 0..count {
            let from = [random.unit() as f32 * w, random.unit() as f32 * h];
            let angle = random.uniform(0.0, std::f64::consts::TAU) as f32;
            let reach = length * random.uniform(0.4, 1.0) as f32;
            let to = [from[0] + reach * angle.cos(), from[1] + reach * angle.sin()];
            let value = random.uniform(f64::from(grey[0]), f64::from(grey[1])) as f32;
            self.stroke(from, to, width, value, 0.8);
        }
    }

    /// Many ellipses: gravel, leaves, stains.
    pub(super) fn dots(
        &mut self,
        count: usize,
        radius: [f32; 2],
        grey: [f32; 2],
        fraction: f32,
        random: &mut RandomStream,
    ) {
        let [w, h] = self.size_m();
        for _ in 0..count {
            let centre = [random.unit() as f32 * w, random.unit() as f32 * h];
            let size = random.uniform(f64::from(radius[0]), f64::from(radius[1])) as f32;
            let flat = random.uniform(0.45, 1.0) as f32;
            let angle = random.uniform(0.0, std::f64::consts::PI) as f32;
            let value = random.uniform(f64::from(grey[0]), f64::from(grey[1])) as f32;
            self.ellipse(centre, [size, size * flat], angle, value, fraction);
        }
    }

    /// Lines of random letters that fill an area.
    pub(crate) fn letters(&mut self, area: CanvasRectangle, letter_height: f32, value: f32, random: &mut RandomStream) {
        let cell = letter_height / 6.0;
        let mut y = area.y;
        while y + letter_height <= area.y + area.h {
            let mut x = area.x;
            while x + 4.0 * cell <= area.x + area.w {
                let pattern = random.next_u64();
                let blank = random.chance(0.13);
                for part in 0..18 {
                    let on = (pattern >> part) & 1 == 1 || part % 3 == 0;
                    if on && !blank {
                        let (column, row) = ((part % 3) as f32, (part / 3) as f32);
                        self.rectangle(CanvasRectangle::new(x + column * cell, y + row * cell, cell, cell), value);
                    }
                }
                x += 4.0 * cell;
            }
            y += 1.5 * letter_height;
        }
    }
}
