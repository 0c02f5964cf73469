//! Camera models: projection and back-projection with their Jacobians, Kalibr's models and conventions.
//!
//! Pixel centres lie at integer coordinates (OpenCV, Kalibr). The camera looks along +z, x to the right, y down.

use nalgebra::{Matrix2x3, Vector2, Vector3};

/// How a bearing becomes an image point before the lens distorts it (Kalibr's `camera_model`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole.
    Pinhole,
}

/// How the lens distorts (Kalibr's `distortion_model` and its coefficients).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// None.
    None,
    /// Radial–tangential `k1 k2 p1 p2`.
    Radtan([f64; 4]),
}

/// A calibrated camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraModel {
    /// Projection.
    pub projection: Projection,
    /// Distortion.
    pub distortion: Distortion,
    /// `fx fy cx cy` in pixels.
    pub intrinsics_px: [f64; 4],
    /// Width and height in pixels.
    pub resolution_px: [usize; 2],
}

impl CameraModel {
    /// The pixel of a point in the camera frame, `None` when it cannot be seen (behind, or outside the model's domain).
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.project_with_jacobian(point_in_camera).map(|(uv_px, _)| uv_px)
    }

    /// The pixel and its derivative by the point (2 × 3, px/m).
    pub fn project_with_jacobian(&self, _point_in_camera: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        None
    }

    /// The unit bearing of a pixel, `None` outside the model's domain.
    pub fn unproject(&self, _uv_px: &Vector2<f64>) -> Option<Vector3<f64>> {
        None
    }
}
