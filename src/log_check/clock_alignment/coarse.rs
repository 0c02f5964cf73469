//! Correlation of angular speeds over all offsets of the search.

use super::series::{DISTINCT_S, MIN_ROTATIONS, PairRotation, RotationReference};
use crate::geometry::{self, ns_from_seconds, seconds_from_ns};

/// Step of the search and of the sampled speeds, in seconds.
const STEP_S: f64 = 0.01;
/// Ratio by which an image speed may exceed the largest reference speed: a wrong focal length scales the speeds of
/// images.
const SPEED_MARGIN: f64 = 1.5;
/// Most offsets that are refined.
const PEAKS: usize = 24;

/// Correlation of the angular speeds at one offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correlation {
    pub(super) offset_s: f64,
    pub(super) correlation: f64,
    /// Number of overlapping samples.
    count: usize,
}

impl Correlation {
    /// Fisher's transform in standard deviations of uncorrelated samples; a short overlap has larger correlations by
    /// chance.
    fn significance(&self) -> f64 {
        self.correlation.min(1.0 - 1e-9).atanh() * (self.count as f64).sqrt()
    }
}

/// Angular speeds of the images in rad/s, by index of a grid of [`STEP_S`]; sparse.
struct SpeedGrid {
    start_ns: i64,
    speeds: Vec<(usize, f64)>,
}

impl SpeedGrid {
    fn of(measured: &[PairRotation]) -> Self {
        let step_ns = ns_from_seconds(STEP_S);
        let start_ns = measured.iter().map(|pair| pair.from_ns).min().unwrap_or(0);
        let mut speeds: Vec<(usize, f64)> = Vec::new();
        for pair in measured {
            let speed = pair.rotation.norm() / pair.interval_s();
            let first = (pair.from_ns - start_ns).div_euclid(step_ns);
            let last = (pair.to_ns - start_ns).div_euclid(step_ns).max(first + 1);
            speeds.extend((first..last).filter_map(|place| Some((usize::try_from(place).ok()?, speed))));
        }
        speeds.sort_by_key(|(place, _)| *place);
        speeds.dedup_by_key(|(place, _)| *place);
        Self { start_ns, speeds }
    }
}

/// Correlation coefficient of the angular speeds of images and reference by offset in seconds; offsets with too little
/// overlap are omitted.
pub(super) fn correlation(
    measured: &[PairRotation],
    reference: &RotationReference,
    guess_s: f64,
    search_s: f64,
) -> Vec<Correlation> {
    let Some((first_ns, last_ns)) = reference.range_ns() else { return Vec::new() };
    let step_ns = ns_from_seconds(STEP_S);
    let images = SpeedGrid::of(measured);
    let interval_ns = measured.iter().map(|pair| pair.to_ns - pair.from_ns).min().unwrap_or(step_ns).max(step_ns);
    // Speed of the reference over the interval of the images, so that both have the same smoothing.
    let count = usize::try_from((last_ns - first_ns) / step_ns).unwrap_or(0);
    let speed = |place: usize| {
        let middle_ns = first_ns + place as i64 * step_ns + step_ns / 2;
        let rotation = reference.rotation(middle_ns - interval_ns / 2, middle_ns + interval_ns / 2);
        rotation.map_or(f64::NAN, |rotation| rotation.norm() / seconds_from_ns(interval_ns))
    };
    let speeds: Vec<f64> = (0..count).map(speed).collect();
    // The camera rotates no faster than the reference; larger speeds are due to wrong matches.
    let fastest = speeds.iter().copied().filter(|speed| speed.is_finite()).fold(0.0, f64::max) * SPEED_MARGIN;
    let steps = (search_s / STEP_S).round() as i64;
    let guess = (guess_s / STEP_S).round() as i64;
    let base = (images.start_ns - first_ns).div_euclid(step_ns);
    let offset_of_base_s = seconds_from_ns(first_ns + base * step_ns - images.start_ns);
    // All grid samples within one image interval have the same speed.
    let needed = MIN_ROTATIONS * usize::try_from(interval_ns / step_ns).unwrap_or(1).max(1) / 2;
    let at = |lag: i64| {
        let pairs = images.speeds.iter().filter_map(|(place, speed)| {
            let other = *speeds.get(usize::try_from(base + lag + *place as i64).ok()?)?;
            other.is_finite().then_some((speed.min(fastest), other))
        });
        let (correlation, count) = geometry::correlation(pairs).filter(|(_, count)| *count >= needed.max(2))?;
        Some(Correlation { offset_s: lag as f64 * STEP_S + offset_of_base_s, correlation, count })
    };
    (guess - steps..=guess + steps).filter_map(at).collect()
}

/// Most significant distinct offsets, the most significant first.
pub(super) fn peaks(correlation: &[Correlation]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..correlation.len()).collect();
    order.sort_by(|a, b| correlation[*b].significance().total_cmp(&correlation[*a].significance()));
    let mut found: Vec<f64> = Vec::new();
    for index in order {
        let offset_s = correlation[index].offset_s;
        if found.iter().all(|other| (other - offset_s).abs() > DISTINCT_S) {
            found.push(offset_s);
            if found.len() == PEAKS {
                break;
            }
        }
    }
    found
}
