//! Brightness, texture and sharpness of an image, and sums of image gradients over a log, which separate parts that
//! never move from the scene.

use crate::geometry::planar_length;
use crate::sensors::{GrayImage, ImageMask};

/// Images are averaged down to this width or less.
const LARGEST_WIDTH: usize = 640;
/// Side of the classified blocks, in pixels of the averaged images.
const BLOCK: usize = 8;
/// Mean gradient of a block with texture, in grey levels per pixel; compression and noise stay below.
const MIN_GRADIENT: f32 = 2.0;
/// Ratio of the norm of the summed gradients to the sum of their norms above which a block may be static. Moving scenes
/// have about the inverse square root of the number of images.
const STILL_COHERENCE: f32 = 0.6;
/// Ratio of the squared mean of the gradient's norm to its mean square above which the block is static: an edge that
/// moves through a block, such as the horizon in the images of a stabilized camera, keeps its direction but not its place.
const STILL_CONSTANCY: f32 = 0.6;

/// Sums of the gradients of all sampled images of a camera.
#[derive(Clone, Debug, Default)]
pub(crate) struct GradientSums {
    size_px: [usize; 2],
    width: usize,
    height: usize,
    /// Side of the square of pixels that is averaged.
    scale: usize,
    pub(crate) images: usize,
    /// Sum of the gradients along columns and rows, of their norms, and of the squares of these.
    sums: Vec<[f32; 4]>,
}

impl GradientSums {
    /// Adds an image; an image whose size differs from the first one is ignored.
    pub(crate) fn add(&mut self, image: &GrayImage) {
        if self.images == 0 {
            self.size_px = [image.width, image.height];
            self.scale = image.width.div_ceil(LARGEST_WIDTH).max(1);
            (self.width, self.height) = (image.width / self.scale, image.height / self.scale);
            self.sums = vec![[0.0; 4]; self.width * self.height];
        }
        if self.size_px != [image.width, image.height] {
            return;
        }
        self.images += 1;
        let small = self.averaged(image);
        let width = self.width;
        for row in 1..self.height.saturating_sub(1) {
            let line = |row: usize| &small[row * width..(row + 1) * width];
            let (above, here, below) = (line(row - 1), line(row), line(row + 1));
            let sums = &mut self.sums[row * width..(row + 1) * width];
            for column in 1..width.saturating_sub(1) {
                let along = 0.5 * (here[column + 1] - here[column - 1]);
                let down = 0.5 * (below[column] - above[column]);
                let sum = &mut sums[column];
                let norm = planar_length([along, down]);
                *sum = [sum[0] + along, sum[1] + down, sum[2] + norm, sum[3] + norm * norm];
            }
        }
    }

    fn averaged(&self, image: &GrayImage) -> Vec<f32> {
        let scale = self.scale;
        let mut averaged = Vec::with_capacity(self.width * self.height);
        let mut sums = vec![0_u32; self.width];
        for rows in image.pixels.chunks_exact((scale * image.width).max(1)) {
            sums.fill(0);
            for row in rows.chunks_exact(image.width) {
                for (sum, pixels) in sums.iter_mut().zip(row.chunks_exact(scale)) {
                    *sum += pixels.iter().map(|pixel| u32::from(*pixel)).sum::<u32>();
                }
            }
            averaged.extend(sums.iter().map(|sum| *sum as f32 / (scale * scale) as f32));
        }
        averaged
    }

    pub(crate) fn blocks(&self) -> [usize; 2] {
        [self.width / BLOCK, self.height / BLOCK]
    }

    /// For each block, row by row: true if it is static; `None` for a block without texture.
    pub(crate) fn judge(&self) -> Vec<Option<bool>> {
        let [columns, rows] = self.blocks();
        let block = |index: usize| {
            let (left, top) = (BLOCK * (index % columns), BLOCK * (index / columns));
            let row = |row: usize| &self.sums[row * self.width + left..][..BLOCK];
            let (mut summed, mut norms, mut squared_norms, mut squares) = (0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32);
            for [along, down, norm, square] in (top..top + BLOCK).flat_map(row) {
                summed += planar_length([*along, *down]);
                norms += norm;
                squared_norms += norm * norm;
                squares += square;
            }
            let images = self.images as f32;
            let textured = norms > MIN_GRADIENT * images * (BLOCK * BLOCK) as f32;
            let is_constant = squared_norms > STILL_CONSTANCY * images * squares;
            textured.then_some(summed > STILL_COHERENCE * norms && is_constant)
        };
        (0..columns * rows).map(block).collect()
    }

