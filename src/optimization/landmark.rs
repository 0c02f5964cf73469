use nalgebra::{Vector2, Vector3};

use crate::geometry::tangent_basis;

/// Parameterization of a landmark in its anchor camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LandmarkModel {
    /// Inverse distance along the anchor's measured bearing (Eq. 9): the anchor's observation is treated as exact.
    InverseDistance,
    /// Bearing and inverse distance: the anchor's observation is a measurement like the others.
    BearingAndInverseDistance,
}

/// Point as direction and inverse distance in the frame of its anchor, `p_anchor = bearing / inverse_distance`.
///
/// The anchor is the camera that observed it first, or any fixed frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Landmark {
    /// Unit direction in the anchor's frame.
    pub(crate) bearing: Vector3<f64>,
    /// Inverse distance from the anchor's centre, in 1/m (inverse of the map's unit of length before the scale is
    /// known).
    pub(crate) inverse_distance: f64,
}

/// Smallest inverse distance, in 1/m; a landmark there is treated as infinitely far.
const MIN_INVERSE_DISTANCE: f64 = 1e-5;

impl Landmark {
    /// Landmark at a point in the anchor's frame; `None` within 1 mm of its centre.
    pub(crate) fn from_point(point_in_anchor: &Vector3<f64>) -> Option<Self> {
        let distance = point_in_anchor.norm();
        (distance > 1e-3).then(|| Self { bearing: point_in_anchor / distance, inverse_distance: distance.recip() })
    }

    /// `x ⊞ [α; δρ]`: `bearing ← normalize(bearing + B α)` with `B` its [`tangent_basis`] (α in radians, 2), and
    /// `inverse_distance ← inverse_distance + δρ`, not below [`MIN_INVERSE_DISTANCE`].
    #[must_use]
    pub(crate) fn plus(&self, delta: &Vector3<f64>) -> Self {
        let bearing = self.bearing + tangent_basis(&self.bearing) * Vector2::new(delta.x, delta.y);
        Self {
            bearing: bearing.normalize(),
            inverse_distance: (self.inverse_distance + delta.z).max(MIN_INVERSE_DISTANCE),
        }
    }

    /// True if the inverse distance is at its lower bound.
    pub(crate) fn is_infinitely_far(&self) -> bool {
        self.inverse_distance <= MIN_INVERSE_DISTANCE
    }

    /// Position in the anchor's frame, in metres.
    pub(crate) fn point_in_anchor(&self) -> Vector3<f64> {
        self.bearing / self.inverse_distance.max(MIN_INVERSE_DISTANCE)
    }
}
