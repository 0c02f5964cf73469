//! Conversion of 16-bit grey values to 8 bits, by the values that a recording uses.

use crate::geometry::median;

/// Lowest and highest value of an image, without this ratio of its pixels on either side: dead pixels and small hot or
/// cold objects do not determine the contrast.
pub(crate) const OUTSIDE_RATIO: f64 = 0.005;
/// Grey levels of the lowest and the highest value; values outside the range continue linearly until they saturate.
const STRETCHED: [f64; 2] = [16.0, 239.0];
/// The upper eight of the used bits are taken if they give the range of values at least as many grey levels.
const ENOUGH_LEVELS: f64 = 96.0;
/// Smallest range of values that is stretched: of a smaller one, noise and steps of the sensor would become texture.
const MIN_RANGE: f64 = 64.0;
/// Smallest range of a stretch of the recording, as a ratio of the median range: a closed shutter has noise only.
const MIN_RANGE_RATIO: f64 = 0.25;

/// Conversion of the 16-bit grey values of one image to 8 bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Narrowing {
    /// The upper eight of this number of bits; brighter values saturate.
    Bits(u32),
    /// Linear, with these values at the grey levels 16 and 239.
    Range { low: f64, high: f64 },
}

impl Default for Narrowing {
    fn default() -> Self {
        Self::Bits(16)
    }
}

impl Narrowing {
    /// Grey level of a value.
    pub(super) fn narrowed(self, value: u16) -> u8 {
        match self {
            Self::Bits(bits) => u8::try_from(value >> (bits - 8)).unwrap_or(u8::MAX),
            Self::Range { low, high } => {
                let [black, white] = STRETCHED;
                let level = black + (f64::from(value) - low) / (high - low) * (white - black);
                level.round().clamp(0.0, 255.0) as u8
            }
        }
    }
}

/// Values of one image: range without [`OUTSIDE_RATIO`] of the pixels on either side, and largest value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ValueRange {
    low: u16,
    high: u16,
    brightest: u16,
}

impl ValueRange {
    /// Range of an image's values; `None` if it is black or has no pixels.
    pub(super) fn of(values: &[u16]) -> Option<Self> {
        let brightest = *values.iter().max()?;
        if brightest == 0 {
            return None;
        }
        let mut counts = vec![0_usize; usize::from(brightest) + 1];
        for value in values {
            counts[usize::from(*value)] += 1;
        }
        let outside = (values.len() as f64 * OUTSIDE_RATIO) as usize;
        // Remaining number of pixels that are passed on the way to the range.
        let (mut below, mut above) = (outside, outside);
        let is_inside = |left: &mut usize, count: usize| {
            let is_inside = count > *left;
            *left = left.saturating_sub(count);
            is_inside
        };
        let low = (0..counts.len()).find(|value| is_inside(&mut below, counts[*value]))?;
        let high = (0..counts.len()).rfind(|value| is_inside(&mut above, counts[*value]))?;
        Some(Self { low: u16::try_from(low).ok()?, high: u16::try_from(high).ok()?, brightest })
    }
}

/// Range of values at a log time in nanoseconds since the start of the log.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RangeAt {
    log_time_ns: i64,
    low: f64,
    high: f64,
}

/// Conversion of all images of a topic from 16 bits to 8.
///
/// A camera of 10, 12 or 14 bits leaves the upper bits at zero, so that the eight bits below the highest used one are
/// taken. A thermal camera uses a small range of its values instead (29500 to 30520 are 22 to 32 °C in hundredths of a
/// kelvin), which is stretched; the range follows the recording.
/// The conversion of an image depends on the recording and on the image's log time only, wherever reading starts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GreyLevels {
    bits: u32,
    /// Number of images that determine the conversion.
    images: usize,
    /// Ranges in time order; none if the upper bits are taken.
    ranges: Vec<RangeAt>,
}

impl Default for GreyLevels {
    fn default() -> Self {
        Self { bits: 16, images: 0, ranges: Vec::new() }
    }
}

