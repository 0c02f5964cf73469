//! The features of the window after a step: observations with residuals, counts, points in the world.

use nalgebra::{Vector2, Vector3};

use super::observations::Observations;
use crate::frontend::FeatureId;

/// One measurement of a feature by a frame of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservationReport {
    /// Number of the observing image in its stream.
    pub frame_index: usize,
    /// Measured pixel.
    pub measured_px: Vector2<f64>,
    /// Predicted minus measured before the solve, in pixels.
    pub residual_before_px: Option<Vector2<f64>>,
    /// Predicted minus measured after the solve, in pixels.
    pub residual_after_px: Option<Vector2<f64>>,
    /// Squared whitened residual after the solve.
    pub chi2: f64,
    /// Weight that the robust loss left it, 0 to 1.
    pub robust_weight: f64,
}

/// One feature that took part in the solve.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureReport {
    /// Who it is; [`FeatureId::camera`] is the number of the camera that observes it.
    pub id: FeatureId,
    /// The frame it is anchored in.
    pub anchor_frame_index: usize,
    /// Inverse depth along the anchor's optical axis, in 1/m.
    pub inverse_depth_per_m: f64,
    /// All its observations in the window, the anchor's first.
    pub observations: Observations,
    /// Rejected as an outlier after this solve.
    pub rejected: bool,
}

/// How many features took part in the solve; known of every step, also where the features themselves are not kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FeatureCounts {
    /// Features that took part.
    pub solved: usize,
    /// Of them rejected as outliers after the solve.
    pub rejected: usize,
    /// All their observations in the window.
    pub observations: usize,
}

impl FeatureCounts {
    /// Of the features of a report.
    pub fn of(features: &[FeatureReport]) -> Self {
        Self {
            solved: features.len(),
            rejected: features.iter().filter(|feature| feature.rejected).count(),
            observations: features.iter().map(|feature| feature.observations.len()).sum(),
        }
    }

    /// Features that took part and were not rejected.
    pub fn inliers(&self) -> usize {
        self.solved - self.rejected
    }
}

/// A feature as a point of the world, for drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkReport {
    /// Who it is.
    pub id: FeatureId,
    /// Where, in the world.
    pub position_m: Vector3<f64>,
}
