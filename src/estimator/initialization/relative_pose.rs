//! Relative pose of two views from bearing pairs: five-point hypotheses (RANSAC, Fischler and Bolles 1981), rotation
//! prior, robust refinement of the distances to the epipolar constraint `b_jᵀ E b_i = 0`, `E = [t]× R`.
//!
//! With a ratio w of inliers, `ln(1 − p) / ln(1 − w⁵)` samples contain one without outliers with probability p.

use nalgebra::{Const, Matrix3, UnitQuaternion, Vector3, Vector5};

use super::bearing::angle_between;
use super::essential::{decompose, five_point};
use crate::geometry::{RigidTransform, SplitMix64, so3, tangent_basis};
use crate::optimization::NormalEquations;
use crate::optimization::damped::{DampedOptions, LeastSquares, minimize};

/// Largest number of five-point samples drawn.
const MAX_SAMPLES: usize = 160;
/// Probability that a sample was free of outliers at which the search ends.
const CONFIDENCE: f64 = 0.999;
/// A pair is an inlier below this many standard deviations of the epipolar angle.
const INLIER_SIGMAS: f64 = 3.0;

/// Further samples, for the second solution of a plane.
const EXTRA_SAMPLES: usize = 12;
/// Hypotheses kept while sampling.
const KEPT: usize = 5;
/// Two hypotheses within this rotation and [`SAME_HEADING_RAD`] are equal.
const SAME_ROTATION_RAD: f64 = 0.02;
/// Largest angle between equal translation directions, see [`SAME_ROTATION_RAD`].
const SAME_HEADING_RAD: f64 = 0.2;
/// A pose is also returned when its cost (χ²) exceeds the best one by less than this per pair.
const AMBIGUOUS_RATIO: f64 = 0.3;

/// Unit bearings of one point in camera i and camera j.
type BearingPair = (Vector3<f64>, Vector3<f64>);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationPrior {
    pub rotation: UnitQuaternion<f64>,
    /// Standard deviation of the rotation about each axis, in radians.
    pub sigma_rad: f64,
}

/// Relative pose up to scale.
#[derive(Clone, Debug, PartialEq)]
pub struct UnscaledPose {
    /// Transform of points from camera i to camera j; the translation has unit length.
    pub camera_j_from_camera_i: RigidTransform,
    /// Indices of the inliers in front of both cameras.
    pub inliers: Vec<usize>,
    /// Root mean square epipolar angle of the inliers, in radians.
    pub rms_rad: f64,
}

/// Estimates the relative poses of two cameras from pairs `(bearing_i, bearing_j)`, best first.
///
/// Points (nearly) in a plane have two solutions; only a third view or a good prior on the rotation distinguishes them.
/// Without a prior, give a `sigma_rad` of π.
/// Samples are drawn from a generator seeded with `seed`: equal input gives equal bits.
pub fn relative_poses(
    pairs: &[(Vector3<f64>, Vector3<f64>)],
    prior: &RotationPrior,
    bearing_sigma_rad: f64,
    seed: u64,
) -> Vec<UnscaledPose> {
    if pairs.len() < 8 {
        return Vec::new();
    }
    let mut candidates = Candidates { pairs, prior, sigma_rad: bearing_sigma_rad, found: Vec::new() };
    if let Some(translation) = translation_for_rotation(pairs, &prior.rotation) {
        for sign in [1.0, -1.0] {
            let pose = RigidTransform::new(prior.rotation, translation * sign);
            candidates.consider(&refine(pairs, &pose, bearing_sigma_rad));
        }
    }
    let mut random = SplitMix64::new(seed);
    let mut needed = MAX_SAMPLES;
    let mut drawn = 0;
    while drawn < needed {
        drawn += 1;
        let sample = five_of(&mut random, pairs.len()).map(|index| pairs[index]);
        for essential in five_point(&sample) {
            if epipolar_cost(pairs, &essential, bearing_sigma_rad) >= candidates.worst_kept() {
                continue;
            }
            let Some(poses) = decompose(&essential) else { continue };
            for (rotation, translation) in poses {
                candidates.consider(&RigidTransform::new(rotation, translation));
            }
        }
        if let Some((_, pose)) = candidates.found.first() {
            let inlier_ratio = inliers(pairs, pose, bearing_sigma_rad).len() as f64 / pairs.len() as f64;
            let clean = inlier_ratio.powi(5).clamp(1e-9, 1.0 - 1e-9);
            needed = needed.min(((1.0 - CONFIDENCE).ln() / (1.0 - clean).ln()).ceil() as usize + EXTRA_SAMPLES);
        }
    }
    candidates.finish()
}

/// The best few distinct hypotheses, smallest cost first.
struct Candidates<'a> {
    pairs: &'a [BearingPair],
    prior: &'a RotationPrior,
    sigma_rad: f64,
    found: Vec<(f64, RigidTransform)>,
}

