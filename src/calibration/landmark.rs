//! Landmarks of the bundle and what one camera sees of them.

use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Vector2, Vector3};

use crate::camera::CameraModel;
use crate::geometry::{so3, tangent_basis};

/// Least inverse distance, in 1/m: beyond it a landmark counts as infinitely far.
const MIN_INVERSE_DISTANCE: f64 = 1e-5;

/// A point of the world by direction and inverse distance from a fixed place, from where it was first seen.
///
/// The place never moves, so that a sighting depends on one camera pose only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Landmark {
    /// In the world, in metres.
    pub(super) reference_m: Vector3<f64>,
    /// Unit direction in world axes.
    pub(super) direction: Vector3<f64>,
    /// In 1/m.
    pub(super) inverse_distance: f64,
}

impl Landmark {
    /// A point seen from a place; `None` when it lies there.
    pub(super) fn seen_from(reference_m: Vector3<f64>, point_m: &Vector3<f64>) -> Option<Self> {
        let offset = point_m - reference_m;
        let distance = offset.norm();
        (distance > 1e-3).then(|| Self { reference_m, direction: offset / distance, inverse_distance: 1.0 / distance })
    }

    /// `x ⊞ [two on the tangent plane of the direction, inverse distance]`.
    pub(super) fn plus(&self, delta: &Vector3<f64>) -> Self {
        let direction = self.direction + tangent_basis(&self.direction) * Vector2::new(delta.x, delta.y);
        Self {
            reference_m: self.reference_m,
            direction: direction.normalize(),
            inverse_distance: (self.inverse_distance + delta.z).max(MIN_INVERSE_DISTANCE),
        }
    }

    /// The point in a camera's axes up to the positive factor `inverse_distance`.
    fn in_camera(&self, view: &ViewPose) -> Vector3<f64> {
        view.rotation.tr_mul(&(self.direction + (self.reference_m - view.position_m) * self.inverse_distance))
    }
}

/// Where a camera was when it took an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ViewPose {
    /// `world_from_camera`.
    pub(super) rotation: Matrix3<f64>,
    /// Its centre in the world, in metres.
    pub(super) position_m: Vector3<f64>,
}

/// Pixel residual of one sighting with its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct SightingTerm {
    /// Predicted minus measured.
    pub(super) residual_px: Vector2<f64>,
    /// By `[φ; δt]` of `world_from_camera`.
    pub(super) by_view: Matrix2x6<f64>,
    /// By [`Landmark::plus`].
    pub(super) by_landmark: Matrix2x3<f64>,
}

/// Predicted minus measured pixel, `None` when the landmark cannot be seen.
pub(super) fn residual_px(
    camera: &CameraModel,
    view: &ViewPose,
    landmark: &Landmark,
    measured_px: &Vector2<f64>,
) -> Option<Vector2<f64>> {
    Some(camera.project(&landmark.in_camera(view))? - measured_px)
}

/// The residual with its derivatives.
pub(super) fn linearize(
    camera: &CameraModel,
    view: &ViewPose,
    landmark: &Landmark,
    measured_px: &Vector2<f64>,
) -> Option<SightingTerm> {
    let in_camera = landmark.in_camera(view);
    let (predicted, by_direction) = camera.project_with_jacobian(&in_camera)?;
    let by_world = by_direction * view.rotation.transpose();
    let mut by_view = Matrix2x6::zeros();
    by_view.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_direction * so3::hat(&in_camera)));
    by_view.fixed_view_mut::<2, 3>(0, 3).copy_from(&(by_world * -landmark.inverse_distance));
    let mut by_landmark = Matrix2x3::zeros();
    by_landmark.fixed_view_mut::<2, 2>(0, 0).copy_from(&(by_world * tangent_basis(&landmark.direction)));
    by_landmark.fixed_view_mut::<2, 1>(0, 2).copy_from(&(by_world * (landmark.reference_m - view.position_m)));
    Some(SightingTerm { residual_px: predicted - measured_px, by_view, by_landmark })
}

/// The landmark nearest to all rays `(view, unit bearing in its camera)`, measured across them and weighed by distance;
/// `None` while the rays open less than `least_angle_rad` or when the point lies behind a camera.
pub(super) fn triangulate(rays: &[(ViewPose, Vector3<f64>)], least_angle_rad: f64) -> Option<Landmark> {
    let (first, first_bearing) = rays.first()?;
    let first_ray = first.rotation * first_bearing;
    let opening = rays.iter().map(|(view, bearing)| first_ray.cross(&(view.rotation * bearing)).norm());
    if opening.fold(0.0, f64::max) < least_angle_rad {
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
    if seen { Landmark::seen_from(first.position_m, &point) } else { None }
}
