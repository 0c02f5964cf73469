//! Rejection of features that do not move with the scene, by the epipolar geometry of two images.
//!
//! A predicted rotation is a prior only: a gyroscope has a bias, and a gimbal's chain may have an error of degrees.
//! The rotation is estimated from the tracks, together with the direction of the translation.

use nalgebra::{Const, Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::prediction::PredictedRotation;
use crate::geometry::{median, so3, tangent_basis};
use crate::optimization::{NormalEquations, gauss_newton};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierOptions {
    /// Largest distance of an inlier from its epipolar line, in pixels at the image centre.
    pub threshold_px: f64,
    /// Number of random pairs of features from which directions of translation are hypothesized, per stage and start.
    pub hypotheses: usize,
    /// With fewer tracks no track is rejected.
    pub min_tracks: usize,
    /// With a smaller ratio of inliers the model is invalid and no track is rejected.
    pub min_inlier_ratio: f64,
    /// Standard deviation of an inlier's track, in pixels; weights a predicted rotation against the tracks.
    pub track_sigma_px: f64,
    /// Seed of the random pairs; the same for every image.
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
    /// Rotation `camera_now_from_camera_previous`.
    pub rotation: UnitQuaternion<f64>,
    /// Unit direction of the translation of points from the previous camera frame to the current one; `None` without
    /// parallax.
    pub direction: Option<Vector3<f64>>,
    /// True for each inlier track.
    pub is_inlier: Vec<bool>,
}

/// Unit directions of one feature in two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingPair {
    /// In the previous camera frame.
    pub previous: Vector3<f64>,
    /// In the current camera frame.
    pub now: Vector3<f64>,
}

/// Rotation and direction of translation with their cost.
#[derive(Clone, Copy)]
pub(super) struct MotionHypothesis {
    pub(super) rotation: UnitQuaternion<f64>,
    pub(super) direction: Vector3<f64>,
    pub(super) cost: f64,
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
    let mut search = Search { pairs, prior, options, dice: Dice(options.seed.max(1)), rotated: Vec::new() };
    let epipolar = search.run(start, &rotation, threshold);
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
/// Minimum number of such tracks; fewer fit any direction.
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
    let (mut left_over, mut explained) = (0, 0);
    for pair in moving {
        left_over += 1;
        explained += usize::from(epipolar_distance(pair, &epipolar.rotation, &epipolar.direction) <= threshold);
    }
    let counts = left_over >= MIN_MOVING_TRACKS && explained as f64 >= MIN_EXPLAINED_RATIO * left_over as f64;
    if counts { (epipolar.rotation, Some(epipolar.direction)) } else { (rotation, None) }
}

/// Distance of a pair from the epipolar geometry as an angle, to first order (Sampson's), in radians.
///
/// A point in front of both cameras moves towards `direction`; for a point that moves the other way the distance is the
/// length of its motion.
pub(super) fn epipolar_distance(pair: &BearingPair, rotation: &UnitQuaternion<f64>, direction: &Vector3<f64>) -> f64 {
    let rotated = BearingPair { previous: rotation * pair.previous, now: pair.now };
    epipolar_distances(&rotated, direction)[0]
}

/// [`epipolar_distance`] of a pair whose previous bearing is already rotated, for a direction and its opposite, in
/// radians.
fn epipolar_distances(pair: &BearingPair, direction: &Vector3<f64>) -> [f64; 2] {
    let rotated = pair.previous;
    let normal = direction.cross(&rotated);
    let other_normal = pair.now.cross(direction);
    let gap = pair.now.dot(&normal);
    let scale = normal.norm_squared() + other_normal.norm_squared() - 2.0 * gap * gap;
    let sampson = if scale > 1e-12 { gap.abs() / scale.sqrt() } else { 0.0 };
    let along = (direction - rotated * rotated.dot(direction)).dot(&(pair.now - rotated)) / normal.norm().max(1e-6);
    [sampson.max(-along), sampson.max(along)]
}

