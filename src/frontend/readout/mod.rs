//! Readout time of a rolling shutter, measured from feature tracks and the angular rate of the camera.
//!
//! Between two images the rotation of each row differs: a feature in the rows `s₁` and `s₂` (ratios of the height) is
//! observed at `t₁ + s₁·ρ` and `t₂ + s₂·ρ` with the readout `ρ`. Bearings are transformed to the first row of their image
//! by the rate, `f ← Exp(∫ ω dt) f` over `s·ρ`; at the true readout all of them then satisfy one rotation and one
//! direction of translation. Both are free for each pair of images and eliminated by the Schur complement
//! (`pair_motion.rs`), so that errors of gyroscope bias, extrinsics, encoders or time offsets do not bias the readout: it
//! is measured by the variation of the motion over the rows, where the rate changes between two images or features move
//! vertically.
//!
//! The rate comes from a gyroscope, or from the rotations of the images themselves by a cubic spline: for a camera that
//! rotates smoothly, as on a gimbal, this is better than the sum of a gyroscope and the derivatives of encoder
//! readings, whose noise would make the readout too small.

mod pair_motion;
mod rates;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use self::pair_motion::PairMotion;
use self::rates::{ReadoutSweep, rates_of};
use super::outliers::BearingPair;
use crate::geometry::{SIGMA_PER_MEDIAN, median, so3};
use crate::sensors::AngularRates;

/// Observation of one feature in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowObservation {
    /// Direction in the camera frame, unit length.
    pub bearing: Vector3<f64>,
    /// Row of the pixel as a ratio of the height: 0 in the first row.
    pub row: f64,
}

/// One feature in two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowTrack {
    /// In the previous image.
    pub previous: RowObservation,
    /// In the current image.
    pub now: RowObservation,
}

/// Features common to two images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImagePair {
    /// Times of the first rows of the previous and the current image in the camera's clock, in seconds.
    pub stamps_s: [f64; 2],
    /// Initial `camera_now_from_camera_previous`: points near a plane have two solutions.
    pub rotation: UnitQuaternion<f64>,
    /// Common features; outliers are tolerated.
    pub tracks: Vec<RowTrack>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadoutOptions {
    /// Largest and smallest standard deviation of a bearing, in radians; the value between them follows from the
    /// tracks.
    pub bearing_sigmas_rad: [f64; 2],
    /// Largest magnitude of the readout, in seconds.
    pub largest_s: f64,
    /// Largest magnitude of the time offset between camera and rates, in seconds.
    pub largest_offset_s: f64,
    /// Maximum number of image pairs; those with the largest change of the rate are used.
    pub most_pairs: usize,
}

