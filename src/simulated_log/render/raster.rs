//! Rasterization: the visible face at every sample.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use super::view::Grid;
use crate::geometry::RigidTransform;
use crate::simulated_log::world::{Affine, Bounds, World, axes};

/// Marks a sample of the sky.
pub(super) const SKY: u32 = u32::MAX;
/// Distance of the near plane.
const NEAR_M: f64 = 0.05;

/// Face in the frame of a camera: all quantities over depth are linear in the ray `(x, y, 1)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prepared {
    /// Inverse depth of the three corners, in 1/m.
    pub(super) inverse_depth: [f32; 3],
    /// Texture coordinates over depth, in metres.
    pub(super) texture_m: [[f32; 3]; 2],
    /// Sunlight at the three corners, divided by the depth.
    pub(super) sun: [f32; 3],
    pub(super) material: u32,
}

/// Product of a matrix and a vector with the roundings of nalgebra's, whose parts are not inlined over codegen units.
#[inline]
fn product(matrix: &Matrix3<f64>, vector: &Vector3<f64>) -> Vector3<f64> {
    let row = |row: usize| matrix[(row, 0)] * vector.x + matrix[(row, 1)] * vector.y + matrix[(row, 2)] * vector.z;
    Vector3::new(row(0), row(1), row(2))
}

/// Camera pose: transforms points of the world into the camera frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eye {
    pub(super) camera_from_world: Matrix3<f64>,
    pub(super) centre_m: Vector3<f64>,
}

impl Eye {
    pub(super) fn new(world_from_camera: &RigidTransform) -> Self {
        Self {
            camera_from_world: world_from_camera.rotation_matrix().transpose(),
            centre_m: world_from_camera.translation_m,
        }
    }

    fn over_depth(&self, value: &Affine, inverse_depth: &Vector3<f64>) -> [f32; 3] {
        let at_centre = value.gradient.dot(&self.centre_m) + value.offset;
        let linear = product(&self.camera_from_world, &value.gradient) + inverse_depth * at_centre;
        [linear.x as f32, linear.y as f32, linear.z as f32]
    }
}

/// View frustum of some rows of the sample grid, in the camera frame: the space in front of the near plane and between
/// four planes through the camera centre.
struct Frustum {
    /// Unit normals that point outwards.
    sides: [Vector3<f64>; 4],
}

impl Frustum {
    /// Two samples wider than the rows on every side.
    fn new(grid: &Grid, shown: &Range<usize>) -> Self {
        let ray = |axis: usize, sample: f64| grid.origin[axis] + sample * grid.step[axis];
        let [left, right] = [ray(0, -2.0), ray(0, grid.columns as f64 + 2.0)];
        let [top, bottom] = [ray(1, shown.start as f64 - 2.0), ray(1, shown.end as f64 + 2.0)];
        let sides = [
            Vector3::new(-1.0, 0.0, left),
            Vector3::new(1.0, 0.0, -right),
            Vector3::new(0.0, -1.0, top),
            Vector3::new(0.0, 1.0, -bottom),
        ];
        Self { sides: sides.map(|side| side.normalize()) }
    }

    /// True if a part of a sphere may be visible.
    fn may_show(&self, bounds: &Bounds, eye: &Eye) -> bool {
        let centre_m = product(&eye.camera_from_world, &(bounds.centre_m - eye.centre_m));
        centre_m.z + bounds.radius_m > NEAR_M && self.sides.iter().all(|side| side.dot(&centre_m) <= bounds.radius_m)
    }
}

/// Outline of a face in the sample grid, prepared for drawing band by band.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// Range of its corners in `outline_points`; the first corner is repeated at the end.
    corners: Range<usize>,
    rows: Range<usize>,
    /// Inverse depth at the grid's first sample, and its increments per row and per column.
    inverse_depth: f64,
    down: f64,
    right: f64,
    /// Edges crossed by the previously drawn row.
    crossed: Option<[usize; 2]>,
}

