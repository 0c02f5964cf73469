//! Shadows: a map of the highest surface along the sun's direction.

use nalgebra::{Matrix3, Vector3};

use crate::simulated_log::world::World;

/// Number of cells per side.
const CELLS: usize = 2048;
/// A surface within this distance below the highest one is still lit.
const BIAS_M: f32 = 0.09;

/// Heights towards the sun over a square around the origin.
#[derive(Clone, Debug)]
pub(super) struct ShadowMap {
    heights: Vec<f32>,
    /// Maps points of the world to column, row (in cells) and height (in metres).
    pub(super) linear: Matrix3<f64>,
    pub(super) offset: Vector3<f64>,
}

impl ShadowMap {
    pub(super) fn new(world: &World) -> Self {
        let sun = world.to_sun;
        let right = sun.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or_else(Vector3::x);
        let up = right.cross(&sun);
        let scale = CELLS as f64 / (2.0 * world.shadow_reach_m);
        let linear = Matrix3::from_rows(&[right.transpose() * scale, up.transpose() * scale, sun.transpose()]);
        let offset = Vector3::new(0.5 * CELLS as f64, 0.5 * CELLS as f64, 0.0);
        let mut map = Self { heights: vec![f32::MIN; CELLS * CELLS], linear, offset };
        for face in &world.faces {
            if face.normal.dot(&sun) > 1e-3 {
                let outline: Vec<Vector3<f64>> = face.corners.iter().map(|corner| linear * corner + offset).collect();
                map.raise(&outline);
            }
        }
        map
    }

    /// Raises the map to a face with these corners in cells and heights.
    fn raise(&mut self, outline: &[Vector3<f64>]) {
        let mut normal = Vector3::zeros();
        for k in 1..outline.len() - 1 {
            normal += (outline[k] - outline[0]).cross(&(outline[k + 1] - outline[0]));
        }
        if normal.z.abs() < 1e-9 {
            return;
        }
        let slope = [-normal.x / normal.z, -normal.y / normal.z];
        let top = outline.iter().map(|point| point.y).fold(f64::MAX, f64::min);
        let bottom = outline.iter().map(|point| point.y).fold(f64::MIN, f64::max);
        let row_of = |y: f64| ((y - 0.5).ceil().max(0.0) as usize).min(CELLS);
        for row in row_of(top)..row_of(bottom) {
            let y = row as f64 + 0.5;
            let (mut left, mut right) = (f64::MAX, f64::MIN);
            for k in 0..outline.len() {
                let (from, to) = (outline[k], outline[(k + 1) % outline.len()]);
                if (from.y < y) != (to.y < y) {
                    let x = from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y));
                    left = left.min(x);
                    right = right.max(x);
                }
            }
            for column in row_of(left)..row_of(right) {
                let x = column as f64 + 0.5;
                let height = outline[0].z + slope[0] * (x - outline[0].x) + slope[1] * (y - outline[0].y);
                let slot = &mut self.heights[row * CELLS + column];
                *slot = slot.max(height as f32);
            }
        }
    }

    /// Fraction of the sunlight at a position, 0 to 1, smoothed over three cells.
    #[inline]
    pub(super) fn lit(&self, column: f32, row: f32, height: f32) -> f32 {
        let (x, y) = (column - 0.5, row - 0.5);
        let last = (CELLS - 2) as f32;
        if !(x >= 1.0 && y >= 1.0 && x < last && y < last) {
            return 1.0;
        }
        let (cell_x, cell_y) = ((x + 0.5) as usize, (y + 0.5) as usize);
        let (middle_x, middle_y) = (cell_x as f32, cell_y as f32);
        let weights = |fraction: f32| {
            [0.5 * (0.5 - fraction).powi(2), 0.75 - fraction * fraction, 0.5 * (0.5 + fraction).powi(2)]
        };
        let (along, across) = (weights(x - middle_x), weights(y - middle_y));
        let first = (cell_y - 1) * CELLS + cell_x - 1;
        let mut sum = 0.0;
        for (line, fraction) in across.iter().enumerate() {
            let cells = &self.heights[first + line * CELLS..][..3];
            let mut of_line = 0.0;
            for (cell, weight) in cells.iter().zip(&along) {
                of_line += if height + BIAS_M >= *cell { *weight } else { 0.0 };
            }
            sum += fraction * of_line;
        }
        sum
    }
}