impl ReadoutOptions {
    /// Options for a camera of this focal length, with track errors of a twentieth to half a pixel.
    pub fn for_focal_length(focal_px: f64) -> Self {
        const TRACK_SIGMAS_PX: [f64; 2] = [0.5, 0.05];
        let bearing_sigmas_rad = TRACK_SIGMAS_PX.map(|sigma_px| sigma_px / focal_px);
        Self { bearing_sigmas_rad, largest_s: 0.06, largest_offset_s: 0.1, most_pairs: 160 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadoutMeasurement {
    /// Time from the exposure of the first row to the exposure of a row past the last one; negative if rows are read from
    /// the bottom up.
    pub readout_s: f64,
    /// Standard deviation from the disagreement of segments of a second, and from their common error: the shutter
    /// itself distorts the image of a feature, so that its tracks have an error of some percent of the effect.
    pub sigma_s: f64,
    /// Time to add to the camera's stamps (of first rows) to obtain gyroscope time: 0 if the rotations do not constrain
    /// it, and without a gyroscope.
    pub time_offset_s: f64,
    /// Number of image pairs with enough features and rates.
    pub pairs: usize,
    /// Distance of nine of ten bearings from the motion of their pair (upper bound), without a readout and with this
    /// one, in radians.
    pub misfits_rad: [f64; 2],
}

/// Half the time over which the gyroscope's rates are averaged, in seconds.
const SMOOTHING_S: f64 = 0.01;
/// Typical readout, and typical distance of a row from the mean row; both give the typical difference between the rows
/// of a pair.
const USUAL_READOUT_S: f64 = 0.03;
const USUAL_ROW: f64 = 0.25;
/// Smallest such difference, as a ratio of the largest standard deviation of a bearing: errors of the lens model and
/// drifts of tracks are a twentieth of a pixel.
const MIN_EFFECT_RATIO: f64 = 0.14;
/// Quantile of the distances that a measurement reports.
const MISFIT_QUANTILE: f64 = 0.9;
/// Step of the search for a readout, in seconds.
const READOUT_STEP_S: f64 = 0.015;
/// Minimum number of common features of two images.
const MIN_TRACKS: usize = 20;
const MIN_PAIRS: usize = 12;
const REFINEMENTS: usize = 3;
/// Step of central differences, in seconds.
const DIFFERENCE_S: f64 = 2e-4;
/// Length of the segments whose disagreement gives the standard deviation, in seconds.
const STRETCH_S: f64 = 1.0;
/// Error common to all segments, as a ratio of the readout: on rendered flights with 30 ms the error is 1 to 3 %.
const SYSTEMATIC_RATIO: f64 = 0.02;
/// Rounds of alternating estimation of time offset and readout.
const ROUNDS: usize = 2;
/// Step of the search for a time offset, in seconds.
const OFFSET_STEP_S: f64 = 0.002;
/// A time offset must reduce the squared misfit of the rotations by this ratio.
const MIN_OFFSET_GAIN: f64 = 0.2;

/// Measures a camera's readout from pairs of images in order of time, and the camera's angular rate by a gyroscope
/// (camera frame, gyroscope time; bias and errors of the axes do not matter).
///
/// Without a gyroscope the rate is computed from the images, which then must be consecutive. Returns `None` with too few
/// pairs, or with so little rotation that the rows hardly differ.
pub fn measure_readout(
    images: &[ImagePair],
    gyroscope: Option<&AngularRates>,
    options: &ReadoutOptions,
) -> Option<ReadoutMeasurement> {
    let mut search = Search::new(images, gyroscope, options);
    if search.counting().count() < MIN_PAIRS {
        return None;
    }
    search.take_rates(0.0);
    let mut readout_s = search.coarse();
    for _ in 0..ROUNDS {
        search.fit(readout_s);
        search.take_sigma(readout_s);
        search.fit(readout_s);
        search.take_rates(readout_s);
        readout_s = search.refine(readout_s)?.0;
    }
    let (readout_s, sigma_s) = search.refine(readout_s)?;
    if search.row_effect_rad() < MIN_EFFECT_RATIO * options.bearing_sigmas_rad[0] {
        return None;
    }
    let with = search.misfit_rad(readout_s, MISFIT_QUANTILE);
    search.fit(0.0);
    let without = search.misfit_rad(0.0, MISFIT_QUANTILE);
    Some(ReadoutMeasurement {
        readout_s,
        sigma_s,
        time_offset_s: if gyroscope.is_some() { search.offset_s } else { 0.0 },
        pairs: search.counting().count(),
        misfits_rad: [without, with],
    })
}

/// Rotation between the first rows of two images of a camera with a known readout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstRowRotation {
    /// Times of both first rows as in [`ImagePair::stamps_s`], in seconds.
    pub stamps_s: [f64; 2],
    /// Rotation of the camera between both rows, `camera_now_from_camera_previous`.
    pub rotation: UnitQuaternion<f64>,
    /// Covariance of the rotation vector from the noise of the tracks, with the direction of translation unknown.
    pub covariance_rad2: Matrix3<f64>,
}

/// Rotations between the first rows of consecutive images at a readout, by the rates of the images themselves; the noise
/// of the tracks is estimated from their distances to the motions.
///
/// A rotation fitted to all features as if they were exposed at once is the rotation of their mean row only if features
/// do not move over the rows. Pairs with too few features are omitted.
pub fn rotations_of_first_rows(
    images: &[ImagePair],
    readout_s: f64,
    options: &ReadoutOptions,
) -> Vec<FirstRowRotation> {
    let mut search = Search::new(images, None, options);
    for _ in 0..ROUNDS {
        search.fit(readout_s);
        search.take_sigma(readout_s);
        search.take_rates(readout_s);
    }
    search.fit(readout_s);
    let of_pair = |pair: &Pair<'_>| {
        let carried = search.carried(pair.images, readout_s);
        let covariance_rad2 = pair.motion.rotation_covariance(&carried, search.sigma_rad)?;
        Some(FirstRowRotation { stamps_s: pair.images.stamps_s, rotation: pair.motion.rotation, covariance_rad2 })
    };
    search.pairs.iter().filter_map(of_pair).collect()
}

/// A pair of images with its current motion.
struct Pair<'a> {
    images: &'a ImagePair,
    motion: PairMotion,
    /// True if the pair is used for the readout; the others only provide rates.
    counts: bool,
}