/// Buffers of a thread, reused between images.
#[derive(Clone, Debug, Default)]
pub(crate) struct Workspace {
    /// For a band of the sample grid.
    pub(super) inverse_depth: Vec<f32>,
    pub(super) face: Vec<u32>,
    pub(super) prepared: Vec<Prepared>,
    pub(super) shapes: Vec<Shape>,
    pub(super) outline_points: Vec<[f64; 2]>,
    /// Face of each pixel of a row, or `MIXED`.
    pub(super) seen: Vec<u32>,
    /// Not 0 for the pixels of a row that show several faces.
    pub(super) differs: Vec<u32>,
}

impl Workspace {
    /// Projects the faces of a world that are visible in some rows of the grid: data for shading into `prepared`, data
    /// for drawing into `shapes`.
    pub(super) fn prepare(&mut self, world: &World, eye: &Eye, grid: &Grid, shown: &Range<usize>) {
        self.prepared.clear();
        self.shapes.clear();
        self.outline_points.clear();
        let frustum = Frustum::new(grid, shown);
        for face in &world.faces {
            // Most faces are elsewhere, in particular for a rolling shutter, which has a pose for every other row.
            if !frustum.may_show(&face.bounds, eye) {
                continue;
            }
            // Distance of the camera centre in front of the face.
            let before_m = face.normal.dot(&eye.centre_m) - face.distance;
            if before_m <= 1e-4 {
                continue;
            }
            let inverse_depth = product(&eye.camera_from_world, &face.normal) / -before_m;
            if !self.outline(&face.corners, &inverse_depth, eye, grid, shown) {
                continue;
            }
            self.prepared.push(Prepared {
                inverse_depth: [inverse_depth.x as f32, inverse_depth.y as f32, inverse_depth.z as f32],
                texture_m: axes(|axis| eye.over_depth(&face.texture_m[axis], &inverse_depth)),
                sun: eye.over_depth(&face.sun, &inverse_depth),
                material: face.material.0 as u32,
            });
        }
    }

    /// Adds a face's corners, clipped at the near plane, as a shape; returns false if it is outside these rows of the
    /// grid.
    fn outline(
        &mut self,
        corners: &[Vector3<f64>],
        inverse_depth: &Vector3<f64>,
        eye: &Eye,
        grid: &Grid,
        shown: &Range<usize>,
    ) -> bool {
        let first = self.outline_points.len();
        let seen = |corner: &Vector3<f64>| product(&eye.camera_from_world, &(corner - eye.centre_m));
        let Some(last) = corners.last() else { return false };
        let mut before = seen(last);
        for corner in corners {
            let point = seen(corner);
            if (before.z > NEAR_M) != (point.z > NEAR_M) {
                let fraction = (NEAR_M - before.z) / (point.z - before.z);
                self.outline_points.push(grid.place(&(before + (point - before) * fraction)));
            }
            if point.z > NEAR_M {
                self.outline_points.push(grid.place(&point));
            }
            before = point;
        }
        let outline = &self.outline_points[first..];
        let bound = |axis: usize, start: f64, pick: fn(f64, f64) -> f64| {
            outline.iter().map(|place| place[axis]).fold(start, pick)
        };
        let (left, right) = (bound(0, f64::MAX, f64::min), bound(0, f64::MIN, f64::max));
        let (top, bottom) = (bound(1, f64::MAX, f64::min), bound(1, f64::MIN, f64::max));
        let rows = ceil_to_usize(top).max(shown.start)..ceil_to_usize(bottom).min(shown.end);
        if outline.len() < 3 || right < -1.0 || left > grid.columns as f64 + 1.0 || rows.is_empty() {
            self.outline_points.truncate(first);
            return false;
        }
        self.outline_points.push(self.outline_points[first]);
        self.shapes.push(Shape {
            corners: first..self.outline_points.len(),
            rows,
            inverse_depth: inverse_depth.x * grid.origin[0] + inverse_depth.y * grid.origin[1] + inverse_depth.z,
            down: inverse_depth.y * grid.step[1],
            right: inverse_depth.x * grid.step[0],
            crossed: None,
        });
        true
    }

