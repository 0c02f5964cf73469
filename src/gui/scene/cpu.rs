//! Draws a scene on the CPU with four samples per pixel, at the sample positions of graphics cards; each sample has a
//! depth.

use egui::{Color32, ColorImage};
use rayon::prelude::*;

use super::camera;
use super::layout::{Disc, ImageCorner, ImageShape, SceneDrawing, Segment};
use crate::painting::painter::blend;
use crate::painting::painter::triangle::{Clip, Plane, SUBPIXELS, spans};

/// Positions of the samples in a pixel, in 1/256 pixel: the standard pattern of four.
const SAMPLES: [[i32; 2]; 4] = [[96, 32], [224, 96], [32, 160], [160, 224]];
/// Number of rows that one worker draws at a time.
const BAND_ROWS: usize = 32;

/// Draws everything except the labels.
pub(super) fn draw(drawing: &SceneDrawing) -> ColorImage {
    let [width, height] = drawing.size_px.map(|side| side as usize);
    let background = blend::pack(drawing.background.to_array());
    let mut pixels = vec![Color32::TRANSPARENT; width * height];
    if width > 0 {
        let bands = height.div_ceil(BAND_ROWS);
        let segments = sort_into_bands(&drawing.segments, bands, |segment| {
            let reach = 2.0 * segment.half_width_px;
            let (from, to) = (segment.from[1], segment.to[1]);
            (from.min(to) - reach, from.max(to) + reach)
        });
        let discs = sort_into_bands(&drawing.discs, bands, |disc| {
            (disc.centre[1] - disc.radius_px - 1.0, disc.centre[1] + disc.radius_px + 1.0)
        });
        let rows = pixels.par_chunks_mut(width * BAND_ROWS).zip(segments).zip(discs).enumerate();
        rows.for_each_init(Band::default, |band, (number, ((rows, segments), discs))| {
            band.begin(width, rows.len() / width, number * BAND_ROWS, background);
            for image_shape in &drawing.images {
                band.image_shape(image_shape);
            }
            for triangle in drawing.corners.chunks_exact(3) {
                let color = blend::pack(triangle[0].color);
                band.triangle([triangle[0].position, triangle[1].position, triangle[2].position], |_, _, _| color);
            }
            for segment in segments {
                band.segment(segment);
            }
            for disc in discs {
                band.disc(disc);
            }
            band.resolve(rows);
        });
    }
    ColorImage::new([width, height], pixels)
}

/// The shapes that touch each band, in order; `reach_px` returns the first and last row of a shape.
fn sort_into_bands<T>(shapes: &[T], bands: usize, reach_px: impl Fn(&T) -> (f32, f32)) -> Vec<Vec<&T>> {
    let mut sorted = vec![Vec::new(); bands];
    for shape in shapes {
        let (top, bottom) = reach_px(shape);
        // NaN becomes 0 and infinity the last band; both are skipped when drawn.
        let band_of = |row: f32| (row.max(0.0) as usize) / BAND_ROWS;
        let (first, end) = (band_of(top), band_of(bottom).saturating_add(1).min(bands));
        if bottom >= 0.0 && first < end {
            for band in &mut sorted[first..end] {
                band.push(shape);
            }
        }
    }
    sorted
}

/// The samples of some rows; one worker reuses it for several bands.
#[derive(Default)]
struct Band {
    clip: Clip,
    width: usize,
    planes: [SamplePlane; SAMPLES.len()],
}

/// One sample of each pixel.
#[derive(Default)]
struct SamplePlane {
    colors: Vec<u32>,
    depths: Vec<f32>,
}

impl Band {
    /// Clears the band for other rows.
    fn begin(&mut self, width: usize, rows: usize, first_row: usize, background: u32) {
        self.clip = Clip { left: 0, top: first_row as i32, right: width as i32, bottom: (first_row + rows) as i32 };
        self.width = width;
        for plane in &mut self.planes {
            plane.colors.clear();
            plane.colors.resize(width * rows, background);
            plane.depths.clear();
            plane.depths.resize(width * rows, 0.0);
        }
    }

    fn misses(&self, top_px: f32, bottom_px: f32) -> bool {
        bottom_px < self.clip.top as f32 || top_px > self.clip.bottom as f32
    }

    /// A triangle whose colour depends on column, row (of the sample, in pixels) and depth.
    fn triangle(&mut self, corners: [[f32; 3]; 3], color: impl Fn(f64, f64, f64) -> u32) {
        let heights = corners.map(|corner| corner[1]);
        if self.misses(heights[0].min(heights[1]).min(heights[2]), heights[0].max(heights[1]).max(heights[2])) {
            return;
        }
        let points = corners.map(snap);
        let Some(depth) = Plane::through(points, corners.map(|corner| f64::from(corner[2]))) else { return };
        self.polygon(&[points], &depth, color);
    }

    /// Triangles in one plane, already snapped to subpixels.
    fn polygon(&mut self, triangles: &[[[i32; 2]; 3]], depth: &Plane, color: impl Fn(f64, f64, f64) -> u32) {
        let clip = self.clip;
        for (plane, [sample_x, sample_y]) in self.planes.iter_mut().zip(SAMPLES) {
            // A sample is covered if the pixel's centre is, displaced by their difference.
            let (dx, dy) = (SUBPIXELS / 2 - sample_x, SUBPIXELS / 2 - sample_y);
            let (off_x, off_y) = (-f64::from(dx) / f64::from(SUBPIXELS), -f64::from(dy) / f64::from(SUBPIXELS));
            for triangle in triangles {
                let moved = triangle.map(|[x, y]| [x + dx, y + dy]);
                spans(moved, clip, |row, left, right| {
                    let start = (row - clip.top) as usize * self.width;
                    let y = f64::from(row) + 0.5 + off_y;
                    for column in left..right {
                        let x = f64::from(column) + 0.5 + off_x;
                        let here = depth.at_place(x, y);
                        let at = start + column as usize;
                        if here as f32 >= plane.depths[at] {
                            plane.depths[at] = here as f32;
                            plane.colors[at] = color(x, y, here);
                        }
                    }
                });
            }
        }
    }

