//! Measures of a few images of a camera by which broken content shows: the mosaic of a colour sensor, rows of two
//! instants, parts of two images, changing exposure, exchanged bytes.
//!
//! Each is a difference that has no sign of its own in a sound image, however rich its texture is: its median over the
//! pixels or tiles of an image is zero, unless the content depends on the parity or number of rows and columns.

use std::ops::RangeInclusive;

use crate::files::LogLimits;
use crate::flight_log::images::decoding::{ByteOrders, byte_orders};
use crate::flight_log::messages::{MessageKind, read_image};
use crate::geometry::median;
use crate::sensors::GrayImage;

/// Number of groups of consecutive images, distributed evenly over the log.
pub(crate) const GROUPS: u64 = 8;
/// Number of consecutive images of a group.
const GROUP_IMAGES: u64 = 3;
/// Difference of the distances between groups, in images.
const SHIFT: u64 = 7;
/// Columns and rows of the measured tiles of an image.
const TILES: [usize; 2] = [8, 6];
/// Smallest and largest side of a tile, in pixels.
const TILE_PX: [usize; 2] = [8, 64];
/// Minimum number of tiles that measure an image.
const MIN_TILES: usize = 8;
/// Mean grey values of tiles that are neither black nor saturated.
const TILE_GREY: [f64; 2] = [8.0, 247.0];
/// Smallest root mean square gradient of tiles by which displacements are measured, in grey levels per pixel.
const TILE_GRADIENT: f64 = 4.0;
/// Number of standard deviations of a displacement that differs from zero.
const DISPLACED_SIGMAS: f64 = 4.0;
/// Smallest standard deviation of the grey values of a row with texture.
const ROW_SIGMA_GREY: f64 = 8.0;
/// Number of strips by which the change of an image is measured.
pub(crate) const STRIPS: usize = 16;
/// Ratio of the pixels of a row that may differ in a repeated row.
const REPEATED_OUTLIERS: f64 = 0.01;
/// Largest number of columns by which rows are compared.
const SEAM_COLUMNS: usize = 1024;
/// Largest displacement of two parts of an image against each other, in pixels.
const SEAM_REACH_PX: usize = 32;
/// Smallest number of columns by which rows are compared.
const SEAM_MIN_COLUMNS: usize = 4 * SEAM_REACH_PX;
/// Number of rows with the lowest correlation to the next row at which an image may be torn.
const SEAM_ROWS: usize = 3;
/// Largest correlation of two consecutive rows at a seam without a displacement.
const SEAM_UNDISPLACED: f64 = 0.95;
/// Smallest correlation of two consecutive rows at a seam with its displacement.
const SEAM_DISPLACED: f64 = 0.5;
/// Smallest gain of correlation by a displacement at a seam.
const SEAM_GAIN: f64 = 0.08;

/// True for the messages of the groups, by their number in a topic with a count of messages. The groups have unequal
/// distances, so that a fault of every fifth image, for example, is in some of them.
pub(crate) fn is_grouped(number: u64, count: u64) -> bool {
    let stride = count.div_ceil(GROUPS).max(GROUP_IMAGES);
    let group = number / stride;
    let start = group * stride + group * SHIFT % (stride - GROUP_IMAGES + 1);
    (start..start + GROUP_IMAGES).contains(&number)
}

/// Measures of some images of a camera.
#[derive(Clone, Debug, Default)]
pub(crate) struct ContentSurvey {
    /// Encoding by the messages of raw images; empty for compressed images.
    pub(crate) encoding: String,
    /// Groups of consecutive images in the order of the log.
    pub(crate) groups: Vec<Vec<ImageContent>>,
    /// Number and pixels of the image that was added last.
    last: Option<(u64, GrayImage)>,
}

/// Measures of one image.
#[derive(Clone, Debug, Default)]
pub(crate) struct ImageContent {
    pub(crate) stamp_ns: i64,
    pub(crate) mean_grey: f64,
    pub(crate) phases: Option<PhaseContrast>,
    pub(crate) fields: Option<FieldShift>,
    pub(crate) seam: Option<Seam>,
    /// Comparison with the image before; `None` for the first image of a group.
    pub(crate) change: Option<Change>,
    /// Both readings of an image whose bytes can be exchanged.
    pub(crate) orders: Option<[ValueSpread; 2]>,
}