impl Candidates<'_> {
    /// Cost that a new hypothesis must undercut.
    fn worst_kept(&self) -> f64 {
        if self.found.len() < KEPT { f64::INFINITY } else { self.found.last().map_or(f64::INFINITY, |(cost, _)| *cost) }
    }

    /// Sum of squared whitened epipolar angles and prior; points behind a camera count as outliers.
    fn cost(&self, pose: &RigidTransform) -> f64 {
        let limit = INLIER_SIGMAS * INLIER_SIGMAS;
        let essential = essential_of(pose);
        let mut cost = (self.prior.rotation.inverse() * pose.rotation).angle().powi(2) / self.prior.sigma_rad.powi(2);
        for pair in self.pairs {
            let ratio = (epipolar_angle(&essential, pair) / self.sigma_rad).powi(2);
            cost += if ratio < limit && lies_in_front(pose, pair, self.sigma_rad) { ratio } else { limit };
        }
        cost
    }

    fn consider(&mut self, pose: &RigidTransform) {
        let cost = self.cost(pose);
        if !cost.is_finite() || cost >= self.worst_kept() {
            return;
        }
        let same = |(_, other): &(f64, RigidTransform)| {
            (other.rotation.inverse() * pose.rotation).angle() < SAME_ROTATION_RAD
                && angle_between(&other.translation_m, &pose.translation_m) < SAME_HEADING_RAD
        };
        if self.found.iter().any(|other| same(other) && other.0 <= cost) {
            return;
        }
        self.found.retain(|other| !same(other));
        let place = self.found.partition_point(|(other, _)| *other <= cost);
        self.found.insert(place, (cost, *pose));
        self.found.truncate(KEPT);
    }

    /// Refines the kept hypotheses; drops duplicates and those clearly worse than the best.
    fn finish(self) -> Vec<UnscaledPose> {
        let mut refined = Candidates { found: Vec::new(), ..self };
        for (_, pose) in &self.found {
            refined.consider(&refine(self.pairs, pose, self.sigma_rad));
        }
        let limit =
            refined.found.first().map_or(0.0, |(cost, _)| cost + (AMBIGUOUS_RATIO * self.pairs.len() as f64).max(10.0));
        let poses = refined.found.iter().take_while(|(cost, _)| *cost <= limit);
        poses
            .filter_map(|(_, pose)| {
                let inliers = inliers(self.pairs, pose, self.sigma_rad);
                let essential = essential_of(pose);
                let sum: f64 =
                    inliers.iter().map(|&index| epipolar_angle(&essential, &self.pairs[index]).powi(2)).sum();
                let rms_rad = (sum / inliers.len() as f64).sqrt();
                (!inliers.is_empty()).then_some(UnscaledPose { camera_j_from_camera_i: *pose, inliers, rms_rad })
            })
            .collect()
    }
}

fn essential_of(camera_j_from_camera_i: &RigidTransform) -> Matrix3<f64> {
    so3::hat(&camera_j_from_camera_i.translation_m) * camera_j_from_camera_i.rotation_matrix()
}

/// Distance of a pair from the epipolar constraint, to first order (Sampson): `|b_jᵀ E b_i| / √(|E b_i|² + |Eᵀ b_j|²)`, in
/// radians.
fn epipolar_angle(essential: &Matrix3<f64>, (bearing_i, bearing_j): &BearingPair) -> f64 {
    let line_j = essential * bearing_i;
    let line_i = essential.tr_mul(bearing_j);
    let gradient = (line_i.norm_squared() + line_j.norm_squared()).sqrt();
    if gradient > 0.0 { bearing_j.dot(&line_j).abs() / gradient } else { 0.0 }
}

fn epipolar_cost(pairs: &[BearingPair], essential: &Matrix3<f64>, sigma_rad: f64) -> f64 {
    let limit = INLIER_SIGMAS * INLIER_SIGMAS;
    pairs.iter().map(|pair| (epipolar_angle(essential, pair) / sigma_rad).powi(2).min(limit)).sum()
}

/// True if the point lies in front of both cameras or its parallax is too small to decide.
fn lies_in_front(
    camera_j_from_camera_i: &RigidTransform,
    (bearing_i, bearing_j): &BearingPair,
    sigma_rad: f64,
) -> bool {
    let rotated = camera_j_from_camera_i.rotation * bearing_i;
    // distance_j · bearing_j = distance_i · rotated + t; the cross product with each ray gives the other distance.
    let normal = rotated.cross(bearing_j);
    if normal.norm() < 2.0 * sigma_rad {
        return true;
    }
    let t = &camera_j_from_camera_i.translation_m;
    let along_i = bearing_j.cross(t).dot(&normal);
    let along_j = rotated.cross(t).dot(&normal);
    along_i > 0.0 && along_j > 0.0
}

