//! Camera poses and landmarks from the images alone, up to scale: an initial pair, then the other views one by one,
//! then a joint adjustment.
//!
//! Each view has an independent pose, because a gimbal may rotate the camera. Gyroscope and encoders only give initial
//! rotations and resolve the ambiguity of a plane.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3, Vector6};

use super::bearing::{BearingRotation, fit_rotation, refine_camera_pose};
use super::relative_pose::{RotationPrior, UnscaledPose, relative_poses};
use super::visual_problem::{
    BearingObservation, TrackedLandmark, between, mean_square, moved, visual_cost, visual_equations,
};
use crate::frontend::{FeatureId, TrackedFeature};
use crate::geometry::RigidTransform;
use crate::optimization::damped::{DampedOptions, DampedProblem, minimize};
use crate::optimization::{DensePoseEquations, Ray, ReprojectionEquations, TriangulationOptions, damp, triangulate};

/// Smallest parallax of a landmark with a depth.
const MIN_PARALLAX_RAD: f64 = 0.006;
/// Largest number of bearing pairs used for the parallax of two views.
const PARALLAX_PAIRS: usize = 60;
/// Parallax above which the score of a pair of views no longer grows.
const AMPLE_PARALLAX_RAD: f64 = 0.14;
/// Number of common features above which the score of a pair of views no longer grows.
const AMPLE_PAIRS: f64 = 60.0;
const PAIRS_TRIED: usize = 3;
/// A landmark with an observation beyond this many standard deviations is dropped.
const OUTLIER_SIGMAS: f64 = 4.0;

/// Observations of each feature as `(view, bearing)`, by ascending view.
pub(super) type Tracks = BTreeMap<FeatureId, Vec<(usize, Vector3<f64>)>>;

/// Collects the observations of all features that at least two views observe.
pub(super) fn collect_tracks(views: &[&[TrackedFeature]]) -> Tracks {
    let mut tracks = Tracks::new();
    for (view, features) in views.iter().enumerate() {
        for feature in *features {
            let norm = feature.bearing.norm();
            if norm.is_finite() && norm > 1e-9 {
                let observations = tracks.entry(feature.id).or_default();
                if observations.last().is_none_or(|(last, _)| *last != view) {
                    observations.push((view, feature.bearing / norm));
                }
            }
        }
    }
    tracks.retain(|_, observations| observations.len() >= 2);
    tracks
}

/// Keeps at most `most` tracks. Each pair of neighbouring views in turn selects its longest common track that is not
/// selected yet, so that every pair keeps its proportion. The front end has already spread the features over the image.
pub(super) fn thin_out(tracks: &mut Tracks, views: usize, most: usize) {
    if tracks.len() <= most {
        return;
    }
    let mut longest_first: Vec<_> = tracks.iter().collect();
    longest_first.sort_by_key(|(id, observations)| (std::cmp::Reverse(observations.len()), **id));
    let mut queues: Vec<VecDeque<FeatureId>> = vec![VecDeque::new(); views];
    for (id, observations) in longest_first {
        for pair in observations.windows(2).filter(|pair| pair[0].0 + 1 == pair[1].0) {
            queues[pair[0].0].push_back(*id);
        }
    }
    let mut kept = BTreeSet::new();
    while kept.len() < most && queues.iter().any(|queue| !queue.is_empty()) {
        for queue in &mut queues {
            while kept.len() < most
                && let Some(id) = queue.pop_front()
            {
                if kept.insert(id) {
                    break;
                }
            }
        }
    }
    tracks.retain(|id, _| kept.contains(id));
}

/// Bearings of the common features of two views.
pub(super) fn common_bearings(tracks: &Tracks, view_i: usize, view_j: usize) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let in_view = |observations: &[(usize, Vector3<f64>)], view: usize| {
        observations.binary_search_by_key(&view, |(view, _)| *view).ok().map(|index| observations[index].1)
    };
    tracks
        .values()
        .filter_map(|observations| Some((in_view(observations, view_i)?, in_view(observations, view_j)?)))
        .collect()
}

#[derive(Clone, Debug)]
pub(super) struct ViewPair {
    pub(super) view_i: usize,
    pub(super) view_j: usize,
    pub(super) common: usize,
    /// Rotation `camera_j_from_camera_i` and remaining parallax.
    pub(super) fit: BearingRotation,
}

impl ViewPair {
    fn score(&self) -> f64 {
        (self.common as f64).min(AMPLE_PAIRS) * self.fit.median_parallax_rad.min(AMPLE_PARALLAX_RAD)
    }
}

