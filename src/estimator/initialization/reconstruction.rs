//! Camera poses from images alone, for callers that do the alignment themselves.

use nalgebra::UnitQuaternion;

use super::InitializationOptions;
use super::structure::{StructureLimits, collect_tracks, rank_pairs, reconstruct};
use crate::frontend::TrackedFeature;
use crate::geometry::RigidTransform;

/// Initial values and options of a reconstruction.
#[derive(Clone, Copy, Debug)]
pub struct ReconstructionGuess<'a> {
    /// Orientation of every view in any common frame.
    pub rotations: &'a [UnitQuaternion<f64>],
    /// Standard deviation of the relative rotations, in radians.
    pub sigma_rad: f64,
    /// Seed of the random samples.
    pub seed: u64,
}

/// Poses of views up to scale, in the frame of the first placed view.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Indices of the placed views, ascending.
    pub views: Vec<usize>,
    /// `first_camera_from_camera`, one per placed view.
    pub poses: Vec<RigidTransform>,
    /// Root mean square angle error of a bearing, per coordinate, in radians.
    pub rms_rad: f64,
}

/// Reconstructs views of one camera from their features (step 3 in the module's list) within the limits of `options`.
///
/// Returns `None` when too few views or landmarks could be placed, or when the parallax is too small.
pub fn reconstruct_views(
    views: &[&[TrackedFeature]],
    guess: &ReconstructionGuess<'_>,
    options: &InitializationOptions,
) -> Option<Reconstruction> {
    let tracks = collect_tracks(views);
    let pairs = rank_pairs(&tracks, guess.rotations, options.min_common_features);
    if pairs.first()?.fit.median_parallax_rad < options.min_parallax_rad {
        return None;
    }
    let limits = StructureLimits {
        bearing_sigma_rad: options.bearing_sigma_rad,
        rotation_sigma_rad: guess.sigma_rad,
        min_landmarks: options.min_landmarks,
        min_views: options.min_views,
        min_inlier_ratio: options.min_inlier_ratio,
        seed: guess.seed,
    };
    let structure = reconstruct(&tracks, &pairs, guess.rotations, &limits).ok()?;
    let fits = structure.rms_rad <= options.max_reprojection_sigmas * options.bearing_sigma_rad;
    fits.then_some(Reconstruction { views: structure.views, poses: structure.poses, rms_rad: structure.rms_rad })
}
