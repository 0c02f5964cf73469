//! Landmarks of the bundle, each with a fixed anchor.

use nalgebra::{Matrix3, Vector3};

use crate::optimization::{CameraPose, Landmark, Ray, TriangulationOptions, triangulate};

/// Landmark with a fixed anchor in the world: the position of the view that observed it first.
///
/// The anchor does not move with that view, so an observation depends on one camera pose only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AnchoredLandmark {
    /// `world_from_anchor`: fixed position, axes of the world.
    pub(super) anchor: CameraPose,
    pub(super) landmark: Landmark,
}

impl AnchoredLandmark {
    /// Landmark at the intersection of rays, anchored at the first one's camera; `None` when the parallax is too small,
    /// or the point lies behind a camera or in the anchor.
    pub(super) fn triangulate(rays: &[Ray], min_parallax_rad: f64) -> Option<Self> {
        let point = triangulate(rays, &TriangulationOptions::of_anchored(min_parallax_rad))?;
        let anchor = CameraPose { rotation: Matrix3::identity(), position_m: rays.first()?.centre };
        Some(Self { anchor, landmark: Landmark::from_point(&(point - anchor.position_m))? })
    }

    /// `x ⊞ δ` of the landmark; the anchor stays fixed.
    pub(super) fn plus(&self, delta: &Vector3<f64>) -> Self {
        Self { anchor: self.anchor, landmark: self.landmark.plus(delta) }
    }
}