/// Pairs of views with at least `min_common` common features, best initial pair first.
pub(super) fn rank_pairs(
    tracks: &Tracks,
    guessed_rotations: &[UnitQuaternion<f64>],
    min_common: usize,
) -> Vec<ViewPair> {
    let mut pairs = Vec::new();
    for view_j in 1..guessed_rotations.len() {
        for view_i in 0..view_j {
            let bearings = common_bearings(tracks, view_i, view_j);
            if bearings.len() < min_common {
                continue;
            }
            // Every n-th pair: ids follow the detection grid, so the sample stays spread over the image.
            let stride = bearings.len().div_ceil(PARALLAX_PAIRS);
            let sample: Vec<_> = bearings.iter().step_by(stride).copied().collect();
            let guess = guessed_rotations[view_j].inverse() * guessed_rotations[view_i];
            if let Some(fit) = fit_rotation(&sample, &guess) {
                pairs.push(ViewPair { view_i, view_j, common: bearings.len(), fit });
            }
        }
    }
    pairs.sort_by(|a, b| b.score().total_cmp(&a.score()).then((a.view_i, a.view_j).cmp(&(b.view_i, b.view_j))));
    pairs
}

/// Reason for the failure of a reconstruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StructureFailure {
    /// No pair of views has a relative pose with enough inliers.
    NoRelativePose {
        /// Largest ratio of inliers to common features.
        inlier_ratio: f64,
    },
    FewLandmarks {
        landmarks: usize,
    },
    /// Too few views were placed.
    FewViews {
        views: usize,
    },
}

/// Reconstruction in the frame of its first view, in an arbitrary unit of length.
#[derive(Clone, Debug)]
pub(super) struct Structure {
    /// Indices of the placed views, ascending; all other fields refer to these only.
    pub(super) views: Vec<usize>,
    /// `first_camera_from_camera`, one per placed view.
    pub(super) poses: Vec<RigidTransform>,
    /// Landmarks; `anchor` and `view` are indices into `views`.
    pub(super) landmarks: Vec<TrackedLandmark>,
    /// Root mean square angle error of a bearing, per coordinate, in radians.
    pub(super) rms_rad: f64,
}

