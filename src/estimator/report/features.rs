//! Features of the window after a step: observations with residuals, counts, points in the world.

use nalgebra::Vector3;

use super::observations::Observations;
use crate::frontend::FeatureId;

/// Feature used in the solve.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureReport {
    /// [`FeatureId::camera`] is the index of its camera.
    pub id: FeatureId,
    pub anchor_frame_index: usize,
    /// Inverse depth along the anchor's optical axis, in 1/m.
    pub inverse_depth_per_m: f64,
    /// Observations in the window; the anchor's comes first.
    pub observations: Observations,
    /// Observations in the window by the other camera of a stereo pair.
    pub matched: Observations,
    /// True if rejected as an outlier after this solve.
    pub rejected: bool,
}

impl FeatureReport {
    /// Weight below which a track does not fit one point of the scene.
    const FITTING_WEIGHT: f64 = 0.5;

    /// Weight of the track as a whole: the largest robust weight of its observations.
    pub fn track_weight(&self) -> f64 {
        self.observations.iter().map(|seen| seen.robust_weight).fold(0.0, f64::max)
    }

    /// True if not even the best observation has half weight: the feature slides with the viewpoint, as where an outline
    /// crosses the background, or moves, or was mistracked.
    pub fn slides(&self) -> bool {
        self.track_weight() < Self::FITTING_WEIGHT
    }
}

/// Feature counts; also kept for steps whose features are not stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FeatureCounts {
    pub solved: usize,
    /// Features rejected as outliers after the solve.
    pub rejected: usize,
    /// Observations of all features in the window.
    pub observations: usize,
}

impl FeatureCounts {
    pub fn of(features: &[FeatureReport]) -> Self {
        Self {
            solved: features.len(),
            rejected: features.iter().filter(|feature| feature.rejected).count(),
            observations: features.iter().map(|feature| feature.observations.len()).sum(),
        }
    }

    pub fn inliers(&self) -> usize {
        self.solved - self.rejected
    }
}

/// Position of a feature, for the 3D view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkReport {
    pub id: FeatureId,
    /// In the world frame.
    pub position_m: Vector3<f64>,
}
