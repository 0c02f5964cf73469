//! Pixel encodings of raw images (`sensor_msgs/msg/Image`) and their gray values.

use crate::flight_log::grey_levels::Narrowing;
use crate::flight_log::messages::ImageMessage;

/// Storage of a raw image's pixels, by the names of ROS (`sensor_msgs/image_encodings.hpp`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RawEncoding {
    layout: PixelLayout,
    sample: SampleWidth,
}

/// Order of the samples in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PixelLayout {
    /// `samples` samples per pixel, gray value at `first`: one gray value per pixel, or the luma of a YUV image.
    Luma { samples: usize, first: usize },
    /// `samples` samples per pixel, red, green and blue at these.
    Color { samples: usize, rgb: [usize; 3] },
    /// One sample per pixel with a Bayer filter; `red` is the column and row of a red sample.
    Bayer { red: [usize; 2] },
    /// Plane of luma samples before planes of color.
    LumaPlane,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SampleWidth {
    Byte,
    /// Two bytes, of which a camera may use fewer bits.
    Wide,
}

/// Weights of red, green and blue in a gray value, in 1/65536 (ITU-R BT.601, as in JPEG).
const LUMA_WEIGHTS: [u64; 3] = [19_595, 38_470, 7_471];

impl RawEncoding {
    /// Encoding with a ROS name, `None` if it has no gray values or is not supported.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        let color = |samples, rgb| PixelLayout::Color { samples, rgb };
        let luma = |samples, first| PixelLayout::Luma { samples, first };
        let bayer = |column, row| PixelLayout::Bayer { red: [column, row] };
        let (layout, sample) = match name {
            "mono8" | "8UC1" => (luma(1, 0), SampleWidth::Byte),
            "mono16" | "16UC1" => (luma(1, 0), SampleWidth::Wide),
            "rgb8" => (color(3, [0, 1, 2]), SampleWidth::Byte),
            "bgr8" | "8UC3" => (color(3, [2, 1, 0]), SampleWidth::Byte),
            "rgba8" => (color(4, [0, 1, 2]), SampleWidth::Byte),
            "bgra8" | "8UC4" => (color(4, [2, 1, 0]), SampleWidth::Byte),
            "rgb16" => (color(3, [0, 1, 2]), SampleWidth::Wide),
            "bgr16" | "16UC3" => (color(3, [2, 1, 0]), SampleWidth::Wide),
            "rgba16" => (color(4, [0, 1, 2]), SampleWidth::Wide),
            "bgra16" | "16UC4" => (color(4, [2, 1, 0]), SampleWidth::Wide),
            // U Y V Y, and Y U Y V.
            "yuv422" | "uyvy" => (luma(2, 1), SampleWidth::Byte),
            "yuv422_yuy2" | "yuyv" => (luma(2, 0), SampleWidth::Byte),
            "nv12" | "nv21" | "nv24" => (PixelLayout::LumaPlane, SampleWidth::Byte),
            "bayer_rggb8" => (bayer(0, 0), SampleWidth::Byte),
            "bayer_grbg8" => (bayer(1, 0), SampleWidth::Byte),
            "bayer_gbrg8" => (bayer(0, 1), SampleWidth::Byte),
            "bayer_bggr8" => (bayer(1, 1), SampleWidth::Byte),
            "bayer_rggb16" => (bayer(0, 0), SampleWidth::Wide),
            "bayer_grbg16" => (bayer(1, 0), SampleWidth::Wide),
            "bayer_gbrg16" => (bayer(0, 1), SampleWidth::Wide),
            "bayer_bggr16" => (bayer(1, 1), SampleWidth::Wide),
            _ => return None,
        };
        Some(Self { layout, sample })
    }

    /// True if a sample has 16 bits.
    pub(super) fn is_wide(self) -> bool {
        self.sample == SampleWidth::Wide
    }

    /// Smallest width and height of an image: demosaicing needs both neighbours of a pixel's colors.
    pub(super) fn smallest_side_px(self) -> usize {
        if matches!(self.layout, PixelLayout::Bayer { .. }) { 2 } else { 1 }
    }

    /// Bytes of a row without padding.
    pub(crate) fn row_bytes(self, width: usize) -> usize {
        let samples = match self.layout {
            PixelLayout::Luma { samples, .. } | PixelLayout::Color { samples, .. } => samples,
            PixelLayout::Bayer { .. } | PixelLayout::LumaPlane => 1,
        };
        width * samples * if self.is_wide() { 2 } else { 1 }
    }

    /// Gray values of all pixels in 8 bits, row by row. Each row of the image must have at least [`Self::row_bytes`].
    pub(super) fn gray(self, raw: &ImageMessage<'_>, narrowing: Narrowing) -> Vec<u8> {
        if self == (Self { layout: PixelLayout::Luma { samples: 1, first: 0 }, sample: SampleWidth::Byte }) {
            return self.rows(raw).flatten().copied().collect();
        }
        if self.is_wide() {
            self.mapped(raw, |value| narrowing.narrowed(value))
        } else {
            self.mapped(raw, |value| value as u8)
        }
    }

    /// Gray values of all pixels with the bits of the samples (8 or 16), row by row; rows as for [`Self::gray`].
    pub(crate) fn values(self, raw: &ImageMessage<'_>) -> Vec<u16> {
        self.mapped(raw, |value| value)
    }

    /// [`Self::values`] with both bytes of each sample exchanged, or the chroma of packed YUV in place of its luma; `None` for
    /// other encodings.
    pub(super) fn exchanged(self, raw: &ImageMessage<'_>) -> Option<Vec<u16>> {
        match self.layout {
            PixelLayout::Luma { samples: 2, first } => {
                Some(Self { layout: PixelLayout::Luma { samples: 2, first: 1 - first }, ..self }.values(raw))
            }
            _ if self.is_wide() => Some(self.values(&ImageMessage { big_endian: !raw.big_endian, ..raw.clone() })),
            _ => None,
        }
    }

    fn mapped<T>(self, raw: &ImageMessage<'_>, narrow: impl Fn(u16) -> T + Copy) -> Vec<T> {
        if let PixelLayout::Bayer { red } = self.layout {
            let samples: Vec<u16> = self.rows(raw).flat_map(|row| self.samples(row, raw.big_endian)).collect();
            return Mosaic { width: raw.width, height: raw.height, samples: &samples, red }.gray(narrow);
        }
        let mut pixels = Vec::with_capacity(raw.width * raw.height);
        let bytes = if self.is_wide() { 2 } else { 1 };
        let sample = |pixel: &[u8], at: usize| Self::sample(&pixel[at * bytes..(at + 1) * bytes], raw.big_endian);
        for row in self.rows(raw) {
            match self.layout {
                PixelLayout::Luma { samples, first } => {
                    pixels.extend(row.chunks_exact(samples * bytes).map(|pixel| narrow(sample(pixel, first))));
                }
                PixelLayout::Color { samples, rgb } => {
                    let gray = |pixel: &[u8]| narrow(luma(rgb.map(|at| sample(pixel, at))));
                    pixels.extend(row.chunks_exact(samples * bytes).map(gray));
                }
                PixelLayout::LumaPlane | PixelLayout::Bayer { .. } => {
                    pixels.extend(self.samples(row, raw.big_endian).map(narrow));
                }
            }
        }
        pixels
    }

    fn rows<'a>(self, raw: &ImageMessage<'a>) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let row_bytes = self.row_bytes(raw.width);
        raw.data.chunks(raw.step.max(1)).take(raw.height).map(move |row| &row[..row_bytes.min(row.len())])
    }

    fn samples(self, row: &[u8], big_endian: bool) -> impl Iterator<Item = u16> + use<'_> {
        let bytes = if self.is_wide() { 2 } else { 1 };
        row.chunks_exact(bytes).map(move |sample| Self::sample(sample, big_endian))
    }

    /// Value of a sample of one or two bytes.
    fn sample(bytes: &[u8], big_endian: bool) -> u16 {
        match *bytes {
            [low, high] if !big_endian => u16::from_le_bytes([low, high]),
            [high, low] => u16::from_be_bytes([high, low]),
            _ => u16::from(bytes[0]),
        }
    }
}

