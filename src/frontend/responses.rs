//! Corner response of the pixels of a tile: the smaller eigenvalue of the mean structure tensor around each pixel.
//!
//! Shi and Tomasi ("Good features to track", CVPR 1994) select the points at which a window can be tracked best: both
//! eigenvalues of `G = mean of ∇I ∇Iᵀ` over the window are large, so that the response is `min(λ₁, λ₂)`.

#![expect(clippy::inline_always, reason = "code not inlined is not compiled for the registers of its caller")]
#![expect(clippy::needless_bitwise_bool, reason = "without branches, many pixels are compared at once")]

use nalgebra::Vector2;
use pulp::{Arch, NullaryFnOnce};

use super::filters::{REGISTER, larger, scharr, smaller_eigenvalue};
use super::pyramid::cut_out;
use crate::sensors::GrayImage;

/// Side of a tile, in pixels.
pub(super) const TILE: usize = 32;
/// Radius of the square over which the structure tensor is averaged.
const BLOCK_RADIUS: usize = 2;
const BLOCK: usize = 2 * BLOCK_RADIUS + 1;
/// Scale of the tensor: Scharr's weights add up to 32, and the mean is over the block.
const UNIT: f32 = 1.0 / (32.0 * 32.0 * (BLOCK * BLOCK) as f32);
/// Side of the region with eigenvalues: one pixel beyond the tile decides if a pixel at its border is a maximum.
const RESPONSES: usize = TILE + 2;
const GRADIENTS: usize = RESPONSES + 2 * BLOCK_RADIUS;
const PIXELS: usize = GRADIENTS + 2;
/// Columns padded to whole vector registers; the padding is computed and not used.
const RESPONSE_LANES: usize = 40;
const GRADIENT_LANES: usize = 48;
const PIXEL_LANES: usize = GRADIENT_LANES + 2;

/// Smaller eigenvalues of a tile and of one pixel around it, and their local maxima.
#[derive(Clone, Debug)]
pub(super) struct Responses {
    values: Box<[[f32; RESPONSE_LANES]; RESPONSES]>,
    /// Maxima, row by row.
    peaks: Vec<Peak>,
}

/// Pixel with a larger response than its neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    /// Column and row in the tile.
    pub(super) pixel: [usize; 2],
    pub(super) response: f32,
}

impl Default for Responses {
    fn default() -> Self {
        Self { values: Box::new([[0.0; RESPONSE_LANES]; RESPONSES]), peaks: Vec::new() }
    }
}

impl Responses {
    /// Computes the tile of `image` at `first` (column, row); responses below `min_response` are not peaks.
    pub(super) fn compute(&mut self, image: &GrayImage, first: [usize; 2], min_response: f32) {
        let first = first.map(|t| t as i32 - (BLOCK_RADIUS + 2) as i32);
        Arch::new().dispatch(Computation { image, first, min_response, responses: self });
    }

    /// Peaks among the first `width` columns and `height` rows of the tile, row by row.
    pub(super) fn peaks(&self, width: usize, height: usize) -> impl Iterator<Item = Peak> {
        self.peaks.iter().copied().filter(move |peak| peak.pixel[0] < width && peak.pixel[1] < height)
    }

    /// Offset from a peak's pixel to the maximum of the parabolas through it and its neighbours, in pixels.
    pub(super) fn peak_shift(&self, peak: &Peak) -> Vector2<f64> {
        let [x, y] = peak.pixel.map(|t| t + 1);
        let top = |before: f32, here: f32, after: f32| {
            let curvature = before - 2.0 * here + after;
            if curvature < 0.0 { f64::from(0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let values = &self.values;
        let here = values[y][x];
        Vector2::new(top(values[y][x - 1], here, values[y][x + 1]), top(values[y - 1][x], here, values[y + 1][x]))
    }
}

/// Computation of [`Responses`], compiled for every width of vector registers.
struct Computation<'a> {
    image: &'a GrayImage,
    /// Column and row of the first pixel whose gradient is needed, less one.
    first: [i32; 2],
    min_response: f32,
    responses: &'a mut Responses,
}

impl NullaryFnOnce for Computation<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { image, first, min_response, responses: Responses { values, peaks } } = self;
        let mut pixels = [[0.0; PIXEL_LANES]; PIXELS];
        cut_out(image, first, &mut pixels, f32::from);
        smaller_eigenvalues(&pixels, values);
        peaks.clear();
        let mut highest = [0.0_f32; TILE];
        for y in 0..TILE {
            let (above, row, below) = (&values[y], &values[y + 1], &values[y + 2]);
            for x in 0..TILE {
                let here = row[x + 1];
                // Of equal neighbours the first one is the maximum.
                let before = larger(larger(above[x], above[x + 1]), larger(above[x + 2], row[x]));
                let after = larger(larger(below[x], below[x + 1]), larger(below[x + 2], row[x + 2]));
                highest[x] = if (here > before) & (here >= after) { here } else { f32::NEG_INFINITY };
            }
            for (part, responses) in highest.as_chunks::<REGISTER>().0.iter().enumerate() {
                if responses.iter().copied().fold(f32::NEG_INFINITY, larger) < min_response {
                    continue;
                }
                let found = responses.iter().enumerate().filter(|(_, response)| **response >= min_response);
                peaks.extend(found.map(|(x, response)| Peak { pixel: [part * REGISTER + x, y], response: *response }));
            }
        }
    }
}

#[inline(always)]
#[expect(clippy::large_stack_arrays, reason = "22 KiB that stay in the nearest cache")]
fn smaller_eigenvalues(pixels: &[[f32; PIXEL_LANES]; PIXELS], values: &mut [[f32; RESPONSE_LANES]; RESPONSES]) {
    let mut products = [[[0.0_f32; GRADIENT_LANES]; 3]; GRADIENTS];
    for y in 0..GRADIENTS {
        for x in 0..GRADIENT_LANES {
            let [gx, gy] = scharr([&pixels[y], &pixels[y + 1], &pixels[y + 2]], x);
            products[y][0][x] = gx * gx;
            products[y][1][x] = gx * gy;
            products[y][2][x] = gy * gy;
        }
    }
    let mut column_means = [[0.0_f32; GRADIENT_LANES]; 3];
    for y in 0..RESPONSES {
        for (k, means) in column_means.iter_mut().enumerate() {
            let lines: [&[f32; GRADIENT_LANES]; BLOCK] = std::array::from_fn(|row| &products[y + row][k]);
            for x in 0..GRADIENT_LANES {
                means[x] = (lines[0][x] + lines[1][x] + lines[2][x] + lines[3][x] + lines[4][x]) * UNIT;
            }
        }
        for x in 0..RESPONSE_LANES {
            let mean =
                |means: &[f32; GRADIENT_LANES]| means[x] + means[x + 1] + means[x + 2] + means[x + 3] + means[x + 4];
            values[y][x] = smaller_eigenvalue([mean(&column_means[0]), mean(&column_means[1]), mean(&column_means[2])]);
        }
    }
}
