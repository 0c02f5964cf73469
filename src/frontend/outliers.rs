//! Rejection of features that do not move with the scene: RANSAC on the epipolar geometry of two images.
//!
//! RANSAC (Fischler and Bolles, "Random sample consensus", CACM 1981) solves for the motion of minimal random samples
//! and keeps the hypothesis with the largest consensus. Here this is the one with the least truncated cost
//! `Σ min(d²/s², 1)` over the distances `d` of all tracks (MSAC: Torr and Zisserman, "MLESAC", CVIU 2000), with a scale
//! `s` that decreases from stage to stage.
//!
//! With a given rotation a minimal sample has two tracks: the normals `nᵢ = R fᵢ × f'ᵢ` of their epipolar planes are
//! perpendicular to the translation, so that `t ∝ n₁ × n₂`. If no hypothesis fits, samples of five tracks, as many as the
//! essential matrix has degrees of freedom (Nistér, "An efficient solution to the five-point relative pose problem",
//! PAMI 2004), are solved by Gauss–Newton from the fitted rotation instead of by Nistér's polynomial.
//!
//! A predicted rotation is a prior only: a gyroscope has a bias, and a gimbal's chain may have an error of degrees.
//! The rotation is estimated from the tracks, together with the direction of the translation.

use nalgebra::{Const, Matrix3, UnitQuaternion, Vector3};

pub use super::epipolar::BearingPair;
use super::epipolar::{MotionHypothesis, epipolar_distance, epipolar_distances, gauss_newton_step, geman_mcclure};
use super::prediction::PredictedRotation;
use crate::geometry::{median, so3};
use crate::optimization::{NormalEquations, gauss_newton};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierOptions {
    /// Largest distance of an inlier from its epipolar line, in pixels at the image centre.
    pub threshold_px: f64,
    /// Number of random samples of two tracks from which directions of translation are hypothesized, per stage and start.
    pub hypotheses: usize,
    /// With fewer tracks no track is rejected.
    pub min_tracks: usize,
    /// With a smaller ratio of inliers the model is invalid and no track is rejected.
    pub min_inlier_ratio: f64,
    /// Standard deviation of an inlier's track, in pixels; weights a predicted rotation against the tracks.
    pub track_sigma_px: f64,
    /// Seed of the random samples; the same for every image.
    pub seed: u64,
}

impl Default for OutlierOptions {
    fn default() -> Self {
        Self {
            threshold_px: 1.5,
            hypotheses: 24,
            min_tracks: 8,
            min_inlier_ratio: 0.4,
            track_sigma_px: 0.3,
            seed: 0x5eed,
        }
    }
}

/// Motion between two images, estimated from their tracks.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageMotion {
    /// Rotation `R` of the epipolar geometry, `camera_now_from_camera_previous`.
    pub rotation: UnitQuaternion<f64>,
    /// Unit direction of the translation of points from the previous camera frame to the current one; `None` without
    /// parallax.
    pub direction: Option<Vector3<f64>>,
    /// True for each inlier track.
    pub is_inlier: Vec<bool>,
}

/// Estimates the motion between two images and its inliers.
///
/// `start` is the initial rotation; `predicted` a prior on it, weighted by its covariance; `focal_px` converts angles to
/// pixels.
pub fn estimate_motion(
    pairs: &[BearingPair],
    start: &UnitQuaternion<f64>,
    predicted: Option<&PredictedRotation>,
    focal_px: f64,
    options: &OutlierOptions,
) -> ImageMotion {
    let rotation = fit_rotation(pairs, start, options.threshold_px / focal_px);
    let threshold = options.threshold_px / focal_px;
    if pairs.len() < options.min_tracks {
        return ImageMotion { rotation, direction: None, is_inlier: vec![true; pairs.len()] };
    }
    let prior = RotationInformation::new(predicted, options.track_sigma_px / focal_px);
    let mut ransac = Ransac { pairs, prior, options, random: XorShift64Star(options.seed.max(1)) };
    let epipolar = ransac.run(start, &rotation, threshold);
    let (rotation, direction) = choose_model(pairs, rotation, epipolar.as_ref(), threshold);
    let is_inlier: Vec<bool> = match &direction {
        Some(direction) => {
            pairs.iter().map(|pair| epipolar_distance(pair, &rotation, direction) <= threshold).collect()
        }
        None => pairs.iter().map(|pair| (pair.now - rotation * pair.previous).norm() <= threshold).collect(),
    };
    let ratio = is_inlier.iter().filter(|inlier| **inlier).count() as f64 / pairs.len() as f64;
    if ratio < options.min_inlier_ratio {
        return ImageMotion { rotation, direction: None, is_inlier: vec![true; pairs.len()] };
    }
    ImageMotion { rotation, direction, is_inlier }
}