struct Search<'a> {
    /// True if the rates are computed from the images.
    of_images: bool,
    rates: AngularRates,
    options: ReadoutOptions,
    /// Standard deviation of a bearing, in radians.
    sigma_rad: f64,
    pairs: Vec<Pair<'a>>,
    /// Time to add to the stamps to obtain the time of the rates, in seconds.
    offset_s: f64,
}

impl<'a> Search<'a> {
    fn new(images: &'a [ImagePair], gyroscope: Option<&AngularRates>, options: &ReadoutOptions) -> Self {
        // An image is read before the next one starts.
        let intervals_s = images.iter().map(|pair| pair.stamps_s[1] - pair.stamps_s[0]);
        let options = ReadoutOptions { largest_s: intervals_s.fold(options.largest_s, f64::min), ..*options };
        let usable = images.iter().filter(|pair| pair.tracks.len() >= MIN_TRACKS);
        let unfitted =
            |images: &'a ImagePair| Pair { images, motion: PairMotion::of_rotation(images.rotation), counts: true };
        let mut search = Self {
            of_images: gyroscope.is_none(),
            rates: gyroscope.map(|gyroscope| gyroscope.smoothed(SMOOTHING_S)).unwrap_or_default(),
            options,
            sigma_rad: options.bearing_sigmas_rad[0],
            pairs: usable.map(unfitted).collect(),
            offset_s: 0.0,
        };
        if let Some(gyroscope) = gyroscope {
            for pair in &mut search.pairs {
                let [from_s, to_s] = pair.images.stamps_s;
                let angle = gyroscope.angle_between(from_s, to_s).unwrap_or_default();
                pair.motion = PairMotion::of_rotation(so3::exp(&-angle));
            }
            search.select(options.largest_s + options.largest_offset_s);
        } else {
            search.fit(0.0);
            search.take_rates(0.0);
            search.select(options.largest_s);
        }
        search
    }