    /// Fills the buffers of face numbers (indices into `prepared`) and inverse depths for some rows of the grid; bands
    /// of rows are drawn from the top down.
    pub(super) fn draw(&mut self, grid: &Grid, band: Range<usize>) {
        let samples = grid.columns * band.len();
        self.inverse_depth.clear();
        self.inverse_depth.resize(samples, 0.0);
        self.face.clear();
        self.face.resize(samples, SKY);
        for (number, shape) in (0..).zip(&mut self.shapes) {
            for row in shape.rows.start.max(band.start)..shape.rows.end.min(band.end) {
                let (left, right) = shape.span(&self.outline_points, row as f64);
                let shift = Grid::shift(row);
                let (from, to) = (ceil_to_usize(left - shift), ceil_to_usize(right - shift).min(grid.columns));
                if from >= to {
                    continue;
                }
                let start = shape.inverse_depth + shape.down * row as f64 + shape.right * (from as f64 + shift);
                let line = (row - band.start) * grid.columns;
                fill(
                    &mut self.inverse_depth[line + from..line + to],
                    &mut self.face[line + from..line + to],
                    [start as f32, shape.right as f32],
                    number,
                );
            }
        }
    }
}

impl Shape {
    /// Left and right intersections of a row of the grid with the outline.
    #[inline]
    fn span(&mut self, outline_points: &[[f64; 2]], row: f64) -> (f64, f64) {
        let outline = &outline_points[self.corners.clone()];
        let crossing = |edge: usize| {
            let (from, to) = (outline[edge], outline[edge + 1]);
            let crosses = (from[1] < row) != (to[1] < row);
            crosses.then(|| from[0] + (to[0] - from[0]) * ((row - from[1]) / (to[1] - from[1])))
        };
        // A row crosses a convex outline twice, usually at the edges of the previous row.
        if let Some([one, other]) = self.crossed
            && let (Some(one), Some(other)) = (crossing(one), crossing(other))
        {
            return (one.min(other), one.max(other));
        }
        let (mut left, mut right) = ((f64::MAX, 0), (f64::MIN, 0));
        for edge in 0..outline.len() - 1 {
            let Some(x) = crossing(edge) else { continue };
            if x < left.0 {
                left = (x, edge);
            }
            if x > right.0 {
                right = (x, edge);
            }
        }
        self.crossed = (left.1 != right.1).then_some([left.1, right.1]);
        (left.0, right.0)
    }
}

/// Draws a face into a line of samples where it is nearest: inverse depth at the first sample, and its increment per
/// sample.
#[inline]
fn fill(depths: &mut [f32], faces: &mut [u32], [start, slope]: [f32; 2], number: u32) {
    let faces = &mut faces[..depths.len()];
    for index in 0..depths.len() {
        // 32-bit masks instead of branches, so that the loop is vectorized.
        let here = start + slope * (index as i32) as f32;
        let nearer = u32::from(here > depths[index]).wrapping_neg();
        depths[index] = f32::from_bits(here.to_bits() & nearer | depths[index].to_bits() & !nearer);
        faces[index] = number & nearer | faces[index] & !nearer;
    }
}

/// Smallest integer that is not below a value, at least 0.
#[inline]
fn ceil_to_usize(value: f64) -> usize {
    let whole = value as i64;
    whole.saturating_add(i64::from((whole as f64) < value)).max(0) as usize
}

impl Grid {
    fn place(&self, point: &Vector3<f64>) -> [f64; 2] {
        [(point.x / point.z - self.origin[0]) / self.step[0], (point.y / point.z - self.origin[1]) / self.step[1]]
    }
}

#[cfg(test)]
impl Workspace {
    /// Depth of the face at the first sample of every pixel, from a pose.
    pub(crate) fn depths_m(
        &mut self,
        view: &super::view::RenderedView,
        world: &crate::simulated_log::world::World,
        world_from_camera: &crate::geometry::RigidTransform,
    ) -> Vec<f64> {
        self.prepare(world, &Eye::new(world_from_camera), &view.grid, &(0..view.grid.rows));
        self.draw(&view.grid, 0..view.grid.rows);
        let place = |pixel: usize| {
            let (row, column) = (pixel / view.width, pixel % view.width);
            let regular = row * super::view::SAMPLES * view.grid.columns + column;
            view.places.as_ref().map_or(regular, |places| places[pixel][0] as usize)
        };
        (0..view.pixels()).map(|pixel| 1.0 / f64::from(self.inverse_depth[place(pixel)])).collect()
    }
}