impl GreyLevels {
    /// Conversion from the grey values of sampled images: for each stretch of the recording, in time order, the log time of
    /// its middle in nanoseconds and the values of its images.
    pub(super) fn of_stretches(stretches: &[(i64, Vec<ValueRange>)]) -> Self {
        let images = || stretches.iter().flat_map(|(_, images)| images);
        let Some(brightest) = images().map(|image| image.brightest).max() else { return Self::default() };
        let bits = (u16::BITS - brightest.leading_zeros()).next_multiple_of(2).max(8);
        let of_images = |images: &[ValueRange], value: fn(&ValueRange) -> u16| {
            median(images.iter().map(|image| f64::from(value(image))))
        };
        let measured: Vec<RangeAt> = stretches
            .iter()
            .filter_map(|(log_time_ns, images)| {
                let (low, high) = (of_images(images, |image| image.low)?, of_images(images, |image| image.high)?);
                Some(RangeAt { log_time_ns: *log_time_ns, low, high })
            })
            .collect();
        let usual = median(measured.iter().map(|range| range.high - range.low)).unwrap_or(0.0);
        let is_used = bits == 8 || usual >= ENOUGH_LEVELS * f64::from(1_u32 << (bits - 8));
        let least = MIN_RANGE.max(MIN_RANGE_RATIO * usual);
        let ranges = if is_used { Vec::new() } else { smoothed(&measured, least) };
        Self { bits, images: images().count(), ranges }
    }

    /// Conversion of the image with a log time in nanoseconds since the start of the log.
    pub(crate) fn at(&self, log_time_ns: i64) -> Narrowing {
        let after = self.ranges.partition_point(|range| range.log_time_ns <= log_time_ns);
        let (before, next) = (after.checked_sub(1).and_then(|at| self.ranges.get(at)), self.ranges.get(after));
        match (before, next) {
            (Some(before), Some(next)) => {
                let span_ns = next.log_time_ns.saturating_sub(before.log_time_ns) as f64;
                let ratio = log_time_ns.saturating_sub(before.log_time_ns) as f64 / span_ns;
                let between = |from: f64, to: f64| from + (to - from) * ratio;
                Narrowing::Range { low: between(before.low, next.low), high: between(before.high, next.high) }
            }
            (Some(only), None) | (None, Some(only)) => Narrowing::Range { low: only.low, high: only.high },
            (None, None) => Narrowing::Bits(self.bits),
        }
    }

    /// Number of bits in use, 8 to 16.
    pub(crate) fn bits(&self) -> u32 {
        self.bits
    }

    /// Number of images that determine the conversion.
    pub(crate) fn images(&self) -> usize {
        self.images
    }

    /// Lowest and highest value of the stretched ranges, and the smallest and largest of their sizes; `None` if the
    /// upper bits are taken.
    pub(crate) fn stretched(&self) -> Option<[f64; 4]> {
        let first = self.ranges.first()?;
        let size = first.high - first.low;
        Some(self.ranges.iter().fold([first.low, first.high, size, size], |[low, high, small, large], range| {
            let size = range.high - range.low;
            [low.min(range.low), high.max(range.high), small.min(size), large.max(size)]
        }))
    }
}