impl Structure {
    fn observations(&self) -> usize {
        self.landmarks.iter().map(|landmark| landmark.observations.len()).sum()
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct StructureLimits {
    pub(super) bearing_sigma_rad: f64,
    /// Standard deviation of the initial relative rotations.
    pub(super) rotation_sigma_rad: f64,
    pub(super) min_landmarks: usize,
    pub(super) min_views: usize,
    pub(super) min_inlier_ratio: f64,
    pub(super) seed: u64,
}

/// Reconstructs the views from the best initial pair that succeeds.
pub(super) fn reconstruct(
    tracks: &Tracks,
    pairs: &[ViewPair],
    guessed_rotations: &[UnitQuaternion<f64>],
    limits: &StructureLimits,
) -> Result<Structure, StructureFailure> {
    let mut failure = StructureFailure::NoRelativePose { inlier_ratio: 0.0 };
    for pair in pairs.iter().take(PAIRS_TRIED) {
        match reconstruct_from(tracks, pair, guessed_rotations, limits) {
            Ok(structure) => return Ok(structure),
            Err(reason) => failure = reason,
        }
    }
    Err(failure)
}

fn reconstruct_from(
    tracks: &Tracks,
    pair: &ViewPair,
    guessed_rotations: &[UnitQuaternion<f64>],
    limits: &StructureLimits,
) -> Result<Structure, StructureFailure> {
    let bearings = common_bearings(tracks, pair.view_i, pair.view_j);
    let guess = guessed_rotations[pair.view_j].inverse() * guessed_rotations[pair.view_i];
    let prior = RotationPrior { rotation: guess, sigma_rad: limits.rotation_sigma_rad };
    let bases = relative_poses(&bearings, &prior, limits.bearing_sigma_rad, limits.seed);
    let ratio_of_inliers = |base: &UnscaledPose| base.inliers.len() as f64 / bearings.len() as f64;
    let inlier_ratio = bases.iter().map(ratio_of_inliers).fold(0.0, f64::max);
    let mut best: Result<Structure, StructureFailure> = Err(StructureFailure::NoRelativePose { inlier_ratio });
    for base in bases.iter().filter(|base| ratio_of_inliers(base) >= limits.min_inlier_ratio) {
        let grown = grow(tracks, pair, base, guessed_rotations, limits);
        // The wrong solution of a plane places fewer views or landmarks, or fits worse.
        let merit = |structure: &Structure| {
            structure.observations() as f64 * (1.0 - structure.rms_rad / limits.bearing_sigma_rad / 3.0)
        };
        match (&grown, &best) {
            (Ok(new), Ok(old)) if merit(new) > merit(old) => best = grown,
            (_, Err(_)) => best = grown,
            _ => {}
        }
    }
    best
}

/// Places all other views on the points of the initial pair, then adjusts everything.
fn grow(
    tracks: &Tracks,
    pair: &ViewPair,
    base: &UnscaledPose,
    guessed_rotations: &[UnitQuaternion<f64>],
    limits: &StructureLimits,
) -> Result<Structure, StructureFailure> {
    let mut map = GrowingMap {
        tracks,
        poses: vec![None; guessed_rotations.len()],
        points: BTreeMap::new(),
        sigma_rad: limits.bearing_sigma_rad,
    };
    map.poses[pair.view_i] = Some(RigidTransform::identity());
    map.poses[pair.view_j] = Some(base.camera_j_from_camera_i.inverse());
    map.triangulate_seen_in(pair.view_i);
    for view in by_distance(pair, guessed_rotations.len()) {
        map.place(view, guessed_rotations, limits);
    }
    let structure = map.finish();
    if structure.views.len() < limits.min_views {
        return Err(StructureFailure::FewViews { views: structure.views.len() });
    }
    let structure = adjust(structure, limits.bearing_sigma_rad);
    if structure.landmarks.len() < limits.min_landmarks {
        return Err(StructureFailure::FewLandmarks { landmarks: structure.landmarks.len() });
    }
    Ok(structure)
}

/// Order of the other views: those inside the pair from both ends inwards, then those outside, nearest first.
fn by_distance(pair: &ViewPair, count: usize) -> Vec<usize> {
    let distance = |view: usize| view.abs_diff(pair.view_i).min(view.abs_diff(pair.view_j));
    let outside = |view: usize| view < pair.view_i || view > pair.view_j;
    let mut views: Vec<usize> = (0..count).filter(|view| *view != pair.view_i && *view != pair.view_j).collect();
    views.sort_by_key(|&view| (outside(view), distance(view), view));
    views
}

/// Views and points placed so far.
struct GrowingMap<'a> {
    tracks: &'a Tracks,
    poses: Vec<Option<RigidTransform>>,
    points: BTreeMap<FeatureId, Vector3<f64>>,
    sigma_rad: f64,
}

impl GrowingMap<'_> {
    /// Retriangulates every feature of a view from all views placed so far; the other features have the same views as
    /// before.
    fn triangulate_seen_in(&mut self, view: usize) {
        let limits = TriangulationOptions {
            rounds: 3,
            min_parallax_rad: MIN_PARALLAX_RAD,
            of_all_pairs: true,
            max_error_rad: OUTLIER_SIGMAS * self.sigma_rad,
        };
        for (id, observations) in self.tracks {
            if observations.binary_search_by_key(&view, |(view, _)| *view).is_err() {
                continue;
            }
            let ray = |(view, bearing): &(usize, Vector3<f64>)| {
                let pose = self.poses[*view]?;
                Some(Ray { centre: pose.translation_m, direction: pose.rotation * bearing })
            };
            let rays: Vec<Ray> = observations.iter().filter_map(ray).collect();
            match triangulate(&rays, &limits) {
                Some(point) => self.points.insert(*id, point),
                None => self.points.remove(id),
            };
        }
    }

    /// Places one more view on the points, with its nearest placed neighbour as initial value.
    fn place(&mut self, view: usize, guessed_rotations: &[UnitQuaternion<f64>], limits: &StructureLimits) {
        let known: Vec<(Vector3<f64>, Vector3<f64>)> = self
            .points
            .iter()
            .filter_map(|(id, point)| {
                let observations = self.tracks.get(id)?;
                let index = observations.binary_search_by_key(&view, |(view, _)| *view).ok()?;
                Some((*point, observations[index].1))
            })
            .collect();
        let placed = (0..self.poses.len()).filter(|&other| self.poses[other].is_some());
        let Some(neighbour) = placed.min_by_key(|other| other.abs_diff(view)) else { return };
        let Some(neighbour_pose) = self.poses[neighbour] else { return };
        let guess = guessed_rotations[neighbour].inverse() * guessed_rotations[view];
        let shared = common_bearings(self.tracks, view, neighbour);
        let rotation = fit_rotation(&shared, &guess).map_or(guess, |fit| fit.rotation);
        let start = RigidTransform::new(neighbour_pose.rotation * rotation, neighbour_pose.translation_m);
        let Some(pose) = refine_camera_pose(&known, &start, self.sigma_rad, OUTLIER_SIGMAS) else { return };
        let fitting = pose.inliers.iter().filter(|inlier| **inlier).count();
        let needed = (limits.min_inlier_ratio * known.len() as f64).max(8.0);
        if fitting as f64 >= needed {
            self.poses[view] = Some(pose.world_from_camera);
            self.triangulate_seen_in(view);
        }
    }