/// Ratio of the outliers of a pure rotation that a direction of translation must explain.
const MIN_EXPLAINED_RATIO: f64 = 0.5;
/// Minimum number of outliers of a pure rotation; a direction fits any smaller number of them.
const MIN_MOVING_TRACKS: usize = 6;

/// Decides between pure rotation and a motion with parallax.
///
/// Without parallax any direction fits, and one through two outliers makes them inliers.
/// A direction is therefore accepted when it explains most of the outliers of the pure rotation.
fn choose_model(
    pairs: &[BearingPair],
    rotation: UnitQuaternion<f64>,
    epipolar: Option<&MotionHypothesis>,
    threshold: f64,
) -> (UnitQuaternion<f64>, Option<Vector3<f64>>) {
    let Some(epipolar) = epipolar else { return (rotation, None) };
    let moving = pairs.iter().filter(|pair| (pair.now - rotation * pair.previous).norm() > threshold);
    let (mut outliers, mut explained) = (0, 0);
    for pair in moving {
        outliers += 1;
        explained += usize::from(epipolar_distance(pair, &epipolar.rotation, &epipolar.direction) <= threshold);
    }
    let counts = outliers >= MIN_MOVING_TRACKS && explained as f64 >= MIN_EXPLAINED_RATIO * outliers as f64;
    if counts { (epipolar.rotation, Some(epipolar.direction)) } else { (rotation, None) }
}

/// Maximum iterations of [`fit_rotation`].
const ROTATION_ITERATIONS: usize = 12;

/// Robust fit of a rotation to pairs without parallax, from an initial one that may have a large error.
///
/// Gauss–Newton on `Σ ρ(|Rᵀ f' − f|)` with `R ← R Exp(φ)` and the Geman–McClure loss `ρ`: the step solves
/// `Σ w (I − f fᵀ) φ = Σ w f × Rᵀ f'`. The scale of the loss decreases with the median of the residuals, down to `floor`
/// (radians).
pub fn fit_rotation(pairs: &[BearingPair], start: &UnitQuaternion<f64>, floor: f64) -> UnitQuaternion<f64> {
    let linearize = |rotation: &UnitQuaternion<f64>| {
        let lengths = pairs.iter().map(|pair| (pair.now - rotation * pair.previous).norm());
        let scale = (2.0 * median(lengths)?).max(floor);
        let previous_from_now = rotation.inverse();
        let mut equations = NormalEquations::zeros(Const::<3>);
        for pair in pairs {
            let now_in_previous = previous_from_now * pair.now;
            let weight = geman_mcclure((now_in_previous - pair.previous).norm_squared() / (scale * scale));
            equations.hessian += weight * (Matrix3::identity() - pair.previous * pair.previous.transpose());
            equations.gradient -= weight * pair.previous.cross(&now_in_previous);
        }
        // A few bearings close together do not constrain the rotation about their mean; it keeps its initial value.
        equations.hessian += Matrix3::identity() * (1e-6 * equations.hessian.trace() + f64::MIN_POSITIVE);
        Some(equations)
    };
    let mut rotation = *start;
    gauss_newton(&mut rotation, ROTATION_ITERATIONS, linearize, |rotation, step| {
        *rotation = so3::plus(rotation, step);
        step.norm() < 1e-7
    });
    rotation
}

/// Scale of the distances in each stage, in thresholds.
const SCALES: [f64; 3] = [6.0, 2.0, 1.0];
/// Gauss–Newton steps of the refinement after each stage.
const REFINEMENTS: usize = 6;

/// With a smaller ratio of outliers the search ends with the first start: a motion with so few outliers is not a local
/// minimum.
const FEW_OUTLIERS_RATIO: f64 = 0.1;
/// With a larger ratio of outliers motions with a free rotation are also tried.
const MAX_OUTLIER_RATIO: f64 = 0.3;
/// Number of random samples of five tracks.
const FIVE_TRACK_SAMPLES: usize = 60;
/// Gauss–Newton steps that solve a sample of five tracks.
const MINIMAL_ITERATIONS: usize = 5;

/// Prior on the rotation, in units of an inlier's variance.
struct RotationInformation {
    rotation: UnitQuaternion<f64>,
    /// Information about the error in the current camera frame (3 × 3, 1/rad²), as [`PredictedRotation`] defines it.
    information: Matrix3<f64>,
    track_sigma_rad: f64,
}