fn inliers(pairs: &[BearingPair], pose: &RigidTransform, sigma_rad: f64) -> Vec<usize> {
    let essential = essential_of(pose);
    let fits = |pair: &BearingPair| {
        epipolar_angle(&essential, pair) < INLIER_SIGMAS * sigma_rad && lies_in_front(pose, pair, sigma_rad)
    };
    (0..pairs.len()).filter(|&index| fits(&pairs[index])).collect()
}

/// Direction of translation for a known rotation: eigenvector of the smallest eigenvalue of Σ n nᵀ over the epipolar
/// normals n.
fn translation_for_rotation(pairs: &[BearingPair], rotation: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
    let mut moment = Matrix3::zeros();
    for (bearing_i, bearing_j) in pairs {
        let normal = (rotation * bearing_i).cross(bearing_j);
        moment += normal * normal.transpose();
    }
    let eigen = moment.try_symmetric_eigen(1e-15, 200)?;
    let least = (0..3).min_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]))?;
    Some(eigen.eigenvectors.column(least).into_owned())
}

/// Robust least squares of the epipolar angles over rotation (3) and direction of translation (2).
fn refine(pairs: &[BearingPair], start: &RigidTransform, sigma_rad: f64) -> RigidTransform {
    let options = DampedOptions {
        iterations: 12,
        relative_cost_tolerance: 1e-6,
        first_damping: 1e-4,
        min_damping: 1e-9,
        max_damping: 1e6,
        growth: 30.0,
    };
    minimize(&mut EpipolarFit { pairs, sigma_rad }, *start, &options).estimate
}

/// Least-squares problem over the epipolar angles of all pairs.
struct EpipolarFit<'a> {
    pairs: &'a [BearingPair],
    sigma_rad: f64,
}

impl LeastSquares for EpipolarFit<'_> {
    type Estimate = RigidTransform;
    /// By `[φ; 2 in the tangent plane of the translation]`.
    type Equations = NormalEquations<Const<5>>;

    fn cost(&self, pose: &RigidTransform) -> f64 {
        robust_cost(self.pairs, pose, self.sigma_rad)
    }

    fn linearize(&self, pose: &RigidTransform) -> Self::Equations {
        let basis = tangent_basis(&pose.translation_m);
        let rotation = pose.rotation_matrix();
        let essential = essential_of(pose);
        let mut equations = NormalEquations::zeros(Const);
        for (bearing_i, bearing_j) in self.pairs {
            let length = ((essential * bearing_i).norm_squared() + essential.tr_mul(bearing_j).norm_squared()).sqrt();
            if length < 1e-12 {
                continue;
            }
            let residual = bearing_j.dot(&(essential * bearing_i)) / length;
            let by_rotation = -(bearing_j.transpose() * so3::hat(&pose.translation_m) * rotation * so3::hat(bearing_i));
            let by_direction = basis.tr_mul(&(rotation * bearing_i).cross(bearing_j));
            let row =
                Vector5::new(by_rotation.x, by_rotation.y, by_rotation.z, by_direction.x, by_direction.y) / length;
            let weight = 1.0 / (1.0 + (residual / (2.0 * self.sigma_rad)).powi(2)).powi(2);
            equations.hessian += row * row.transpose() * weight;
            equations.gradient += row * (residual * weight);
        }
        equations
    }

    fn plus(&self, pose: &RigidTransform, step: &Vector5<f64>) -> RigidTransform {
        let rotation = so3::plus(&pose.rotation, &step.fixed_rows::<3>(0).into_owned());
        let direction = pose.translation_m + tangent_basis(&pose.translation_m) * step.fixed_rows::<2>(3);
        RigidTransform::new(rotation, direction.normalize())
    }
}

/// Geman–McClure cost of the epipolar angles; the scale is two standard deviations.
fn robust_cost(pairs: &[BearingPair], pose: &RigidTransform, sigma_rad: f64) -> f64 {
    let essential = essential_of(pose);
    let square = |pair| (epipolar_angle(&essential, pair) / (2.0 * sigma_rad)).powi(2);
    pairs.iter().map(|pair| square(pair) / (1.0 + square(pair))).sum()
}

/// Five different indices below `count` (which must be at least five).
fn five_of(random: &mut SplitMix64, count: usize) -> [usize; 5] {
    let mut chosen = [usize::MAX; 5];
    let mut filled = 0;
    while filled < 5 {
        let candidate = (random.next_u64() % count.max(5) as u64) as usize;
        if !chosen[..filled].contains(&candidate) {
            chosen[filled] = candidate;
            filled += 1;
        }
    }
    chosen
}