    /// The pixels of some blocks and of those around them.
    pub(crate) fn mask(&self, blocks: &[bool]) -> ImageMask {
        let [columns, rows] = self.blocks();
        let near = |column: usize, row: usize| {
            let around = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
            around(row, rows).any(|row| around(column, columns).any(|column| blocks[row * columns + column]))
        };
        let [width, height] = self.size_px;
        let side = BLOCK * self.scale;
        let pixel = |index: usize| {
            // Pixels beyond the last block belong to it.
            let (column, row) = ((index % width / side).min(columns - 1), (index / width / side).min(rows - 1));
            if near(column, row) { u8::MAX } else { 0 }
        };
        ImageMask::from_image(&GrayImage { width, height, pixels: (0..width * height).map(pixel).collect() })
    }

    /// True if a mask covers most of a block.
    pub(crate) fn is_covered(&self, mask: &ImageMask, block: usize) -> bool {
        let side = BLOCK * self.scale;
        let [columns, _] = self.blocks();
        let (left, top) = (side * (block % columns), side * (block / columns));
        let masked = (top..top + side).flat_map(|row| (left..left + side).map(move |column| (column, row)));
        2 * masked.filter(|(column, row)| mask.is_masked(*column, *row)).count() > side * side
    }
}

/// The edge of an image is the gradient that one in this many pixels exceeds.
const EDGE_ONE_IN: usize = 100;
/// A pixel with a larger gradient, in grey levels per pixel, has texture.
const TEXTURE_SLOPE: usize = 12;
/// Pixels at least this bright count as overexposed.
const BRIGHT: u8 = 250;
/// Pixels at most this bright count as underexposed.
const DARK: u8 = 5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ImageMeasure {
    pub(crate) resolution_px: [usize; 2],
    pub(crate) mean_grey: f64,
    /// Ratios of black and of white pixels.
    pub(crate) dark: f64,
    pub(crate) bright: f64,
    /// Ratio of pixels with texture.
    pub(crate) texture: f64,
    /// Gradient that 1 % of the pixels exceed, in grey levels per pixel.
    pub(crate) edge: f64,
}

/// Measures every second pixel of every second row.
pub(crate) fn measure(image: &GrayImage) -> ImageMeasure {
    let (width, height) = (image.width, image.height);
    let mut slopes = [0_usize; 256];
    let (mut count, mut sum, mut dark, mut bright) = (0_usize, 0_usize, 0_usize, 0_usize);
    for row in (1..height.saturating_sub(1)).step_by(2) {
        let line = |row: usize| &image.pixels[row * width..(row + 1) * width];
        let (above, here, below) = (line(row - 1), line(row), line(row + 1));
        for column in (1..width.saturating_sub(1)).step_by(2) {
            let value = here[column];
            let along = i32::from(here[column + 1]) - i32::from(here[column - 1]);
            let across = i32::from(below[column]) - i32::from(above[column]);
            // The neighbours are two pixels apart.
            let slope = 0.5 * f64::from(along * along + across * across).sqrt();
            slopes[(slope as usize).min(255)] += 1;
            count += 1;
            sum += usize::from(value);
            dark += usize::from(value <= DARK);
            bright += usize::from(value >= BRIGHT);
        }
    }
    let mean = |sum: usize| sum as f64 / count.max(1) as f64;
    let mut steeper = 0;
    let edge = (0..256).rev().find(|slope| {
        steeper += slopes[*slope];
        steeper * EDGE_ONE_IN >= count.max(1)
    });
    ImageMeasure {
        resolution_px: [width, height],
        mean_grey: mean(sum),
        dark: mean(dark),
        bright: mean(bright),
        texture: mean(slopes[TEXTURE_SLOPE..].iter().sum()),
        edge: edge.unwrap_or(0) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 16;

    /// Judgement on images whose lower part, from a row by the number of the image on, is brighter.
    fn judged(edge: impl Fn(usize) -> usize) -> Vec<Option<bool>> {
        let mut sums = GradientSums::default();
        for number in 0..40 {
            let row = |index: usize| index / SIDE;
            let pixels = (0..SIDE * SIDE).map(|index| if row(index) < edge(number) { 40 } else { 200 }).collect();
            sums.add(&GrayImage { width: SIDE, height: SIDE, pixels });
        }
        sums.judge()
    }

    #[test]
    fn an_edge_that_moves_along_its_normal_is_not_static() {
        assert_eq!(judged(|_| 4)[..2], [Some(true); 2]);
        assert_eq!(judged(|number| 2 + number % 5)[..2], [Some(false); 2]);
    }
}