/// Contrast between pixels of even and odd columns, of even and odd rows, and of both diagonals of 2×2 pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PhaseContrast {
    /// Median over the tiles of half the difference, relative to the mean grey value; positive if the pixel of column 0
    /// and row 0 is brighter.
    pub(crate) contrast: [f64; 3],
    /// Ratio of the tiles with the sign of the median.
    pub(crate) agreement: [f64; 3],
}

/// Displacement of the odd rows against the mean of the even rows around them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FieldShift {
    /// Median over the tiles of the displacement along the columns without its sign, in pixels.
    pub(crate) across_px: f64,
    /// Median displacement down the rows, in pixels.
    pub(crate) down_px: f64,
    /// Ratios of the tiles in which these differ from zero by more than their noise.
    pub(crate) significant: [f64; 2],
}

/// Two consecutive rows that agree only if one of them is displaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seam {
    /// Number of the upper row.
    pub(crate) row: usize,
    /// Displacement of the lower row along the columns.
    pub(crate) shift_px: i32,
}

/// Change from the image before.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Change {
    /// Longest stretch of rows with texture that equal those of the image before.
    pub(crate) repeated: Option<RangeInclusive<usize>>,
    /// Number of rows.
    pub(crate) height: usize,
    /// Mean difference of the other rows, in grey levels.
    pub(crate) elsewhere_grey: f64,
    /// Mean differences of equally high strips from top to bottom, in grey levels.
    pub(crate) strips_grey: [f64; STRIPS],
    /// Mean difference in grey levels from the odd rows of the image before to the even rows, and from the even rows to
    /// the odd rows.
    pub(crate) between_fields: [f64; 2],
}

/// Values of an image in an order of their bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ValueSpread {
    pub(crate) sigma: f64,
    /// Mean square difference of neighbours over twice the variance: one for noise, near zero for an image.
    pub(crate) roughness: f64,
}

impl ContentSurvey {
    /// Adds an image with its number in the topic; consecutive numbers make a group.
    pub(crate) fn add(&mut self, number: u64, stamp_ns: i64, image: GrayImage, orders: Option<[ValueSpread; 2]>) {
        let before = self.last.take().filter(|(last, _)| last + 1 == number).map(|(_, image)| image);
        let content = ImageContent::of(stamp_ns, &image, before.as_ref(), orders);
        match self.groups.last_mut().filter(|_| before.is_some()) {
            Some(group) => group.push(content),
            None => self.groups.push(vec![content]),
        }
        self.last = Some((number, image));
    }

    /// Notes the encoding of a raw image, and returns the spread of its values as they are stored and with exchanged bytes.
    pub(crate) fn orders(&mut self, kind: MessageKind, data: &[u8], limits: &LogLimits) -> Option<[ValueSpread; 2]> {
        if self.encoding.is_empty() && kind == MessageKind::Image {
            self.encoding = read_image(data).ok()?.encoding.to_owned();
        }
        let ByteOrders { stored, exchanged } = byte_orders(kind, data, limits)?;
        Some([ValueSpread::of(&stored), ValueSpread::of(&exchanged)])
    }

    /// Measures of all images.
    pub(crate) fn images(&self) -> impl Iterator<Item = &ImageContent> {
        self.groups.iter().flatten()
    }
}

impl ImageContent {
    fn of(stamp_ns: i64, image: &GrayImage, before: Option<&GrayImage>, orders: Option<[ValueSpread; 2]>) -> Self {
        let sum: u64 = image.pixels.iter().map(|pixel| u64::from(*pixel)).sum();
        let before = before.filter(|before| (before.width, before.height) == (image.width, image.height));
        let tiles = Tile::all(image);
        Self {
            stamp_ns,
            mean_grey: sum as f64 / image.pixels.len().max(1) as f64,
            phases: PhaseContrast::of(image, &tiles),
            fields: FieldShift::of(image, &tiles),
            seam: Seam::of(image),
            change: before.map(|before| Change::of(before, image, &tiles)),
            orders,
        }
    }
}

/// Square part of an image that begins at an even column and an even row.
#[derive(Clone, Copy, Debug)]
struct Tile {
    left: usize,
    top: usize,
    side: usize,
}

