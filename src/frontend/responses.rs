//! Corner response of the pixels of a tile: the smaller eigenvalue of the mean structure tensor around each.

#![expect(clippy::inline_always, reason = "what is not inlined is not compiled for the registers of its caller")]
#![expect(clippy::needless_bitwise_bool, reason = "without branches, many pixels are compared at once")]

use nalgebra::Vector2;
use pulp::{Arch, NullaryFnOnce};

use super::lucas_kanade::smaller_eigenvalue;
use super::pyramid::cut_out;
use crate::sensors::GrayImage;

/// Side of a tile, in pixels.
pub(super) const TILE: usize = 32;
/// The structure tensor is the mean over a square that reaches this far about a pixel.
const BLOCK_RADIUS: usize = 2;
const BLOCK: usize = 2 * BLOCK_RADIUS + 1;
/// Scharr's weights add up to 32, and the mean is over the block.
const UNIT: f32 = 1.0 / (32.0 * 32.0 * (BLOCK * BLOCK) as f32);
/// Eigenvalues are needed one pixel beyond the tile, to decide whether a pixel at its border is a maximum.
const RESPONSES: usize = TILE + 2;
const GRADIENTS: usize = RESPONSES + 2 * BLOCK_RADIUS;
const PIXELS: usize = GRADIENTS + 2;

/// The smaller eigenvalues of a tile and one pixel around it, and their local maxima.
#[derive(Clone, Debug)]
pub(super) struct Responses {
    values: Box<[[f32; RESPONSES]; RESPONSES]>,
    is_peak: Box<[[bool; TILE]; TILE]>,
}

/// A pixel whose response is larger than those around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    /// Column and row in the tile.
    pub(super) pixel: [usize; 2],
    /// From there to the top of the parabolas through it and its neighbours, in pixels.
    pub(super) shift: Vector2<f64>,
    pub(super) response: f32,
}

impl Default for Responses {
    fn default() -> Self {
        Self { values: Box::new([[0.0; RESPONSES]; RESPONSES]), is_peak: Box::new([[false; TILE]; TILE]) }
    }
}

impl Responses {
    /// Computes the tile of `image` at `first` (column, row); responses below `min_response` are no peaks.
    pub(super) fn compute(&mut self, image: &GrayImage, first: [usize; 2], min_response: f32) {
        let mut pixels = [[0.0_f32; PIXELS]; PIXELS];
        cut_out(image, first.map(|t| t as i32 - (BLOCK_RADIUS + 2) as i32), &mut pixels, f32::from);
        Arch::new().dispatch(Computation { pixels: &pixels, min_response, responses: self });
    }

    /// The peaks among the tile's first columns and rows, row by row.
    pub(super) fn peaks(&self, width: usize, height: usize) -> impl Iterator<Item = Peak> {
        self.is_peak[..height].iter().enumerate().flat_map(move |(y, row)| {
            let columns = row[..width].iter().enumerate().filter(|(_, is_peak)| **is_peak);
            columns.map(move |(x, _)| Peak {
                pixel: [x, y],
                shift: self.peak_shift(x + 1, y + 1),
                response: self.values[y + 1][x + 1],
            })
        })
    }

    /// From a maximum to the top of the parabolas through it and its neighbours, in pixels.
    fn peak_shift(&self, x: usize, y: usize) -> Vector2<f64> {
        let top = |before: f32, here: f32, after: f32| {
            let curvature = before - 2.0 * here + after;
            if curvature < 0.0 { f64::from(0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let values = &self.values;
        let here = values[y][x];
        Vector2::new(top(values[y][x - 1], here, values[y][x + 1]), top(values[y - 1][x], here, values[y + 1][x]))
    }
}

/// Filling [`Responses`], compiled for every width of vector registers.
struct Computation<'a> {
    pixels: &'a [[f32; PIXELS]; PIXELS],
    min_response: f32,
    responses: &'a mut Responses,
}

impl NullaryFnOnce for Computation<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { pixels, min_response, responses: Responses { values, is_peak } } = self;
        smaller_eigenvalues(pixels, values);
        for y in 0..TILE {
            let (above, row, below) = (&values[y], &values[y + 1], &values[y + 2]);
            for x in 0..TILE {
                let here = row[x + 1];
                // Of equal neighbours the first one counts.
                let before = (here > above[x]) & (here > above[x + 1]) & (here > above[x + 2]) & (here > row[x]);
                let after = (here >= row[x + 2]) & (here >= below[x]) & (here >= below[x + 1]) & (here >= below[x + 2]);
                is_peak[y][x] = (here >= min_response) & before & after;
            }
        }
    }
}

#[inline(always)]
#[expect(clippy::large_stack_arrays, reason = "18 KiB that stay in the nearest cache")]
fn smaller_eigenvalues(pixels: &[[f32; PIXELS]; PIXELS], values: &mut [[f32; RESPONSES]; RESPONSES]) {
    let mut products = [[[0.0_f32; GRADIENTS]; GRADIENTS]; 3];
    for y in 0..GRADIENTS {
        let (above, here, below) = (&pixels[y], &pixels[y + 1], &pixels[y + 2]);
        for x in 0..GRADIENTS {
            // Scharr's derivative.
            let along = 3.0 * (above[x + 2] - above[x] + below[x + 2] - below[x]) + 10.0 * (here[x + 2] - here[x]);
            let down = 3.0 * (below[x] - above[x] + below[x + 2] - above[x + 2]) + 10.0 * (below[x + 1] - above[x + 1]);
            products[0][y][x] = along * along;
            products[1][y][x] = along * down;
            products[2][y][x] = down * down;
        }
    }
    let mut sums = [[[0.0_f32; RESPONSES]; RESPONSES]; 3];
    for (product, sums) in products.iter().zip(&mut sums) {
        for y in 0..RESPONSES {
            let mut column_sums = [0.0_f32; GRADIENTS];
            for line in &product[y..y + BLOCK] {
                for x in 0..GRADIENTS {
                    column_sums[x] += line[x];
                }
            }
            for offset in 0..BLOCK {
                for x in 0..RESPONSES {
                    sums[y][x] += column_sums[x + offset] * UNIT;
                }
            }
        }
    }
    for y in 0..RESPONSES {
        for x in 0..RESPONSES {
            values[y][x] = smaller_eigenvalue([sums[0][y][x], sums[1][y][x], sums[2][y][x]]);
        }
    }
}
