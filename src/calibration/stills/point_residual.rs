//! Residual of a known point in a camera, `r = π(R·X + t) − z` in px, with `[R | t]` `camera_from_world`.

use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Vector2};

use crate::camera::CameraModel;
use crate::geometry::{RigidTransform, median, so3};
use crate::sensors::MapPoint;

/// Predicted minus measured pixel; `None` for a point that the camera cannot see.
pub(super) fn residual(model: &CameraModel, pose: &RigidTransform, point: &MapPoint) -> Option<Vector2<f64>> {
    Some(model.project(&pose.transform(&point.point_in_world_m))? - point.uv_px)
}

/// Lengths of the residuals in px, `None` if the camera cannot see a point.
pub(super) fn residual_lengths(model: &CameraModel, pose: &RigidTransform, points: &[MapPoint]) -> Option<Vec<f64>> {
    points.iter().map(|point| residual(model, pose, point).map(|it| it.norm())).collect()
}

/// Median length of the residuals; points that the camera cannot see count as infinitely far.
pub(super) fn median_px(model: &CameraModel, points: &[MapPoint], pose: &RigidTransform) -> f64 {
    let lengths = points.iter().map(|point| residual(model, pose, point).map_or(f64::INFINITY, |it| it.norm()));
    median(lengths).unwrap_or(f64::INFINITY)
}

/// Derivative of a pixel by `[φ; δt]` of `camera_from_world` (2 × 6), from its derivative by the point in the camera.
pub(super) fn by_pose(by_point: &Matrix2x3<f64>, rotation: &Matrix3<f64>, point: &MapPoint) -> Matrix2x6<f64> {
    let mut rows = Matrix2x6::zeros();
    let by_rotation = by_point * -(rotation * so3::hat(&point.point_in_world_m));
    rows.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_rotation);
    rows.fixed_view_mut::<2, 3>(0, 3).copy_from(by_point);
    rows
}
