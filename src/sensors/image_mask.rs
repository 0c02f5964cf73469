//! Gray images, and the mask of the pixels of a camera that show the vehicle itself.

use std::fmt;
use std::sync::Arc;

use nalgebra::Vector2;

/// Smallest gray value of a masked pixel in a mask image.
const MASKED_FROM: u8 = 128;

/// Mask of a camera's images: no feature is detected in a masked pixel, and no track continues into one.
///
/// White is masked, as in OpenVINS; the masks of `OpenCV`'s detectors are the inverse.
#[derive(Clone, PartialEq, Eq)]
pub struct ImageMask {
    width: usize,
    height: usize,
    /// True for masked pixels, row by row.
    masked: Arc<[bool]>,
}

impl ImageMask {
    /// Masks the pixels with a gray value of 128 and above.
    pub fn from_image(image: &GrayImage) -> Self {
        let masked = image.pixels.iter().map(|pixel| *pixel >= MASKED_FROM).collect();
        Self { width: image.width, height: image.height, masked }
    }

    /// Width and height in pixels.
    pub fn size_px(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// True if a pixel is masked; pixels outside of the image are not.
    pub fn is_masked(&self, column: usize, row: usize) -> bool {
        column < self.width && row < self.height && self.masked.get(row * self.width + column).copied().unwrap_or(false)
    }

    /// True if the pixel that contains a point is masked; pixel centres are at integers.
    pub fn covers(&self, uv_px: &Vector2<f64>) -> bool {
        let [u, v] = [uv_px.x, uv_px.y].map(f64::round);
        u >= 0.0 && v >= 0.0 && self.is_masked(u as usize, v as usize)
    }

    /// Ratio of masked pixels to all pixels.
    pub fn ratio(&self) -> f64 {
        let masked = self.masked.iter().filter(|masked| **masked).count();
        masked as f64 / self.masked.len().max(1) as f64
    }

    /// Mask as an image: 255 for masked pixels, else 0.
    pub fn to_image(&self) -> GrayImage {
        let pixels = self.masked.iter().map(|masked| if *masked { u8::MAX } else { 0 }).collect();
        GrayImage { width: self.width, height: self.height, pixels }
    }
}

impl fmt::Debug for ImageMask {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "ImageMask({}×{}, {:.1} % masked)", self.width, self.height, 100.0 * self.ratio())
    }
}

/// 8-bit gray image, rows top to bottom without padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrayImage {
    /// Number of columns in pixels.
    pub width: usize,
    /// Number of rows in pixels.
    pub height: usize,
    /// `width · height` gray values.
    pub pixels: Vec<u8>,
}