impl Tile {
    /// Tiles in rows and columns with equal distances; none in an image that is too small.
    fn all(image: &GrayImage) -> Vec<Self> {
        let [columns, rows] = TILES;
        let side = (image.width / columns).min(image.height / rows).min(TILE_PX[1]) & !1;
        if side < TILE_PX[0] {
            return Vec::new();
        }
        let at = |number: usize, count: usize, size: usize| ((size - side) * number / (count - 1)) & !1;
        let tile = |number: usize| Self {
            left: at(number % columns, columns, image.width),
            top: at(number / columns, rows, image.height),
            side,
        };
        (0..columns * rows).map(tile).collect()
    }

    /// Pixels of a row of the tile.
    fn row<'a>(&self, image: &'a GrayImage, row: usize) -> &'a [u8] {
        let start = (self.top + row) * image.width + self.left;
        &image.pixels[start..start + self.side]
    }

    /// Contrasts of [`PhaseContrast`] by the medians of second differences with the sign of their column and row; `None`
    /// for a tile that is black or saturated.
    fn contrasts(&self, image: &GrayImage) -> Option<[f64; 3]> {
        let sum: u64 = (0..self.side).flat_map(|row| self.row(image, row)).map(|pixel| u64::from(*pixel)).sum();
        let mean = sum as f64 / (self.side * self.side) as f64;
        if !(TILE_GREY[0]..TILE_GREY[1]).contains(&mean) {
            return None;
        }
        let mut differences: [Vec<i32>; 3] = Default::default();
        for row in 1..self.side - 1 {
            let [above, here, below] = [row - 1, row, row + 1].map(|row| self.row(image, row));
            for column in 1..self.side - 1 {
                // Without `array::map`, which is not inlined over codegen units.
                let smooth = |line: &[u8]| {
                    let (left, right) = (i32::from(line[column - 1]), i32::from(line[column + 1]));
                    let middle = i32::from(line[column]);
                    (left + 2 * middle + right, 2 * middle - left - right)
                };
                let (above, here, below) = (smooth(above), smooth(here), smooth(below));
                let sign = |parity: usize| if parity.is_multiple_of(2) { 1 } else { -1 };
                differences[0].push(sign(column) * (above.1 + 2 * here.1 + below.1));
                differences[1].push(sign(row) * (2 * here.0 - above.0 - below.0));
                differences[2].push(sign(column + row) * (2 * here.1 - above.1 - below.1));
            }
        }
        // The weights of each difference of an alternation add up to this.
        const WEIGHT: f64 = 16.0;
        Some(differences.map(|mut values| {
            let middle = values.len() / 2;
            f64::from(*values.select_nth_unstable(middle).1) / (WEIGHT * mean)
        }))
    }

    /// Displacements across and down of the odd rows, each with its standard deviation, in pixels; `None` without
    /// gradients along it.
    fn displacements(&self, image: &GrayImage) -> [Option<[f64; 2]>; 2] {
        // Sums of the squared gradient, of gradient times difference, and of the squared difference.
        let mut sums = [[0.0_f64; 3]; 2];
        let mut count = 0_usize;
        for row in (3..self.side - 1).step_by(2) {
            let [above, here, below] = [row - 1, row, row + 1].map(|row| self.row(image, row));
            for column in 1..self.side - 1 {
                let even = |at: usize| 0.5 * (f64::from(above[at]) + f64::from(below[at]));
                let both = |at: usize| 0.5 * (f64::from(here[at]) + even(at));
                let difference = f64::from(here[column]) - even(column);
                let gradients = [
                    0.5 * (both(column + 1) - both(column - 1)),
                    0.5 * (f64::from(below[column]) - f64::from(above[column])),
                ];
                for (sums, gradient) in sums.iter_mut().zip(gradients) {
                    sums[0] += gradient * gradient;
                    sums[1] += gradient * difference;
                    sums[2] += difference * difference;
                }
                count += 1;
            }
        }
        sums.map(|[gradients, products, differences]| {
            if gradients <= TILE_GRADIENT * TILE_GRADIENT * count as f64 {
                return None;
            }
            let displacement = -products / gradients;
            let remainder = (differences - displacement * displacement * gradients).max(0.0);
            Some([displacement, (remainder / (count as f64 * gradients)).sqrt()])
        })
    }
}

