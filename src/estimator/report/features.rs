//! Features of the window after a step: observations with residuals, counts, points in the world.

use nalgebra::Vector3;

use super::observations::Observations;
use crate::frontend::FeatureId;

/// A feature of the solve.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureReport {
    /// Identity; [`FeatureId::camera`] is the number of its camera.
    pub id: FeatureId,
    /// Anchor frame.
    pub anchor_frame_index: usize,
    /// Inverse depth along the anchor's optical axis, in 1/m.
    pub inverse_depth_per_m: f64,
    /// All its observations in the window, the anchor's first.
    pub observations: Observations,
    /// Rejected as an outlier after this solve.
    pub rejected: bool,
}

/// Numbers of features in the solve, also of steps without stored features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FeatureCounts {
    /// Features in the solve.
    pub solved: usize,
    /// Features rejected as outliers after the solve.
    pub rejected: usize,
    /// Observations of all features in the window.
    pub observations: usize,
}

impl FeatureCounts {
    /// Counts the features of a report.
    pub fn of(features: &[FeatureReport]) -> Self {
        Self {
            solved: features.len(),
            rejected: features.iter().filter(|feature| feature.rejected).count(),
            observations: features.iter().map(|feature| feature.observations.len()).sum(),
        }
    }

    /// Features that were not rejected.
    pub fn inliers(&self) -> usize {
        self.solved - self.rejected
    }
}

/// A feature as a point of the world, for drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkReport {
    /// Identity of the feature.
    pub id: FeatureId,
    /// Position in the world, in metres.
    pub position_m: Vector3<f64>,
}
