//! Landmarks of the bundle, each with a fixed anchor.

use nalgebra::{Matrix3, Vector3};

use crate::optimization::{CameraPose, Landmark};

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
    /// Landmark at a point in the world for an anchor; `None` when the two coincide.
    pub(super) fn from_point(anchor_m: Vector3<f64>, point_m: &Vector3<f64>) -> Option<Self> {
        let anchor = CameraPose { rotation: Matrix3::identity(), position_m: anchor_m };
        Some(Self { anchor, landmark: Landmark::from_point(&(point_m - anchor_m))? })
    }

    /// `x ⊞ δ` of the landmark; the anchor stays fixed.
    pub(super) fn plus(&self, delta: &Vector3<f64>) -> Self {
        Self { anchor: self.anchor, landmark: self.landmark.plus(delta) }
    }
}

/// Triangulates a landmark from rays `(view, unit bearing in its camera)`: least squares of the distances
/// perpendicular to the rays, weighted by distance. `None` when the parallax is below `min_angle_rad` or the point lies
/// behind a camera.
pub(super) fn triangulate(rays: &[(CameraPose, Vector3<f64>)], min_angle_rad: f64) -> Option<AnchoredLandmark> {
    let (first, first_bearing) = rays.first()?;
    let first_ray = first.rotation * first_bearing;
    let opening = rays.iter().map(|(view, bearing)| first_ray.cross(&(view.rotation * bearing)).norm());
    if opening.fold(0.0, f64::max) < min_angle_rad {
        return None;
    }
    let mut point: Option<Vector3<f64>> = None;
    for _ in 0..2 {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (view, bearing) in rays {
            let ray = view.rotation * bearing;
            let distance = point.map_or(1.0, |known| (known - view.position_m).norm().max(1e-3));
            let across = (Matrix3::identity() - ray * ray.transpose()) / (distance * distance);
            normal += across;
            right += across * view.position_m;
        }
        point = Some(normal.cholesky()?.solve(&right));
    }
    let point = point?;
    let seen = rays.iter().all(|(view, bearing)| (point - view.position_m).dot(&(view.rotation * bearing)) > 0.0);
    if seen { AnchoredLandmark::from_point(first.position_m, &point) } else { None }
}
