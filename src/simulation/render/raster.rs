//! Which face is seen at every sample.

use nalgebra::{Matrix3, Vector3};

use super::view::{Grid, Workspace};
use crate::geometry::RigidTransform;
use crate::simulation::world::{Affine, World};

/// Marks a sample that sees the sky.
pub(super) const SKY: u32 = u32::MAX;
/// Nearer than this nothing is drawn.
const NEAR_M: f64 = 0.05;

/// A face as this camera sees it: everything over depth is linear in the ray `(x, y, 1)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prepared {
    /// One over depth.
    pub(super) inverse_depth: [f32; 3],
    /// Texture coordinates over depth, in metres.
    pub(super) texture_m: [[f32; 3]; 2],
    /// Sunlight over depth.
    pub(super) sun: [f32; 3],
    pub(super) material: u32,
}

/// A world seen from somewhere: points of the world into the camera.
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
        let linear = self.camera_from_world * value.gradient + inverse_depth * at_centre;
        [linear.x as f32, linear.y as f32, linear.z as f32]
    }
}

impl Workspace {
    /// Fills the buffers of face numbers (into `prepared`) and inverse depths.
    pub(super) fn rasterize(&mut self, world: &World, eye: &Eye, grid: &Grid) {
        let samples = grid.columns * grid.rows;
        self.inverse_depth.clear();
        self.inverse_depth.resize(samples, 0.0);
        self.face.clear();
        self.face.resize(samples, SKY);
        self.prepared.clear();
        for face in &world.faces {
            // How far the camera's centre stands before the face.
            let before_m = face.normal.dot(&eye.centre_m) - face.distance;
            if before_m <= 1e-4 {
                continue;
            }
            if !self.outline_of(&face.corners, eye, grid) {
                continue;
            }
            let inverse_depth = eye.camera_from_world * face.normal / -before_m;
            let number = self.prepared.len() as u32;
            if self.fill(grid, &inverse_depth, number) {
                self.prepared.push(Prepared {
                    inverse_depth: [inverse_depth.x as f32, inverse_depth.y as f32, inverse_depth.z as f32],
                    texture_m: [0, 1].map(|axis: usize| eye.over_depth(&face.texture_m[axis], &inverse_depth)),
                    sun: eye.over_depth(&face.sun, &inverse_depth),
                    material: face.material.0 as u32,
                });
            }
        }
    }

    /// Projects a face's corners, cut at the near plane, to places in the grid; false when it lies outside.
    fn outline_of(&mut self, corners: &[Vector3<f64>], eye: &Eye, grid: &Grid) -> bool {
        self.outline.clear();
        let seen = |corner: &Vector3<f64>| eye.camera_from_world * (corner - eye.centre_m);
        let Some(last) = corners.last() else { return false };
        let mut before = seen(last);
        for corner in corners {
            let point = seen(corner);
            if (before.z > NEAR_M) != (point.z > NEAR_M) {
                let share = (NEAR_M - before.z) / (point.z - before.z);
                self.outline.push(grid.place(&(before + (point - before) * share)));
            }
            if point.z > NEAR_M {
                self.outline.push(grid.place(&point));
            }
            before = point;
        }
        let (columns, rows) = (grid.columns as f64, grid.rows as f64);
        let outside =
            |beyond: fn(&[f64; 2], f64, f64) -> bool| self.outline.iter().all(|place| beyond(place, columns, rows));
        self.outline.len() >= 3
            && !outside(|place, _, _| place[0] < -1.0)
            && !outside(|place, columns, _| place[0] > columns + 1.0)
            && !outside(|place, _, _| place[1] < 0.0)
            && !outside(|place, _, rows| place[1] > rows)
    }

    /// Draws the outline's inside where it is nearest; whether anything was drawn.
    fn fill(&mut self, grid: &Grid, inverse_depth: &Vector3<f64>, number: u32) -> bool {
        let (mut top, mut bottom) = (f64::MAX, f64::MIN);
        for place in &self.outline {
            top = top.min(place[1]);
            bottom = bottom.max(place[1]);
        }
        let first_row = top.ceil().max(0.0) as usize;
        let last_row = (bottom.ceil().max(0.0) as usize).min(grid.rows);
        // Over a grid column the inverse depth grows by this.
        let slope = inverse_depth.x * grid.step[0];
        let at_origin = inverse_depth.x * grid.origin[0] + inverse_depth.y * grid.origin[1] + inverse_depth.z;
        let mut drawn = false;
        for row in first_row..last_row {
            let (left, right) = self.span(row as f64);
            let shift = Grid::shift(row);
            let from = ((left - shift).ceil().max(0.0) as usize).min(grid.columns);
            let to = ((right - shift).ceil().max(0.0) as usize).min(grid.columns);
            if from >= to {
                continue;
            }
            let start = at_origin + inverse_depth.y * grid.step[1] * row as f64 + slope * (from as f64 + shift);
            let places = row * grid.columns + from..row * grid.columns + to;
            let depths = &mut self.inverse_depth[places.clone()];
            let faces = &mut self.face[places];
            let (start, slope) = (start as f32, slope as f32);
            for (index, (depth, face)) in depths.iter_mut().zip(faces).enumerate() {
                let here = start + slope * index as f32;
                let nearer = here > *depth;
                *depth = if nearer { here } else { *depth };
                *face = if nearer { number } else { *face };
                drawn |= nearer;
            }
        }
        drawn
    }

    /// Where a row of the grid enters and leaves the outline.
    fn span(&self, row: f64) -> (f64, f64) {
        let (mut left, mut right) = (f64::MAX, f64::MIN);
        let count = self.outline.len();
        for k in 0..count {
            let (from, to) = (self.outline[k], self.outline[(k + 1) % count]);
            if (from[1] < row) == (to[1] < row) {
                continue;
            }
            let x = from[0] + (to[0] - from[0]) * ((row - from[1]) / (to[1] - from[1]));
            left = left.min(x);
            right = right.max(x);
        }
        (left, right)
    }
}

impl Grid {
    fn place(&self, point: &Vector3<f64>) -> [f64; 2] {
        [(point.x / point.z - self.origin[0]) / self.step[0], (point.y / point.z - self.origin[1]) / self.step[1]]
    }
}
