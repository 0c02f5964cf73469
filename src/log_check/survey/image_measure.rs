//! Brightness, texture and sharpness of an image.

use crate::sensors::GrayImage;

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
        steeper * 100 >= count.max(1)
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
