use std::ops::Range;

use nalgebra::Vector2;

use crate::camera::CameraModel;
use crate::simulated_log::world::{axes, lanes};

/// Samples per pixel. Each has its own row and column in the pixel, so that edges in any direction are smooth.
pub(super) const SAMPLES: usize = 8;

/// Offsets of the samples from the pixel centre, in pixels.
pub(super) const OFFSETS_PX: [[f32; 2]; SAMPLES] = offsets();

const fn offsets() -> [[f32; 2]; SAMPLES] {
    let mut offsets = [[0.0; 2]; SAMPLES];
    let mut k = 0;
    while k < SAMPLES {
        // Eight rooks that do not attack each other.
        let column = (3 * k) % SAMPLES;
        offsets[k] = [(column as f32 + 0.5) / SAMPLES as f32 - 0.5, (k as f32 + 0.5) / SAMPLES as f32 - 0.5];
        k += 1;
    }
    offsets
}

/// Marks a pixel outside the lens.
const DARK: f32 = f32::NAN;

/// Camera prepared for rendering: the ray of every pixel, and the positions of its eight samples in the sample grid.
///
/// The sample grid belongs to a pinhole camera wide enough for all rays.
#[derive(Clone, Debug)]
pub(crate) struct RenderedView {
    pub(super) width: usize,
    pub(super) height: usize,
    /// `x/z` and `y/z` per pixel; NaN outside the lens.
    pub(super) rays: Vec<[f32; 2]>,
    pub(super) grid: Grid,
    /// Positions of each pixel's samples in the grid; `None` if they are the rows of its column.
    pub(super) places: Option<Vec<[u32; SAMPLES]>>,
}

/// Sample grid, with one column and [`SAMPLES`] rows per pixel: sample `(i, j)` has the ray
/// `(origin.x + (i + shift_j)·step.x, origin.y + j·step.y, 1)`, where row `j` has the shift `shift_j`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) origin: [f64; 2],
    pub(super) step: [f64; 2],
}

/// Ray of a pixel and its differences to the neighbours.
#[derive(Clone, Copy)]
pub(super) struct PixelRay {
    pub(super) ray: [f32; 2],
    pub(super) right: [f32; 2],
    pub(super) down: [f32; 2],
}

/// Rays of some pixels by component, for vectorization.
#[derive(Clone, Copy)]
pub(super) struct Rays<const N: usize> {
    pub(super) ray: [[f32; N]; 2],
    pub(super) right: [[f32; N]; 2],
    pub(super) down: [[f32; N]; 2],
}

impl From<PixelRay> for Rays<1> {
    #[inline]
    fn from(PixelRay { ray, right, down }: PixelRay) -> Self {
        let lane = |[x, y]: [f32; 2]| [[x], [y]];
        Self { ray: lane(ray), right: lane(right), down: lane(down) }
    }
}