impl PhaseContrast {
    fn of(image: &GrayImage, tiles: &[Tile]) -> Option<Self> {
        let of_tiles: Vec<[f64; 3]> = tiles.iter().filter_map(|tile| tile.contrasts(image)).collect();
        if of_tiles.len() < MIN_TILES {
            return None;
        }
        let contrast = [0, 1, 2].map(|axis| median(of_tiles.iter().map(|tile| tile[axis])).unwrap_or(0.0));
        let agreement = [0, 1, 2].map(|axis| {
            let agreeing = of_tiles.iter().filter(|tile| tile[axis] * contrast[axis] > 0.0).count();
            agreeing as f64 / of_tiles.len() as f64
        });
        Some(Self { contrast, agreement })
    }
}

impl FieldShift {
    fn of(image: &GrayImage, tiles: &[Tile]) -> Option<Self> {
        let of_tiles: Vec<[Option<[f64; 2]>; 2]> = tiles.iter().map(|tile| tile.displacements(image)).collect();
        let along = |axis: usize| of_tiles.iter().filter_map(move |tile| tile[axis]);
        let significant = |axis: usize| {
            let count = along(axis).count();
            let displaced = along(axis).filter(|[shift, sigma]| shift.abs() > DISPLACED_SIGMAS * sigma).count();
            if count < MIN_TILES { 0.0 } else { displaced as f64 / count as f64 }
        };
        Some(Self {
            across_px: median(along(0).map(|[shift, _]| shift.abs()))?,
            down_px: median(along(1).map(|[shift, _]| shift))?,
            significant: [significant(0), significant(1)],
        })
    }
}

impl Seam {
    /// Seam with the largest gain of correlation by a displacement.
    fn of(image: &GrayImage) -> Option<Self> {
        let columns = image.width.min(SEAM_COLUMNS);
        let left = (image.width - columns) / 2;
        if columns < SEAM_MIN_COLUMNS || image.height < 2 {
            return None;
        }
        let row = |row: usize| &image.pixels[row * image.width + left..][..columns];
        let is_textured = |row: &[u8]| variance(row) > ROW_SIGMA_GREY * ROW_SIGMA_GREY;
        let mut places: Vec<(f64, usize)> = (0..image.height - 1)
            .filter(|upper| is_textured(row(*upper)) && is_textured(row(upper + 1)))
            .map(|upper| (correlation(row(upper), row(upper + 1)), upper))
            .filter(|(undisplaced, _)| *undisplaced < SEAM_UNDISPLACED)
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(f64, Self)> = None;
        for (_, upper) in places.into_iter().take(SEAM_ROWS) {
            let inner = &row(upper)[SEAM_REACH_PX..columns - SEAM_REACH_PX];
            let displaced = |start: usize| correlation(inner, &row(upper + 1)[start..start + inner.len()]);
            let all: Vec<f64> = (0..=2 * SEAM_REACH_PX).map(displaced).collect();
            let Some(start) = (0..all.len()).max_by(|a, b| all[*a].total_cmp(&all[*b])) else { continue };
            let gain = all[start] - all[SEAM_REACH_PX];
            let is_inside = start > 0 && start < 2 * SEAM_REACH_PX && start.abs_diff(SEAM_REACH_PX) > 1;
            if is_inside && all[start] > SEAM_DISPLACED && gain > best.map_or(SEAM_GAIN, |(gain, _)| gain) {
                best = Some((gain, Self { row: upper, shift_px: start as i32 - SEAM_REACH_PX as i32 }));
            }
        }
        best.map(|(_, seam)| seam)
    }
}

fn variance(values: &[u8]) -> f64 {
    let (mut sum, mut squares) = (0_u32, 0_u32);
    for value in values {
        let value = u32::from(*value);
        sum += value;
        squares += value * value;
    }
    let count = values.len().max(1) as f64;
    f64::from(squares) / count - (f64::from(sum) / count).powi(2)
}

