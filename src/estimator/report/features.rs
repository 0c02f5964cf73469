//! Features of the window after a step: observations with residuals, counts, points in the world.

use nalgebra::{Vector2, Vector3};

use super::observations::Observations;
use crate::frontend::FeatureId;

/// Observation of a feature in a frame of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservationReport {
    /// Index of the observing image in its stream.
    pub frame_index: usize,
    pub measured_px: Vector2<f64>,
    /// Predicted minus measured before the solve, in pixels; `None` behind the camera.
    pub residual_before_px: Option<Vector2<f64>>,
    /// Predicted minus measured after the solve, in pixels; `None` behind the camera.
    pub residual_after_px: Option<Vector2<f64>>,
    /// Squared whitened residual after the solve.
    pub chi2: f64,
    /// Robust weight, 0 to 1.
    pub robust_weight: f64,
}

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
    /// True if rejected as an outlier after this solve.
    pub rejected: bool,
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
    /// Position in the world, in metres.
    pub position_m: Vector3<f64>,
}