    /// Selects the pairs for which all rows have rates under any hypothesis, and of these the ones with the largest
    /// change of the rate.
    fn select(&mut self, reach_s: f64) {
        let change = |pair: &Pair<'_>| {
            let [from_s, to_s] = pair.images.stamps_s;
            self.rates.angle_between(from_s - reach_s, to_s + reach_s)?;
            self.rate_change(pair.images.stamps_s)
        };
        let mut ranked: Vec<(f64, usize)> =
            self.pairs.iter().enumerate().filter_map(|(index, pair)| Some((change(pair)?, index))).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        ranked.truncate(self.options.most_pairs);
        for pair in &mut self.pairs {
            pair.counts = false;
        }
        for (_, index) in ranked {
            self.pairs[index].counts = true;
        }
        if !self.of_images {
            self.pairs.retain(|pair| pair.counts);
        }
    }

    /// Sets the standard deviation of the bearings from their distances to the motions: if it is too large, small
    /// parallax is treated as noise.
    fn take_sigma(&mut self, readout_s: f64) {
        let [largest, smallest] = self.options.bearing_sigmas_rad;
        self.sigma_rad = (SIGMA_PER_MEDIAN * self.misfit_rad(readout_s, 0.5)).clamp(smallest, largest);
    }

    /// Updates the rates of the images at a readout or, with a gyroscope, the time offset.
    fn take_rates(&mut self, readout_s: f64) {
        if !self.of_images {
            return self.find_offset(readout_s);
        }
        let angles =
            self.pairs.iter().map(|pair| (pair.images.stamps_s, -so3::log(&self.of_middle_rows(pair, readout_s))));
        self.rates = rates_of(&angles.collect::<Vec<_>>());
        // Stamps belong to the first rows, but these rates to the middle rows.
        self.offset_s = -0.5 * readout_s;
    }

    /// Rotations of the camera during the readout of both images.
    fn sweeps(&self, images: &ImagePair, readout_s: f64) -> [ReadoutSweep; 2] {
        images.stamps_s.map(|stamp_s| ReadoutSweep::new(&self.rates, stamp_s + self.offset_s, readout_s))
    }

    fn of_middle_rows(&self, pair: &Pair<'_>, readout_s: f64) -> UnitQuaternion<f64> {
        let [previous, now] = self.sweeps(pair.images, readout_s).map(|sweep| sweep.at(0.5));
        so3::exp(&-now) * pair.motion.rotation * so3::exp(&previous)
    }

    /// Bearings of a pair transformed to the first rows.
    fn carried(&self, images: &ImagePair, readout_s: f64) -> Vec<BearingPair> {
        let [previous, now] = self.sweeps(images, readout_s);
        let carried = |track: &RowTrack| BearingPair {
            previous: so3::exp(&previous.at(track.previous.row)) * track.previous.bearing,
            now: so3::exp(&now.at(track.now.row)) * track.now.bearing,
        };
        images.tracks.iter().map(carried).collect()
    }

    /// Change of the angular rate between two times, in rad/s; `None` without rates there.
    fn rate_change(&self, [from_s, to_s]: [f64; 2]) -> Option<f64> {
        Some((self.rates.at(to_s)? - self.rates.at(from_s)?).norm())
    }

    /// Typical difference between the bearings of different rows of a pair at [`USUAL_READOUT_S`], median over pairs,
    /// in radians.
    fn row_effect_rad(&self) -> f64 {
        let change = |pair: &Pair<'_>| self.rate_change(pair.images.stamps_s.map(|stamp_s| stamp_s + self.offset_s));
        median(self.counting().filter_map(change)).unwrap_or(0.0) * USUAL_READOUT_S * USUAL_ROW
    }

    fn counting(&self) -> impl Iterator<Item = &Pair<'a>> {
        self.pairs.iter().filter(|pair| pair.counts)
    }

    /// Fits the motion of every pair at a readout; returns their cost.
    fn fit(&mut self, readout_s: f64) -> f64 {
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.par_iter_mut().for_each(|pair| {
            let carried = self.carried(pair.images, readout_s);
            pair.motion = pair.motion.fitted(&carried, self.sigma_rad);
        });
        self.pairs = pairs;
        // Summed in a fixed order, so that the cost does not depend on the number of threads.
        self.counting().map(|pair| pair.motion.cost).sum()
    }

    /// Readout of least cost on a grid over the whole range.
    fn coarse(&mut self) -> f64 {
        let steps = (self.options.largest_s / READOUT_STEP_S).round() as i32;
        let mut best = (f64::INFINITY, 0.0);
        for step in -steps..=steps {
            let readout_s = f64::from(step) * READOUT_STEP_S;
            let cost = self.fit(readout_s);
            if cost < best.0 {
                best = (cost, readout_s);
            }
        }
        best.1
    }

    /// Gauss–Newton from an initial readout; returns the readout with its standard deviation.
    fn refine(&mut self, start_s: f64) -> Option<(f64, f64)> {
        let mut readout_s = start_s;
        for _ in 0..REFINEMENTS {
            self.fit(readout_s);
            let (gradient, information) =
                self.equations(readout_s).iter().fold((0.0, 0.0), |sum, (_, g, i)| (sum.0 + g, sum.1 + i));
            if information <= 0.0 {
                return None;
            }
            let largest_s = self.options.largest_s;
            readout_s = (readout_s - gradient / information).clamp(-largest_s, largest_s);
        }
        self.fit(readout_s);
        let equations = self.equations(readout_s);
        let information: f64 = equations.iter().map(|(_, _, information)| information).sum();
        let mut stretches: Vec<(i64, f64)> = Vec::new();
        for (time_s, gradient, _) in &equations {
            let number = (time_s / STRETCH_S).floor() as i64;
            match stretches.last_mut() {
                Some((last, sum)) if *last == number => *sum += gradient,
                _ => stretches.push((number, *gradient)),
            }
        }
        let count = stretches.len() as f64;
        let spread: f64 = stretches.iter().map(|(_, gradient)| gradient * gradient).sum();
        // A single segment has no disagreement.
        let of_stretches_s = (spread * count / (count - 1.0).max(0.5)).sqrt() / information;
        let of_noise_s = information.sqrt().recip();
        let random_s = of_stretches_s.max(of_noise_s);
        Some((readout_s, random_s.hypot(SYSTEMATIC_RATIO * readout_s)))
    }

    /// Time, gradient and information of each pair for the readout, with its motion marginalized, in units of the
    /// bearings' noise.
    fn equations(&self, readout_s: f64) -> Vec<(f64, f64, f64)> {
        let of_pair = |pair: &Pair<'_>| {
            let [before, at, after] =
                [-DIFFERENCE_S, 0.0, DIFFERENCE_S].map(|step| self.carried(pair.images, readout_s + step));
            let (gradient, information) =
                pair.motion.eliminated(&at, [&before, &after], 2.0 * DIFFERENCE_S, self.sigma_rad)?;
            Some((pair.images.stamps_s[0], gradient, information))
        };
        self.counting().filter_map(of_pair).collect()
    }

    /// Finds the time offset at which the rates best predict the rotations of the images, up to a constant rate.
    fn find_offset(&mut self, readout_s: f64) {
        let middle_s = 0.5 * readout_s;
        let of_pair = |pair: &Pair<'_>| {
            let times_s = pair.images.stamps_s.map(|stamp_s| stamp_s + middle_s);
            (times_s, so3::log(&self.of_middle_rows(pair, readout_s)))
        };
        let measured: Vec<([f64; 2], Vector3<f64>)> = self.pairs.iter().map(of_pair).collect();
        let cost = |offset_s: f64| {
            let differences: Vec<Vector3<f64>> = measured
                .iter()
                .filter_map(|([from_s, to_s], rotation)| {
                    Some(rotation + self.rates.angle_between(from_s + offset_s, to_s + offset_s)?)
                })
                .collect();
            let component = |axis: usize| median(differences.iter().map(|difference| difference[axis])).unwrap_or(0.0);
            let middle = Vector3::from_fn(|axis, _| component(axis));
            median(differences.iter().map(|difference| (difference - middle).norm_squared())).unwrap_or(f64::INFINITY)
        };
        let steps = (self.options.largest_offset_s / OFFSET_STEP_S).round() as i32;
        let costs: Vec<(f64, f64)> = (-steps..=steps)
            .map(|step| f64::from(step) * OFFSET_STEP_S)
            .map(|offset_s| (offset_s, cost(offset_s)))
            .collect();
        let Some(best) = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { return };
        let unshifted = cost(0.0);
        self.offset_s = if best.1 < (1.0 - MIN_OFFSET_GAIN) * unshifted { best.0 } else { 0.0 };
    }

    /// Quantile of the distances of all bearings from the motion of their pair, in radians.
    fn misfit_rad(&self, readout_s: f64, quantile: f64) -> f64 {
        let of_pair = |pair: &Pair<'_>| pair.motion.distances(&self.carried(pair.images, readout_s));
        let mut distances: Vec<f64> = self.counting().flat_map(of_pair).collect();
        distances.sort_by(f64::total_cmp);
        distances.get((quantile * distances.len() as f64) as usize).copied().unwrap_or(0.0)
    }
}