/// Coefficient of correlation of equally many grey values, at most [`SEAM_COLUMNS`].
fn correlation(first: &[u8], second: &[u8]) -> f64 {
    let [mut sum_first, mut sum_second, mut products] = [0_u32; 3];
    for (first, second) in first.iter().zip(second) {
        sum_first += u32::from(*first);
        sum_second += u32::from(*second);
        products += u32::from(*first) * u32::from(*second);
    }
    let count = first.len().max(1) as f64;
    let covariance = f64::from(products) / count - f64::from(sum_first) * f64::from(sum_second) / (count * count);
    covariance / (variance(first) * variance(second)).sqrt().max(f64::MIN_POSITIVE)
}

impl Change {
    fn of(before: &GrayImage, image: &GrayImage, tiles: &[Tile]) -> Self {
        let rows = before.pixels.chunks_exact(image.width).zip(image.pixels.chunks_exact(image.width));
        let compared: Vec<(bool, f64)> = rows
            .map(|(before, now)| {
                let differing = before.iter().zip(now).filter(|(before, now)| before != now).count();
                let sum: u64 = before.iter().zip(now).map(|(before, now)| u64::from(before.abs_diff(*now))).sum();
                let is_repeated = (differing as f64) < REPEATED_OUTLIERS * now.len() as f64
                    && variance(&now[..now.len().min(SEAM_COLUMNS)]) > ROW_SIGMA_GREY * ROW_SIGMA_GREY;
                (is_repeated, sum as f64 / now.len() as f64)
            })
            .collect();
        let mut repeated: Option<RangeInclusive<usize>> = None;
        let mut start = 0;
        for (row, (is_repeated, _)) in compared.iter().enumerate() {
            if !is_repeated {
                start = row + 1;
            } else if repeated.as_ref().is_none_or(|longest| row - start > longest.end() - longest.start()) {
                repeated = Some(start..=row);
            }
        }
        let mean_grey =
            |rows: &[(bool, f64)]| rows.iter().map(|(_, grey)| grey).sum::<f64>() / rows.len().max(1) as f64;
        let strip = |number: usize| &compared[number * compared.len() / STRIPS..(number + 1) * compared.len() / STRIPS];
        let (above, below) =
            repeated.as_ref().map_or((compared.len(), compared.len()), |rows| (*rows.start(), rows.end() + 1));
        let elsewhere = [&compared[..above], &compared[below..]].concat();
        Self {
            height: image.height,
            elsewhere_grey: mean_grey(&elsewhere),
            strips_grey: std::array::from_fn(|number| mean_grey(strip(number))),
            between_fields: [1, 0].map(|parity| field_difference(before, image, tiles, parity)),
            repeated,
        }
    }

    /// Change in grey levels of the strip in the middle of some rows.
    pub(crate) fn around_grey(&self, rows: &RangeInclusive<usize>) -> f64 {
        let middle = usize::midpoint(*rows.start(), *rows.end());
        self.strips_grey[(middle * STRIPS / self.height.max(1)).min(STRIPS - 1)]
    }
}

/// Mean difference in grey levels of the rows of a parity of one image from the mean of the rows around them in another one.
fn field_difference(of: &GrayImage, from: &GrayImage, tiles: &[Tile], parity: usize) -> f64 {
    let (mut sum, mut count) = (0_u64, 0_usize);
    for tile in tiles {
        for row in (2 + parity..tile.side - 1).step_by(2) {
            let (above, below) = (tile.row(from, row - 1), tile.row(from, row + 1));
            for ((pixel, above), below) in tile.row(of, row).iter().zip(above).zip(below) {
                sum += u64::from((2 * u16::from(*pixel)).abs_diff(u16::from(*above) + u16::from(*below)));
                count += 1;
            }
        }
    }
    0.5 * sum as f64 / count.max(1) as f64
}

impl ValueSpread {
    fn of(values: &[u16]) -> Self {
        let count = values.len().max(1) as f64;
        let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / count;
        let square = |difference: f64| difference * difference;
        let variance = values.iter().map(|value| square(f64::from(*value) - mean)).sum::<f64>() / count;
        let of_neighbours =
            values.windows(2).map(|pair| square(f64::from(pair[0]) - f64::from(pair[1]))).sum::<f64>() / count;
        Self { sigma: variance.sqrt(), roughness: of_neighbours / (2.0 * variance).max(f64::MIN_POSITIVE) }
    }
}