/// Gray value of a color, rounded.
pub(super) fn luma(rgb: [u16; 3]) -> u16 {
    let sum: u64 = rgb.into_iter().zip(LUMA_WEIGHTS).map(|(value, weight)| u64::from(value) * weight).sum();
    ((sum + 32_768) >> 16) as u16
}

/// Samples with a Bayer filter: rows of red and green alternate with rows of green and blue.
struct Mosaic<'a> {
    width: usize,
    height: usize,
    samples: &'a [u16],
    /// Column and row of a red sample, 0 or 1.
    red: [usize; 2],
}

impl Mosaic<'_> {
    /// Gray values from bilinear interpolation of the three colors. At the border the image is mirrored at its
    /// outermost samples, which keeps the pattern.
    fn gray<T>(&self, narrow: impl Fn(u16) -> T) -> Vec<T> {
        let mirrored =
            |at: usize, size: usize| [at.checked_sub(1).unwrap_or(1), if at + 1 < size { at + 1 } else { size - 2 }];
        let [red, green, blue] = LUMA_WEIGHTS;
        let mut pixels = Vec::with_capacity(self.width * self.height);
        for row in 0..self.height {
            let line = |row: usize| &self.samples[row * self.width..(row + 1) * self.width];
            let [above, below] = mirrored(row, self.height);
            let (above, this, below) = (line(above), line(row), line(below));
            let in_red_row = row % 2 == self.red[1];
            // Color of this row that is not green, and the color of the rows above and below that is not green.
            let (in_row, other) = if in_red_row { (red, blue) } else { (blue, red) };
            for column in 0..self.width {
                let [left, right] = mirrored(column, self.width);
                let at = |line: &[u16], column: usize| u64::from(line[column]);
                let center = at(this, column);
                let horizontal = at(this, left) + at(this, right);
                let vertical = at(above, column) + at(below, column);
                let is_green = (column % 2 == self.red[0]) != in_red_row;
                let sum = if is_green {
                    4 * green * center + 2 * in_row * horizontal + 2 * other * vertical
                } else {
                    let diagonal = at(above, left) + at(above, right) + at(below, left) + at(below, right);
                    4 * in_row * center + green * (horizontal + vertical) + other * diagonal
                };
                pixels.push(narrow(((sum + (1 << 17)) >> 18) as u16));
            }
        }
        pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATTERNS: [(&str, [usize; 2]); 4] =
        [("bayer_rggb", [0, 0]), ("bayer_grbg", [1, 0]), ("bayer_gbrg", [0, 1]), ("bayer_bggr", [1, 1])];

    /// Mosaic of an image whose colors are a function of column and row.
    fn mosaic(size: [usize; 2], red: [usize; 2], color: impl Fn(usize, usize) -> [u16; 3]) -> Vec<u16> {
        let mut samples = Vec::new();
        for row in 0..size[1] {
            for column in 0..size[0] {
                let channel = usize::from(column % 2 != red[0]) + usize::from(row % 2 != red[1]);
                samples.push(color(column, row)[channel]);
            }
        }
        samples
    }

    fn decode(name: &str, [width, height]: [usize; 2], data: &[u8]) -> Vec<u8> {
        let encoding = RawEncoding::from_name(name).unwrap();
        let step = encoding.row_bytes(width);
        encoding
            .gray(&ImageMessage { width, height, encoding: name, big_endian: false, step, data }, Narrowing::default())
    }

    #[test]
    fn a_mosaic_of_one_color_is_its_grey_level_everywhere() {
        for (name, red) in PATTERNS {
            let samples = mosaic([5, 4], red, |_, _| [200, 100, 50]);
            let bytes: Vec<u8> = samples.iter().map(|sample| *sample as u8).collect();
            assert_eq!(decode(&format!("{name}8"), [5, 4], &bytes), [luma([200, 100, 50]) as u8; 20]);
            let wide: Vec<u8> = samples.iter().flat_map(|sample| (sample << 8).to_le_bytes()).collect();
            assert_eq!(
                decode(&format!("{name}16"), [5, 4], &wide),
                [(luma([200 << 8, 100 << 8, 50 << 8]) >> 8) as u8; 20]
            );
        }
    }

    #[test]
    fn bilinear_interpolation_is_exact_for_colors_that_change_linearly() {
        let size = [8, 6];
        let color =
            |x: usize, y: usize| [(10 + 8 * x + 4 * y) as u16, (200 - 6 * x - 2 * y) as u16, (30 + 20 * y) as u16];
        for (name, red) in PATTERNS {
            let bytes: Vec<u8> = mosaic(size, red, color).iter().map(|sample| *sample as u8).collect();
            let gray = decode(&format!("{name}8"), size, &bytes);
            for y in 1..size[1] - 1 {
                for x in 1..size[0] - 1 {
                    assert_eq!(u16::from(gray[y * size[0] + x]), luma(color(x, y)), "{name} at ({x}, {y})");
                }
            }
        }
    }

    #[test]
    fn luma_of_packed_and_planar_images_is_taken_as_it_is() {
        assert_eq!(decode("yuv422", [2, 2], &[128, 1, 128, 2, 128, 3, 128, 4]), [1, 2, 3, 4]);
        assert_eq!(decode("yuyv", [2, 2], &[1, 128, 2, 128, 3, 128, 4, 128]), [1, 2, 3, 4]);
        assert_eq!(decode("nv12", [2, 2], &[1, 2, 3, 4, 128, 128]), [1, 2, 3, 4]);
    }

    #[test]
    fn opacity_is_ignored() {
        let rgba = [255, 0, 0, 9, 0, 255, 0, 9, 0, 0, 255, 9, 255, 255, 255, 9];
        assert_eq!(decode("rgba8", [2, 2], &rgba), [76, 150, 29, 255]);
        assert_eq!(decode("bgra8", [2, 2], &rgba), [29, 150, 76, 255]);
    }

    #[test]
    fn wide_colors_keep_the_bits_below_the_brightest() {
        let values: [u16; 12] = [4095, 4095, 4095, 0, 0, 0, 2048, 2048, 2048, 16, 16, 16];
        let data: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let encoding = RawEncoding::from_name("rgb16").unwrap();
        let raw = ImageMessage { width: 2, height: 2, encoding: "rgb16", big_endian: false, step: 12, data: &data };
        assert_eq!(encoding.values(&raw), [4095, 0, 2048, 16]);
        assert_eq!(encoding.gray(&raw, Narrowing::Bits(12)), [255, 0, 128, 1]);
    }
}
