//! Resampling of an image at the pixels of an affinely warped window.

#![expect(clippy::inline_always, reason = "code not inlined is not compiled for the registers of its caller")]

use nalgebra::{Matrix2, Vector2};
use pulp::{Arch, NullaryFnOnce};

use super::appearance::Rows;
use super::filters::{CENTRE, LANES, WINDOW, cubic_weights, rounded_bits};
use crate::sensors::GrayImage;

/// Row stride of a patch, and its number of rows: enough for a window of twice the area at any rotation.
const STRIDE: usize = 64;
const HEIGHT: usize = 64;
/// Additional pixels on every side, so that a window can move.
const MARGIN: usize = 2;

/// Smallest distance of the pixels of a resampled window from the image's first column and row, and from one past its
/// last ones: interpolation uses one pixel before a point to two after it, and the point may be rounded up.
pub(super) const BORDER: [usize; 2] = [1, 3];

/// Bits of a rounded coordinate, which is not negative.
const LOW_BITS: u32 = 0x003f_ffff;

/// Number of steps per pixel for which the weights are tabulated.
const FRACTIONS: usize = 128;

/// Weights of the four pixels around a point, by cubic convolution, at fractions of a pixel.
static CUBIC: [[f32; 4]; FRACTIONS] = {
    let mut table = [[0.0; 4]; FRACTIONS];
    let mut index = 0;
    while index < FRACTIONS {
        table[index] = cubic_weights(index as f32 / FRACTIONS as f32);
        index += 1;
    }
    table
};

/// Region of an image in floating point, from which windows are resampled.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Row by row, padded after the last one, so that the four rows around any pixel exist.
    pixels: Box<[f32; STRIDE * HEIGHT + SURPLUS]>,
    /// Column and row of the first pixel in the image.
    first: [usize; 2],
    /// Numbers of columns and rows.
    size: [usize; 2],
}

const SURPLUS: usize = 3 * STRIDE + 4;

impl Patch {
    #[expect(clippy::large_stack_arrays, reason = "17 KiB that go to the heap at once")]
    pub(super) fn new() -> Self {
        Self { pixels: Box::new([0.0; STRIDE * HEIGHT + SURPLUS]), first: [0; 2], size: [0; 2] }
    }

    pub(super) fn clear(&mut self) {
        self.size = [0; 2];
    }

    /// Reads the image at `middle + warp·step` for every step of the window, minus `level`.
    ///
    /// Returns true if all these positions are inside the image and fit into a patch.
    /// `image` must be the same until the patch is [cleared](Self::clear).
    pub(super) fn read(
        &mut self,
        image: &GrayImage,
        warp: &Matrix2<f64>,
        middle: &Vector2<f64>,
        level: f32,
        window: &mut Rows,
    ) -> bool {
        let reach = CENTRE as f64;
        let extent = Vector2::new(
            (warp[(0, 0)].abs() + warp[(0, 1)].abs()) * reach,
            (warp[(1, 0)].abs() + warp[(1, 1)].abs()) * reach,
        );
        let (low, high) = (middle - extent, middle + extent);
        let [first, past] = BORDER.map(|border| border as f64);
        let inside = low.x >= first
            && low.y >= first
            && high.x < image.width as f64 - past
            && high.y < image.height as f64 - past;
        if !inside {
            return false;
        }
        let needed = [[low.x, high.x], [low.y, high.y]].map(|[low, high]| [low as usize - 1, high as usize + 3]);
        if !self.holds(needed) && !self.cut_out(image, needed) {
            return false;
        }
        self.interpolate(warp, middle, level, window);
        true
    }

    fn holds(&self, needed: [[usize; 2]; 2]) -> bool {
        (0..2).all(|k| needed[k][0] >= self.first[k] && needed[k][1] < self.first[k] + self.size[k])
    }

    /// Copies the needed region with the margin; returns true if it fits.
    fn cut_out(&mut self, image: &GrayImage, needed: [[usize; 2]; 2]) -> bool {
        let counts = [image.width, image.height];
        for k in 0..2 {
            let [first, last] = needed[k];
            self.first[k] = first.saturating_sub(MARGIN);
            self.size[k] = (last + MARGIN + 1).min(counts[k]) - self.first[k];
        }
        let ([left, top], [width, height]) = (self.first, self.size);
        if width > STRIDE || height > HEIGHT {
            self.clear();
            return false;
        }
        let rows = &image.pixels[top * image.width + left..];
        Arch::new().dispatch(Cutting { rows, image_width: image.width, size: self.size, pixels: &mut self.pixels });
        true
    }

    fn interpolate(&self, warp: &Matrix2<f64>, middle: &Vector2<f64>, level: f32, window: &mut Rows) {
        let unit = FRACTIONS as f64;
        let corner = Vector2::new(self.first[0] as f64, self.first[1] as f64);
        let step = [warp[(0, 0)], warp[(1, 0)]].map(|step| (step * unit) as f32);
        // Overwritten for each row.
        let mut places = [[0; LANES]; 3];
        let mut products = [[0.0_f32; 4]; LANES];
        for (row, line) in window.iter_mut().enumerate() {
            let down = row as f64 - CENTRE as f64;
            let start = middle - corner + warp * Vector2::new(-(CENTRE as f64), down);
            let start = [(start.x * unit) as f32, (start.y * unit) as f32];
            for c in 0..LANES {
                let [x, y] = [0, 1].map(|k| rounded_bits(start[k] + c as f32 * step[k]) & LOW_BITS);
                places[0][c] = y / FRACTIONS as u32 * STRIDE as u32 + x / FRACTIONS as u32;
                places[1][c] = x % FRACTIONS as u32;
                places[2][c] = y % FRACTIONS as u32;
            }
            for (c, products) in products[..WINDOW].iter_mut().enumerate() {
                // One row and one column before the pixel; the remainder removes the bounds check.
                let first = (places[0][c] as usize).wrapping_sub(STRIDE + 1) % (STRIDE * HEIGHT);
                let (along, down) = (&CUBIC[places[1][c] as usize], &CUBIC[places[2][c] as usize]);
                let taps = &self.pixels[first..first + SURPLUS];
                for i in 0..4 {
                    let sum = (down[0] * taps[i] + down[1] * taps[STRIDE + i])
                        + (down[2] * taps[2 * STRIDE + i] + down[3] * taps[3 * STRIDE + i]);
                    products[i] = along[i] * sum;
                }
            }
            for (value, [a, b, c, d]) in line[..WINDOW].iter_mut().zip(&products) {
                *value = ((a + b) + (c + d)) - level;
            }
        }
    }
}

/// Copies a region of an image, compiled for every width of vector registers.
struct Cutting<'a> {
    /// The image from the region's first pixel on.
    rows: &'a [u8],
    image_width: usize,
    /// Columns and rows of the region.
    size: [usize; 2],
    pixels: &'a mut [f32; STRIDE * HEIGHT + SURPLUS],
}

impl NullaryFnOnce for Cutting<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { rows, image_width, size: [width, height], pixels } = self;
        for (row, source) in pixels.chunks_exact_mut(STRIDE).zip(rows.chunks(image_width)).take(height) {
            for (value, pixel) in row[..width].iter_mut().zip(&source[..width]) {
                *value = f32::from(*pixel);
            }
        }
    }
}