    /// Renumbers the placed views; the first of them becomes the reference frame.
    fn finish(self) -> Structure {
        let views: Vec<usize> = (0..self.poses.len()).filter(|&view| self.poses[view].is_some()).collect();
        let placed: Vec<RigidTransform> = self.poses.iter().filter_map(|pose| *pose).collect();
        let first_from_base = placed.first().map_or_else(RigidTransform::identity, RigidTransform::inverse);
        let poses: Vec<RigidTransform> = placed.iter().map(|pose| first_from_base * *pose).collect();
        let mut landmarks = Vec::new();
        for (id, point) in &self.points {
            let Some(observations) = self.tracks.get(id) else { continue };
            let seen: Vec<BearingObservation> = observations
                .iter()
                .filter_map(|(view, bearing)| Some(BearingObservation::new(views.binary_search(view).ok()?, *bearing)))
                .collect();
            let Some(anchor) = seen.first().map(|observation| observation.view) else { continue };
            let distance = (first_from_base.transform(point) - poses[anchor].translation_m).norm();
            landmarks.extend(TrackedLandmark::new(*id, 1.0 / distance, seen));
        }
        Structure { views, poses, landmarks, rms_rad: 0.0 }
    }
}

/// Adjusts all poses and depths twice; drops outlier landmarks in between.
fn adjust(mut structure: Structure, sigma_rad: f64) -> Structure {
    for _ in 0..2 {
        structure = bundle_adjust(structure, sigma_rad);
        let poses = between(&structure.poses);
        structure.landmarks.retain(|landmark| landmark.fits(&poses, sigma_rad, OUTLIER_SIGMAS));
    }
    structure.rms_rad = mean_square(&structure.landmarks, &structure.poses, sigma_rad).sqrt() * sigma_rad;
    structure
}

/// Adjusts all poses but the first, and all landmarks; only the damping constrains the scale.
fn bundle_adjust(structure: Structure, sigma_rad: f64) -> Structure {
    if structure.poses.len() < 2 {
        return structure;
    }
    let options = DampedOptions {
        iterations: 8,
        relative_cost_tolerance: 1e-4,
        first_damping: 1e-3,
        min_damping: 1e-8,
        max_damping: 1e8,
        growth: 20.0,
    };
    minimize(&mut FreeViews { sigma_rad }, structure, &options).estimate
}

/// Least-squares problem over all poses but the first, and all landmarks.
struct FreeViews {
    sigma_rad: f64,
}

impl DampedProblem for FreeViews {
    type Estimate = Structure;
    type Equations = ReprojectionEquations<DensePoseEquations>;

    fn cost(&self, structure: &Structure) -> f64 {
        visual_cost(&structure.landmarks, &structure.poses, self.sigma_rad)
    }

    fn linearize(&self, structure: &Structure) -> Self::Equations {
        visual_equations(&structure.landmarks, &structure.poses, self.sigma_rad)
    }

    fn step(&mut self, structure: &Structure, equations: &Self::Equations, damping: f64) -> Option<Structure> {
        let reduced = equations.eliminate(damping);
        let free = structure.poses.len() - 1;
        let mut hessian: DMatrix<f64> = DMatrix::zeros(6 * free, 6 * free);
        let mut gradient = DVector::zeros(6 * free);
        for row in 0..free {
            gradient.fixed_rows_mut::<6>(6 * row).copy_from(&reduced.poses.gradient[row + 1]);
            for column in 0..free {
                let block = reduced.poses.hessian.symmetric_block(row + 1, column + 1);
                hessian.fixed_view_mut::<6, 6>(6 * row, 6 * column).copy_from(&block);
            }
        }
        damp(&mut hessian, damping);
        hessian += DMatrix::identity(6 * free, 6 * free) * 1e-9;
        let solved = hessian.cholesky()?.solve(&gradient);
        let pose_step = |view: usize| match view.checked_sub(1) {
            Some(free) => -solved.fixed_rows::<6>(6 * free),
            None => Vector6::zeros(),
        };
        let steps = equations.substitute(&reduced, pose_step);
        Some(Structure {
            poses: structure.poses.iter().enumerate().map(|(view, pose)| pose.plus(&pose_step(view))).collect(),
            landmarks: moved(&structure.landmarks, &steps),
            views: structure.views.clone(),
            rms_rad: structure.rms_rad,
        })
    }
}