impl RenderedView {
    pub(crate) fn new(model: &CameraModel) -> Self {
        let [width, height] = model.resolution_px;
        let ray = |u: f64, v: f64| {
            let bearing = model.unproject(&Vector2::new(u, v)).filter(|bearing| bearing.z > 0.05);
            bearing.map(|bearing| [bearing.x / bearing.z, bearing.y / bearing.z])
        };
        let mut rays = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let ray = ray(column as f64, row as f64);
                rays.push(ray.map_or([DARK; 2], |ray| ray.map(|component| component as f32)));
            }
        }
        let regular = model.distortion == crate::camera::Distortion::None
            && model.projection == crate::camera::Projection::Pinhole;
        let [fx, fy, cx, cy] = model.intrinsics_px;
        let first = f64::from(OFFSETS_PX[0][1]);
        let step = [1.0 / fx, 1.0 / (fy * SAMPLES as f64)];
        if regular {
            let origin = [-cx / fx, (first - cy) / fy];
            let grid = Grid { columns: width, rows: height * SAMPLES, origin, step };
            return Self { width, height, rays, grid, places: None };
        }
        let bound = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
            rays.iter().map(|ray| f64::from(ray[axis])).filter(|value| value.is_finite()).fold(start, pick)
        };
        let margin = 2.0;
        let origin = [0, 1].map(|axis| bound(axis, f64::min, 0.0) - margin * step[axis]);
        let end = [0, 1].map(|axis| bound(axis, f64::max, 0.0) + margin * step[axis]);
        let count = [0, 1].map(|axis: usize| ((end[axis] - origin[axis]) / step[axis]).ceil() as usize + 1);
        let grid = Grid { columns: count[0], rows: count[1], origin, step };
        let mut view = Self { width, height, rays, grid, places: None };
        let mut places = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let Some(PixelRay { ray, right, down }) = view.pixel_ray(column, row) else {
                    places.push([0; SAMPLES]);
                    continue;
                };
                places.push(OFFSETS_PX.map(|offset| {
                    let [x, y] = offset.map(f64::from);
                    let within =
                        |axis: usize| f64::from(ray[axis]) + x * f64::from(right[axis]) + y * f64::from(down[axis]);
                    grid.nearest([within(0), within(1)])
                }));
            }
        }
        view.places = Some(places);
        view
    }

    /// Bands of at most this many rows, from the top down.
    pub(crate) fn bands(&self, rows: usize) -> impl Iterator<Item = Range<usize>> + use<> {
        let height = self.height;
        (0..height).step_by(rows.min(height)).map(move |top| top..(top + rows.min(height)).min(height))
    }

    /// Rows of the grid that contain the samples of some rows of pixels.
    pub(super) fn sample_rows(&self, pixels: Range<usize>) -> Range<usize> {
        let Some(places) = &self.places else { return pixels.start * SAMPLES..pixels.end * SAMPLES };
        if pixels.len() == self.height {
            return 0..self.grid.rows;
        }
        let places = places[pixels.start * self.width..pixels.end * self.width].iter().flatten();
        // Pixels outside the lens have their samples at 0.
        let seen = places.filter(|place| **place > 0).map(|place| *place as usize / self.grid.columns);
        let (first, last) = seen.fold((self.grid.rows, 0), |(first, last), row| (first.min(row), last.max(row)));
        first.min(last)..last + 1
    }

    /// Ray of a pixel with its differences to the neighbours; `None` outside the lens.
    #[inline]
    pub(super) fn pixel_ray(&self, column: usize, row: usize) -> Option<PixelRay> {
        let at = |x: usize, y: usize| self.rays[y * self.width + x];
        let ray = at(column, row);
        let difference = |to: [f32; 2], from: [f32; 2]| [to[0] - from[0], to[1] - from[1]];
        let right = if column + 1 < self.width {
            difference(at(column + 1, row), ray)
        } else {
            difference(ray, at(column.saturating_sub(1), row))
        };
        let down = if row + 1 < self.height {
            difference(at(column, row + 1), ray)
        } else {
            difference(ray, at(column, row.saturating_sub(1)))
        };
        let seen = ray[0].is_finite() && right[0].is_finite() && down[0].is_finite();
        seen.then_some(PixelRay { ray, right, down })
    }

    /// Rays of `N` pixels from a column on, all inside the lens; those past `end` repeat the last one.
    #[inline]
    pub(super) fn rays<const N: usize>(&self, columns: std::ops::Range<usize>, row: usize) -> Rays<N> {
        let line = |row: usize| &self.rays[row * self.width..][..self.width];
        let here = line(row);
        let inner = columns.start + N < self.width && row + 1 < self.height;
        if inner && columns.len() >= N {
            let rays: &[[f32; 2]] = &here[columns.start..=columns.start + N];
            let below: &[[f32; 2]] = &line(row + 1)[columns.start..][..N];
            return Rays {
                ray: axes(|axis| lanes(|k| rays[k][axis])),
                right: axes(|axis| lanes(|k| rays[k + 1][axis] - rays[k][axis])),
                down: axes(|axis| lanes(|k| below[k][axis] - rays[k][axis])),
            };
        }
        let mut rays = Rays { ray: [[0.0; N]; 2], right: [[0.0; N]; 2], down: [[0.0; N]; 2] };
        for k in 0..N {
            let column = (columns.start + k).min(columns.end - 1);
            let Some(PixelRay { ray, right, down }) = self.pixel_ray(column, row) else { continue };
            for axis in 0..2 {
                rays.ray[axis][k] = ray[axis];
                rays.right[axis][k] = right[axis];
                rays.down[axis][k] = down[axis];
            }
        }
        rays
    }

    pub(crate) fn pixels(&self) -> usize {
        self.width * self.height
    }
}

#[cfg(test)]
impl RenderedView {
    pub(crate) fn width(&self) -> usize {
        self.width
    }
}

impl Grid {
    /// Distance of the samples of a row to the right of whole columns.
    #[inline]
    pub(super) fn shift(row: usize) -> f64 {
        f64::from(OFFSETS_PX[row % SAMPLES][0])
    }

    /// Position of the sample nearest to a ray.
    fn nearest(&self, ray: [f64; 2]) -> u32 {
        let [x, y] = [0, 1].map(|axis: usize| (ray[axis] - self.origin[axis]) / self.step[axis]);
        let middle = (y.round().max(0.0) as usize).min(self.rows - 1);
        let reach = SAMPLES / 2;
        let mut best = (f64::MAX, 0);
        for row in middle.saturating_sub(reach)..(middle + reach + 1).min(self.rows) {
            let along = x - Self::shift(row);
            let column = (along.round().max(0.0) as usize).min(self.columns - 1);
            let away = (along - column as f64).powi(2) + ((y - row as f64) / SAMPLES as f64).powi(2);
            if away < best.0 {
                best = (away, row * self.columns + column);
            }
        }
        best.1 as u32
    }
}