/// Ranges averaged with their neighbours (weights 1, 2, 1), each of at least a size.
fn smoothed(measured: &[RangeAt], least: f64) -> Vec<RangeAt> {
    let smooth = |at: usize| {
        let [before, this, after] = [at.saturating_sub(1), at, (at + 1).min(measured.len() - 1)].map(|at| measured[at]);
        let mean = |value: fn(RangeAt) -> f64| 0.25 * value(before) + 0.5 * value(this) + 0.25 * value(after);
        let (low, high) = (mean(|range| range.low), mean(|range| range.high));
        let wider = (0.5 * (least - (high - low))).max(0.0);
        RangeAt { log_time_ns: this.log_time_ns, low: low - wider, high: high + wider }
    };
    (0..measured.len()).map(smooth).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    /// Image whose values are spread evenly over a range.
    fn ramp(low: u16, high: u16) -> ValueRange {
        let values: Vec<u16> = (0..1000_u32).map(|at| low + (u32::from(high - low) * at / 999) as u16).collect();
        ValueRange::of(&values).unwrap()
    }

    fn levels(ranges: &[(u16, u16)]) -> GreyLevels {
        let stretches: Vec<(i64, Vec<ValueRange>)> = (0..)
            .step_by(2 * SECOND_NS as usize)
            .zip(ranges.iter().map(|(low, high)| vec![ramp(*low, *high)]))
            .collect();
        GreyLevels::of_stretches(&stretches)
    }

    #[test]
    fn dead_pixels_do_not_belong_to_the_range() {
        let mut values = vec![29_800; 990];
        values.extend([0, 0, 65_535, 65_535, 30_000, 30_000, 29_700, 29_700, 29_700, 29_700]);
        assert_eq!(ValueRange::of(&values), Some(ValueRange { low: 29_700, high: 29_800, brightest: 65_535 }));
        assert_eq!(ValueRange::of(&[0; 4]), None);
        assert_eq!(ValueRange::of(&[]), None);
    }

    #[test]
    fn a_camera_that_uses_its_bits_keeps_them() {
        for (brightest, bits) in [(255, 8), (1023, 10), (2000, 12), (4095, 12), (16_383, 14), (65_535, 16)] {
            let levels = levels(&[(0, brightest)]);
            assert_eq!((levels.bits(), levels.at(0)), (bits, Narrowing::Bits(bits)), "{brightest}");
        }
        let of_12_bits = [0, 16, 160, 1500, 4095, 5000].map(|value| Narrowing::Bits(12).narrowed(value));
        assert_eq!(of_12_bits, [0, 1, 10, 93, 255, 255]);
        // Eight bits in 16 have no finer steps to stretch.
        assert_eq!(levels(&[(100, 130)]).at(0), Narrowing::Bits(8));
        assert_eq!(GreyLevels::of_stretches(&[]).at(5), Narrowing::Bits(16));
    }

    #[test]
    fn a_small_range_is_stretched_over_the_grey_levels() {
        let narrowing = levels(&[(29_500, 30_520)]).at(0);
        let grey = [29_400, 29_505, 30_010, 30_515, 30_620, 0, 65_535].map(|value| narrowing.narrowed(value));
        assert_eq!(grey, [0, 16, 128, 239, 255, 0, 255]);
    }

    #[test]
    fn the_range_follows_the_recording_continuously() {
        let levels =
            levels(&[(20_000, 21_000), (20_000, 21_000), (22_000, 24_000), (22_000, 24_000), (22_000, 24_000)]);
        let low = |time_ns: i64| match levels.at(time_ns) {
            Narrowing::Range { low, .. } => low,
            Narrowing::Bits(_) => panic!("not stretched"),
        };
        assert_eq!(low(i64::MIN), low(0));
        assert_eq!(low(i64::MAX), low(8 * SECOND_NS));
        assert!((low(8 * SECOND_NS) - 22_010.0).abs() < 1.0 && (low(0) - 20_005.0).abs() < 1.0);
        let steps = (0..100).map(|step| low((step + 1) * SECOND_NS / 10) - low(step * SECOND_NS / 10));
        assert!(steps.clone().all(|step| (-1e-6..60.0).contains(&step)), "{:?}", steps.collect::<Vec<_>>());
        let [lowest, highest, smallest, largest] = levels.stretched().unwrap();
        assert!(lowest < 20_010.0 && highest > 23_980.0 && smallest < 1010.0 && largest > 1970.0);
    }

    #[test]
    fn a_closed_shutter_does_not_become_texture() {
        let levels =
            levels(&[(20_000, 21_000), (20_500, 20_505), (20_500, 20_505), (20_500, 20_505), (20_000, 21_000)]);
        let Narrowing::Range { low, high } = levels.at(4 * SECOND_NS) else { panic!("not stretched") };
        assert!(high - low > 0.99 * MIN_RANGE, "{low} to {high}");
    }
}