/// Maximum iterations of [`fit_rotation`].
const ROTATION_ITERATIONS: usize = 12;

/// Robust fit of a rotation to pairs, from an initial one that may have a large error.
///
/// Weights decrease with the fourth power of residual over scale; the scale decreases with the median of the residuals,
/// down to `floor`.
pub fn fit_rotation(pairs: &[BearingPair], start: &UnitQuaternion<f64>, floor: f64) -> UnitQuaternion<f64> {
    let linearize = |rotation: &UnitQuaternion<f64>| {
        let lengths = pairs.iter().map(|pair| (pair.now - rotation * pair.previous).norm());
        let scale = (2.0 * median(lengths)?).max(floor);
        let previous_from_now = rotation.inverse();
        let mut equations = NormalEquations::zeros(Const::<3>);
        for pair in pairs {
            let now_in_previous = previous_from_now * pair.now;
            let ratio = (now_in_previous - pair.previous).norm_squared() / (scale * scale);
            let weight = 1.0 / ((1.0 + ratio) * (1.0 + ratio));
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

/// Scales of the stages, in thresholds.
const STAGES: [f64; 3] = [6.0, 2.0, 1.0];
/// Steps of the refinement after each stage.
const REFINEMENTS: usize = 6;

/// With a smaller ratio of outliers the search ends with the first start: a motion with so few outliers is not a local
/// minimum.
const FEW_OUTLIERS_RATIO: f64 = 0.1;
/// With a larger ratio of outliers motions with a free rotation are also tried.
const MAX_OUTLIER_RATIO: f64 = 0.3;
/// Number of random samples of five tracks, and Gauss–Newton steps for each.
const FULL_HYPOTHESES: usize = 60;
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

/// Search for a rotation and a direction of translation.
struct Search<'a> {
    pairs: &'a [BearingPair],
    prior: RotationInformation,
    options: &'a OutlierOptions,
    dice: Dice,
    /// Pairs with the previous bearing rotated by the current rotation.
    rotated: Vec<BearingPair>,
}

impl Search<'_> {
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
            let found = self.descend(rotation, threshold);
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
            && let Some(found) = self.draw_with_rotation(fitted, threshold)
            && best.is_none_or(|best| found.cost < best.cost)
        {
            best = Some(found);
        }
        best
    }

    /// Best of many motions through five random tracks each; used if no start converged.
    fn draw_with_rotation(&mut self, rotation: &UnitQuaternion<f64>, threshold: f64) -> Option<MotionHypothesis> {
        let mut best: Option<MotionHypothesis> = None;
        for _ in 0..FULL_HYPOTHESES {
            let sample: [BearingPair; 5] = std::array::from_fn(|_| self.pairs[self.dice.below(self.pairs.len())]);
            let normals = [0, 1].map(|k: usize| (rotation * sample[k].previous).cross(&sample[k].now));
            let Some(direction) = normals[0].cross(&normals[1]).try_normalize(1e-14) else { continue };
            let mut trial = MotionHypothesis { rotation: *rotation, direction, cost: f64::INFINITY };
            for _ in 0..MINIMAL_ITERATIONS {
                // Little damping, and a scale at which all five tracks have full weight.
                let barely = Matrix3::identity() * 1e-9;
                let Some(step) = step_towards(&sample, &trial, 1.0, &barely, &Vector3::zeros()) else { break };
                (trial.rotation, trial.direction) = step;
            }
            for direction in [trial.direction, -trial.direction] {
                let limit = best.map_or(f64::INFINITY, |best| best.cost);
                let cost = self.cost(&trial.rotation, &direction, threshold, limit);
                if cost < limit {
                    best = Some(MotionHypothesis { direction, cost, ..trial });
                }
            }
        }
        best.map(|best| self.settle(best, threshold))
    }

    /// Best iterate of a few Gauss–Newton steps.
    fn settle(&self, start: MotionHypothesis, scale: f64) -> MotionHypothesis {
        let (mut best, mut at) = (start, start);
        for _ in 0..REFINEMENTS {
            let Some(refined) = self.refine(&at, scale, best.cost) else { break };
            at = refined;
            if at.cost < best.cost {
                best = at;
            }
        }
        best
    }

    /// Hypothesizes directions and refines the best one, at decreasing scales.
    fn descend(&mut self, rotation: &UnitQuaternion<f64>, threshold: f64) -> Option<MotionHypothesis> {
        let mut best = MotionHypothesis { rotation: *rotation, direction: Vector3::zeros(), cost: f64::INFINITY };
        for stage in STAGES {
            let scale = stage * threshold;
            if best.cost.is_finite() {
                best.cost = self.cost(&best.rotation, &best.direction, scale, f64::INFINITY);
            }
            if let Some(drawn) = self.draw(&best.rotation, scale, best.cost) {
                best = drawn;
            }
            if best.cost.is_finite() {
                best = self.settle(best, scale);
            }
        }
        best.cost.is_finite().then_some(best)
    }

    /// Best direction among those of random pairs of tracks, with a fixed rotation; `None` if no cost is below `below`.
    fn draw(&mut self, rotation: &UnitQuaternion<f64>, scale: f64, mut below: f64) -> Option<MotionHypothesis> {
        self.rotated.clear();
        self.rotated
            .extend(self.pairs.iter().map(|pair| BearingPair { previous: rotation * pair.previous, now: pair.now }));
        let pull = self.prior_cost(rotation, scale);
        let mut best: Option<MotionHypothesis> = None;
        for _ in 0..self.options.hypotheses {
            // Normals of the epipolar planes at the current rotation.
            let normals = [0, 1].map(|_| {
                let pair = &self.rotated[self.dice.below(self.rotated.len())];
                pair.previous.cross(&pair.now)
            });
            let Some(axis) = normals[0].cross(&normals[1]).try_normalize(1e-14) else { continue };
            let [forward, backward] = self.costs(&axis, scale, pull, below);
            let (direction, cost) = if forward <= backward { (axis, forward) } else { (-axis, backward) };
            if cost < below {
                below = cost;
                best = Some(MotionHypothesis { rotation: *rotation, direction, cost });
            }
        }
        best
    }

    /// Costs of a direction and of the opposite one with the rotated pairs: the sum of squared distances, each over
    /// `scale` and no larger than one, plus `pull`, the cost of the prior.
    ///
    /// The sum ends early when both costs reach `limit`; costs below it are complete.
    fn costs(&self, direction: &Vector3<f64>, scale: f64, pull: f64, limit: f64) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for pairs in self.rotated.chunks(PAIRS_BETWEEN_CHECKS) {
            for pair in pairs {
                let distances = epipolar_distances(pair, direction);
                for (sum, distance) in sums.iter_mut().zip(distances) {
                    *sum += (distance / scale).powi(2).min(1.0);
                }
            }
            if sums.iter().all(|sum| sum + pull >= limit) {
                break;
            }
        }
        sums.map(|sum| sum + pull)
    }

    /// Sum of squared distances over `scale`, each truncated at one, plus the cost of the prior.
    ///
    /// The sum ends early when the cost reaches `limit`; a cost below it is complete.
    fn cost(&self, rotation: &UnitQuaternion<f64>, direction: &Vector3<f64>, scale: f64, limit: f64) -> f64 {
        let pull = self.prior_cost(rotation, scale);
        let mut sum = 0.0;
        for pairs in self.pairs.chunks(PAIRS_BETWEEN_CHECKS) {
            for pair in pairs {
                let distance = epipolar_distance(pair, rotation, direction) / scale;
                sum += (distance * distance).min(1.0);
            }
            if sum + pull >= limit {
                break;
            }
        }
        sum + pull
    }

    /// Cost of the prior at a rotation, in the unit of [`Self::cost`].
    fn prior_cost(&self, rotation: &UnitQuaternion<f64>, scale: f64) -> f64 {
        let (information, rotation_vector) = self.prior.at(rotation, scale);
        rotation_vector.dot(&(information * rotation_vector))
    }

    /// One Gauss–Newton step on rotation and direction, with weights that reject outliers; its cost is that of
    /// [`Self::cost`] with this limit.
    fn refine(&self, at: &MotionHypothesis, scale: f64, limit: f64) -> Option<MotionHypothesis> {
        let (information, rotation_error) = self.prior.at(&at.rotation, scale);
        let (rotation, direction) = step_towards(self.pairs, at, scale, &information, &rotation_error)?;
        let cost = self.cost(&rotation, &direction, scale, limit);
        Some(MotionHypothesis { rotation, direction, cost })
    }
}

