#![expect(clippy::inline_always, reason = "code not inlined is not compiled for the registers of its caller")]

use crate::sensors::GrayImage;

/// Mirrored pixels that the smoothing needs on each side.
const FILTER_RADIUS: usize = 2;

/// Image and its half-size levels, each smoothed by the binomial filter `1 4 6 4 1` before every second pixel is kept.
///
/// Pixel `(x, y)` of level `l` is pixel `(2ˡ·x, 2ˡ·y)` of the image.
/// Beyond its borders an image is mirrored about the outermost pixels (reflect-101), both in the smoothing and in the
/// windows of the tracker, so that no window is lost there.
/// The buffers are reused from image to image.
#[derive(Clone, Debug, Default)]
pub struct Pyramid {
    levels: Vec<GrayImage>,
    /// One row of column sums with mirrored pixels on each side.
    column_sums: Vec<u16>,
}

impl Pyramid {
    /// Minimum side of a level, in pixels; smaller ones cannot be tracked.
    pub const SMALLEST_LEVEL_PX: usize = 16;

    /// Builds up to `levels` levels of an image, the image itself first; fewer if it is too small for all.
    pub fn build(&mut self, image: &GrayImage, levels: usize) {
        let (mut width, mut height) = (image.width, image.height);
        let mut count = 0;
        while count == 0 || (count < levels && width.min(height) >= Self::SMALLEST_LEVEL_PX) {
            if count == self.levels.len() {
                self.levels.push(GrayImage { width: 0, height: 0, pixels: Vec::new() });
            }
            let level = &mut self.levels[count];
            (level.width, level.height) = (width, height);
            level.pixels.resize(width * height, 0);
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            count += 1;
        }
        self.levels.truncate(count);
        self.levels[0].pixels.copy_from_slice(&image.pixels);
        for level in 1..count {
            let (finer, coarser) = self.levels.split_at_mut(level);
            halve(&finer[level - 1], &mut coarser[0], &mut self.column_sums);
        }
    }

    /// The levels, the image itself first; empty before the first [`Self::build`].
    pub fn levels(&self) -> &[GrayImage] {
        &self.levels
    }
}

/// Index of the pixel at `index` of a line of `count` pixels, mirrored about its ends.
pub(super) fn mirrored(index: i32, count: usize) -> usize {
    let last = count as i32 - 1;
    let from_the_left = index.abs();
    let from_the_right = if from_the_left > last { 2 * last - from_the_left } else { from_the_left };
    from_the_right.clamp(0, last) as usize
}

/// Copies the pixels starting at `first` (column, row), which may be outside the image.
#[inline(always)]
pub(super) fn cut_out<T, const WIDTH: usize>(
    image: &GrayImage,
    first: [i32; 2],
    window: &mut [[T; WIDTH]],
    convert: impl Fn(u8) -> T,
) {
    let [left, top] = first;
    let inside = left >= 0 && left as usize + WIDTH <= image.width;
    if inside && top >= 0 && top as usize + window.len() <= image.height {
        let rows = image.pixels[top as usize * image.width + left as usize..].chunks(image.width);
        for (target, source) in window.iter_mut().zip(rows) {
            let Some(source) = source.first_chunk::<WIDTH>() else { continue };
            for (value, pixel) in target.iter_mut().zip(source) {
                *value = convert(*pixel);
            }
        }
        return;
    }
    let columns: [usize; WIDTH] = std::array::from_fn(|x| mirrored(left + x as i32, image.width));
    for (y, target) in window.iter_mut().enumerate() {
        let source = &image.pixels[mirrored(top + y as i32, image.height) * image.width..][..image.width];
        if inside && let Some(source) = source[left as usize..].first_chunk::<WIDTH>() {
            for (value, pixel) in target.iter_mut().zip(source) {
                *value = convert(*pixel);
            }
        } else {
            let pixels = columns.map(|column| source[column]);
            for (value, pixel) in target.iter_mut().zip(pixels) {
                *value = convert(pixel);
            }
        }
    }
}

/// Smooths `source` and keeps every second pixel of every second row.
fn halve(source: &GrayImage, target: &mut GrayImage, column_sums: &mut Vec<u16>) {
    let width = source.width;
    // One more pixel on the right, so that an odd width also forms whole pairs.
    column_sums.resize(width + 2 * FILTER_RADIUS + 1, 0);
    let row = |y: i32| &source.pixels[mirrored(y, source.height) * width..][..width];
    for (target_y, target_row) in target.pixels.chunks_exact_mut(target.width).enumerate() {
        let y = 2 * target_y as i32;
        let (above_2, above, middle, below, below_2) = (row(y - 2), row(y - 1), row(y), row(y + 1), row(y + 2));
        let sums = &mut column_sums[FILTER_RADIUS..FILTER_RADIUS + width];
        for x in 0..width {
            let inner = u16::from(above[x]) + u16::from(below[x]);
            sums[x] = u16::from(above_2[x]) + u16::from(below_2[x]) + 4 * inner + 6 * u16::from(middle[x]);
        }
        for x in 0..FILTER_RADIUS {
            column_sums[x] = column_sums[FILTER_RADIUS + mirrored(x as i32 - FILTER_RADIUS as i32, width)];
            column_sums[FILTER_RADIUS + width + x] = column_sums[FILTER_RADIUS + mirrored((width + x) as i32, width)];
        }
        let (pairs, _) = column_sums.as_chunks::<2>();
        for (pixel, taps) in target_row.iter_mut().zip(pairs.windows(3)) {
            let [[far_left, left], [middle, right], [far_right, _]] = *taps else { continue };
            // At most 16 · 16 · 255 + 128: fits into a u16.
            *pixel = ((far_left + far_right + 4 * (left + right) + 6 * middle + 128) >> 8) as u8;
        }
    }
}