impl RotationInformation {
    fn new(predicted: Option<&PredictedRotation>, track_sigma_rad: f64) -> Self {
        Self {
            rotation: predicted.map_or_else(UnitQuaternion::identity, |predicted| predicted.rotation),
            information: predicted.map_or_else(Matrix3::zeros, PredictedRotation::information),
            track_sigma_rad,
        }
    }

    /// Information (3 × 3) relative to squared track residuals over `scale`, and the error `Log(rotation·predictedᵀ)`
    /// of a rotation in the current camera frame (3 × 1), in radians.
    ///
    /// If the scale exceeds the noise of the tracks, the prior is weakened by the same factor.
    fn at(&self, rotation: &UnitQuaternion<f64>, scale: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let rotation_vector = so3::log(&(rotation * self.rotation.inverse()));
        (self.information * (self.track_sigma_rad / scale).powi(2), rotation_vector)
    }
}

/// Pairs that are summed between two comparisons of a cost with its limit.
const PAIRS_BETWEEN_CHECKS: usize = 16;

/// Search for the rotation and the direction of translation with the largest consensus.
struct Ransac<'a> {
    pairs: &'a [BearingPair],
    prior: RotationInformation,
    options: &'a OutlierOptions,
    random: XorShift64Star,
}

impl Ransac<'_> {
    /// Best hypothesis from either start, or from the first one with few outliers; `None` without parallax.
    fn run(
        &mut self,
        predicted: &UnitQuaternion<f64>,
        fitted: &UnitQuaternion<f64>,
        threshold: f64,
    ) -> Option<MotionHypothesis> {
        let pairs = self.pairs.len() as f64;
        let outlier_ratio = |best: &MotionHypothesis| best.cost / pairs;
        let mut best: Option<MotionHypothesis> = None;
        for rotation in [predicted, fitted] {
            let found = self.search_at_rotation(rotation, threshold);
            if let Some(found) = found
                && best.is_none_or(|best| found.cost < best.cost)
            {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|best| outlier_ratio(best) < FEW_OUTLIERS_RATIO) {
                break;
            }
        }
        if best.as_ref().is_none_or(|best| outlier_ratio(best) > MAX_OUTLIER_RATIO)
            && let Some(found) = self.search_by_five_tracks(fitted, threshold)
            && best.is_none_or(|best| found.cost < best.cost)
        {
            best = Some(found);
        }
        best
    }

    /// Samples directions of translation at a rotation and refines the best motion, at decreasing scales.
    fn search_at_rotation(&mut self, rotation: &UnitQuaternion<f64>, threshold: f64) -> Option<MotionHypothesis> {
        let mut best = MotionHypothesis { rotation: *rotation, direction: Vector3::zeros(), cost: f64::INFINITY };
        for thresholds in SCALES {
            let scale = thresholds * threshold;
            if best.cost.is_finite() {
                best.cost = self.cost(&best.rotation, &best.direction, scale, f64::INFINITY);
            }
            if let Some(sampled) = self.sample_directions(&best.rotation, scale, best.cost) {
                best = sampled;
            }
            if best.cost.is_finite() {
                best = self.refine(best, scale);
            }
        }
        best.cost.is_finite().then_some(best)
    }

    /// Best direction `t ∝ n₁ × n₂` of random samples of two tracks, with a fixed rotation; `None` if no cost is below
    /// `limit`.
    fn sample_directions(
        &mut self,
        rotation: &UnitQuaternion<f64>,
        scale: f64,
        mut limit: f64,
    ) -> Option<MotionHypothesis> {
        let rotated: Vec<BearingPair> = self.pairs.iter().map(|pair| pair.rotated(rotation)).collect();
        let prior_cost = self.prior_cost(rotation, scale);
        let mut best: Option<MotionHypothesis> = None;
        for _ in 0..self.options.hypotheses {
            let normals = [0, 1].map(|_| {
                let pair = &rotated[self.random.below(rotated.len())];
                pair.previous.cross(&pair.now)
            });
            let Some(axis) = normals[0].cross(&normals[1]).try_normalize(1e-14) else { continue };
            let (direction, cost) = better_sign(axis, costs(rotated.iter().copied(), &axis, scale, prior_cost, limit));
            if cost < limit {
                limit = cost;
                best = Some(MotionHypothesis { rotation: *rotation, direction, cost });
            }
        }
        best
    }

    /// Best motion of random samples of five tracks; used if no start converged.
    fn search_by_five_tracks(&mut self, rotation: &UnitQuaternion<f64>, threshold: f64) -> Option<MotionHypothesis> {
        let mut best: Option<MotionHypothesis> = None;
        for _ in 0..FIVE_TRACK_SAMPLES {
            let sample: [BearingPair; 5] = std::array::from_fn(|_| self.pairs[self.random.below(self.pairs.len())]);
            let normals = [0, 1].map(|k: usize| (rotation * sample[k].previous).cross(&sample[k].now));
            let Some(direction) = normals[0].cross(&normals[1]).try_normalize(1e-14) else { continue };
            let mut trial = MotionHypothesis { rotation: *rotation, direction, cost: f64::INFINITY };
            for _ in 0..MINIMAL_ITERATIONS {
                // Little damping, and a scale at which all five tracks have full weight.
                let damping = Matrix3::identity() * 1e-9;
                let Some(step) = gauss_newton_step(&sample, &trial, 1.0, &damping, &Vector3::zeros()) else { break };
                (trial.rotation, trial.direction) = step;
            }
            let limit = best.map_or(f64::INFINITY, |best| best.cost);
            let (direction, cost) =
                better_sign(trial.direction, self.costs(&trial.rotation, &trial.direction, threshold, limit));
            if cost < limit {
                best = Some(MotionHypothesis { direction, cost, ..trial });
            }
        }
        best.map(|best| self.refine(best, threshold))
    }

    /// Best iterate of a few Gauss–Newton steps on all tracks, with weights that reject outliers.
    fn refine(&self, start: MotionHypothesis, scale: f64) -> MotionHypothesis {
        let (mut best, mut at) = (start, start);
        for _ in 0..REFINEMENTS {
            let (information, error) = self.prior.at(&at.rotation, scale);
            let Some((rotation, direction)) = gauss_newton_step(self.pairs, &at, scale, &information, &error) else {
                break;
            };
            at = MotionHypothesis { rotation, direction, cost: self.cost(&rotation, &direction, scale, best.cost) };
            if at.cost < best.cost {
                best = at;
            }
        }
        best
    }

    fn cost(&self, rotation: &UnitQuaternion<f64>, direction: &Vector3<f64>, scale: f64, limit: f64) -> f64 {
        self.costs(rotation, direction, scale, limit)[0]
    }

    /// Costs of a direction and of the opposite one at a rotation, see [`costs`].
    fn costs(&self, rotation: &UnitQuaternion<f64>, direction: &Vector3<f64>, scale: f64, limit: f64) -> [f64; 2] {
        let rotated = self.pairs.iter().map(|pair| pair.rotated(rotation));
        costs(rotated, direction, scale, self.prior_cost(rotation, scale), limit)
    }

    /// Squared error of a rotation in standard deviations of the prior, in the unit of [`costs`].
    fn prior_cost(&self, rotation: &UnitQuaternion<f64>, scale: f64) -> f64 {
        let (information, rotation_vector) = self.prior.at(rotation, scale);
        rotation_vector.dot(&(information * rotation_vector))
    }
}