    fn segment(&mut self, segment: &Segment) {
        let half = segment.half_width_px;
        let ([x0, y0, z0], [x1, y1, z1]) = (segment.from, segment.to);
        let length = camera::length(f64::from(x1 - x0), f64::from(y1 - y0)) as f32;
        if length < 1e-3 {
            return self.disc(&Disc { centre: segment.from, radius_px: half, color: segment.color });
        }
        let (ux, uy) = ((x1 - x0) / length, (y1 - y0) / length);
        // Extended slightly at both ends, so that bends have no notch.
        let (ex, ey) = (0.5 * half * ux, 0.5 * half * uy);
        let (nx, ny) = (-uy * half, ux * half);
        let quad = [
            [x0 - ex + nx, y0 - ey + ny, 0.0],
            [x0 - ex - nx, y0 - ey - ny, 0.0],
            [x1 + ex - nx, y1 + ey - ny, 0.0],
            [x1 + ex + nx, y1 + ey + ny, 0.0],
        ]
        .map(snap);
        let slope = f64::from(z1 - z0) / f64::from(length);
        let (per_column, per_row) = (slope * f64::from(ux), slope * f64::from(uy));
        let at_origin = f64::from(z0) - per_column * f64::from(x0) - per_row * f64::from(y0);
        let depth = Plane::new(at_origin, per_column, per_row);
        let color = blend::pack(segment.color);
        let [a, b, c, d] = quad;
        self.polygon(&[[a, b, c], [a, c, d]], &depth, |_, _, _| color);
    }

    fn disc(&mut self, disc: &Disc) {
        let [x, y, depth] = disc.centre;
        let radius = disc.radius_px;
        let color = blend::pack(disc.color);
        let clip = self.clip;
        for (plane, sample) in self.planes.iter_mut().zip(SAMPLES) {
            let [off_x, off_y] = sample.map(|offset| offset as f32 / SUBPIXELS as f32);
            let top = ((y - radius - off_y).ceil() as i32).max(clip.top);
            let bottom = ((y + radius - off_y).floor() as i32 + 1).min(clip.bottom);
            for row in top..bottom {
                let down = row as f32 + off_y - y;
                let reach = (radius * radius - down * down).max(0.0).sqrt();
                let left = ((x - reach - off_x).ceil() as i32).clamp(clip.left, clip.right);
                let right = ((x + reach - off_x).floor() as i32 + 1).clamp(left, clip.right);
                let start = (row - clip.top) as usize * self.width;
                for at in start + left as usize..start + right as usize {
                    if depth >= plane.depths[at] {
                        plane.depths[at] = depth;
                        plane.colors[at] = color;
                    }
                }
            }
        }
    }

    fn image_shape(&mut self, image_shape: &ImageShape) {
        for triangle in image_shape.corners.chunks_exact(3) {
            self.image_triangle([triangle[0], triangle[1], triangle[2]], image_shape);
        }
    }

    fn image_triangle(&mut self, corners: [ImageCorner; 3], image_shape: &ImageShape) {
        let image = &image_shape.image;
        if image.pixels.len() < image.width * image.height || image.pixels.is_empty() {
            return;
        }
        let positions = corners.map(|corner| corner.position);
        let points = positions.map(snap);
        // Depth is proportional to 1/distance, so values divided by the distance are linear over the screen.
        let over_distance = |axis: usize, size: usize| {
            let values = corners.map(|corner| f64::from(corner.uv[axis]) * size as f64 * f64::from(corner.position[2]));
            Plane::through(points, values)
        };
        let (Some(across), Some(down)) = (over_distance(0, image.width), over_distance(1, image.height)) else {
            return;
        };
        self.triangle(positions, |x, y, depth| {
            let column = across.at_place(x, y) / depth;
            let row = down.at_place(x, y) / depth;
            let grey = image.pixels[clamped(row, image.height) * image.width + clamped(column, image.width)];
            blend::pack([grey, grey, grey, 255])
        });
    }

    /// Averages the samples of each pixel.
    fn resolve(&self, rows: &mut [Color32]) {
        let [a, b, c, d] = &self.planes;
        for (index, pixel) in rows.iter_mut().enumerate() {
            let samples = [a.colors[index], b.colors[index], c.colors[index], d.colors[index]];
            let average = if samples == [samples[0]; 4] { samples[0] } else { blend::average(samples) };
            let [red, green, blue, alpha] = blend::unpack(average);
            *pixel = Color32::from_rgba_premultiplied(red, green, blue, alpha);
        }
    }
}

fn clamped(coordinate: f64, size: usize) -> usize {
    (coordinate.max(0.0) as usize).min(size - 1)
}

/// Pixels to subpixels, limited to the range of integer edges.
fn snap([x, y, _]: [f32; 3]) -> [i32; 2] {
    const MAX_COORDINATE: f32 = (1 << 22) as f32;
    [x, y].map(|pixels| (pixels * SUBPIXELS as f32).round().clamp(-MAX_COORDINATE, MAX_COORDINATE) as i32)
}