/// Damping of directions that neither tracks nor prior constrain, in the unit of [`step_towards`]'s normal matrix.
const MIN_INFORMATION: f64 = 1e-9;

/// A Gauss–Newton step on the epipolar distances of `pairs` in units of `scale`, with weights that decrease with
/// the distance.
///
/// The step is `[φ; δ]`: a right perturbation of the rotation, and two columns on the tangent plane of the direction.
/// `prior` is the information of the prior rotation (3 × 3), `rotation_error` its error in the current camera
/// frame, in radians; a step `φ` changes that error by `R·φ` to first order in the error.
pub(super) fn step_towards(
    pairs: &[BearingPair],
    at: &MotionHypothesis,
    scale: f64,
    prior: &Matrix3<f64>,
    rotation_error: &Vector3<f64>,
) -> Option<(UnitQuaternion<f64>, Vector3<f64>)> {
    let basis = tangent_basis(&at.direction);
    let previous_from_now = at.rotation.to_rotation_matrix().into_inner().transpose();
    // The factorization reads the lower triangle only.
    let mut normal = SMatrix::<f64, 5, 5>::zeros();
    let mut right = SVector::<f64, 5>::zeros();
    for pair in pairs {
        let rotated = at.rotation * pair.previous;
        let plane = at.direction.cross(&rotated);
        let other_plane = pair.now.cross(&at.direction);
        let gap = pair.now.dot(&plane);
        let spread = plane.norm_squared() + other_plane.norm_squared() - 2.0 * gap * gap;
        if spread < 1e-12 {
            continue;
        }
        let ratio = gap * gap / (spread * scale * scale);
        let weight = 1.0 / (spread * scale * scale * (1.0 + ratio) * (1.0 + ratio));
        let by_rotation = previous_from_now * rotated.cross(&other_plane);
        let by_direction = basis.tr_mul(&rotated.cross(&pair.now));
        let row = SVector::<f64, 5>::new(by_rotation.x, by_rotation.y, by_rotation.z, by_direction.x, by_direction.y);
        for column in 0..5 {
            for below in column..5 {
                normal[(below, column)] += row[below] * row[column] * weight;
            }
        }
        right -= row * (gap * weight);
    }
    let mut corner = normal.fixed_view_mut::<3, 3>(0, 0);
    corner += previous_from_now * prior * previous_from_now.transpose();
    let mut top = right.fixed_rows_mut::<3>(0);
    top -= previous_from_now * (prior * rotation_error);
    for k in 0..5 {
        // Without parallax the direction is unobservable; without a prior, so is the rotation about a single track.
        normal[(k, k)] += MIN_INFORMATION;
    }
    let step = normal.cholesky()?.solve(&right);
    let rotation = so3::plus(&at.rotation, &Vector3::new(step[0], step[1], step[2]));
    let direction = (at.direction + basis * step.fixed_rows::<2>(3)).try_normalize(1e-9)?;
    Some((rotation, direction))
}

/// Small random number generator (xorshift64*), equal on all platforms.
struct Dice(u64);

impl Dice {
    fn below(&mut self, count: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let high = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32;
        ((high * count as u64) >> 32) as usize
    }
}