/// Costs of a direction and of the opposite one for pairs whose previous bearing is rotated: the truncated cost
/// `Σ min(d²/s², 1)` with the scale `s`, plus the cost of the prior.
///
/// The sum ends early when both costs reach `limit`; costs below it are complete.
fn costs(
    rotated: impl Iterator<Item = BearingPair>,
    direction: &Vector3<f64>,
    scale: f64,
    prior_cost: f64,
    limit: f64,
) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (index, pair) in rotated.enumerate() {
        let distances = epipolar_distances(&pair, direction);
        for (sum, distance) in sums.iter_mut().zip(distances) {
            *sum += (distance / scale).powi(2).min(1.0);
        }
        let is_checked = (index + 1).is_multiple_of(PAIRS_BETWEEN_CHECKS);
        if is_checked && sums.iter().all(|sum| sum + prior_cost >= limit) {
            break;
        }
    }
    sums.map(|sum| sum + prior_cost)
}

/// A direction or its opposite, whichever has the lower one of both costs, with that cost.
fn better_sign(direction: Vector3<f64>, [forward, backward]: [f64; 2]) -> (Vector3<f64>, f64) {
    if forward <= backward { (direction, forward) } else { (-direction, backward) }
}

/// Random number generator xorshift64* (Vigna, 2016), equal on all platforms.
struct XorShift64Star(u64);

impl XorShift64Star {
    fn below(&mut self, count: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let high = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32;
        ((high * count as u64) >> 32) as usize
    }
}
