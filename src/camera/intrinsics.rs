//! Camera intrinsics that a calibration can estimate: their values and the projection's derivatives.

use nalgebra::{Matrix2x3, Matrix2x6, Vector2, Vector3};

use super::{CameraError, CameraModel, Distortion, RationalLens};

impl CameraModel {
    /// Number of `[fx, fy, cx, cy, k1, k2]` in the model, counted from the first: 4, 5 (field of view) or 6.
    pub fn intrinsic_count(&self) -> usize {
        4 + self.distortion.leading_coefficients().map_or(0, |(_, count)| count)
    }

    /// `[fx, fy, cx, cy, k1, k2]`, the first four in pixels; 0 where the model has no such coefficient.
    ///
    /// `k1` and `k2` are the first two coefficients of the distortion; the angle of [`Distortion::Fov`] is `k1`.
    pub fn intrinsics(&self) -> [f64; 6] {
        let [fx, fy, cx, cy] = self.intrinsics_px;
        let ([k1, k2], _) = self.distortion.leading_coefficients().unwrap_or_default();
        [fx, fy, cx, cy, k1, k2]
    }

    /// Returns the camera with these `[fx, fy, cx, cy, k1, k2]`; values that the model does not have are ignored.
    ///
    /// # Errors
    /// When a value is not finite or out of its range.
    pub fn with_intrinsics(&self, [fx, fy, cx, cy, k1, k2]: [f64; 6]) -> Result<Self, CameraError> {
        let distortion = self.distortion.with_leading_coefficients([k1, k2]);
        Self::new(self.projection, distortion, [fx, fy, cx, cy], self.resolution_px)
    }

    /// Returns the pixel, its derivative with respect to the point (2 × 3, px/m) and to `[fx, fy, cx, cy, k1, k2]` (2 ×
    /// 6, px per unit of each), with zero columns for coefficients that the model does not have.
    pub fn project_with_intrinsics_jacobian(
        &self,
        point_in_camera: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>, Matrix2x6<f64>)> {
        let (uv_px, by_point) = self.project_with_jacobian(point_in_camera)?;
        let undistorted = self.projection.project(point_in_camera)?;
        let distorted = self.distortion.distort(&undistorted)?;
        let [by_k1, by_k2] = self.distortion.by_leading_coefficients(&undistorted);
        let [fx, fy, _, _] = self.intrinsics_px;
        #[rustfmt::skip]
        let by_intrinsics = Matrix2x6::new(
            distorted.x, 0.0, 1.0, 0.0, fx * by_k1.x, fx * by_k2.x,
            0.0, distorted.y, 0.0, 1.0, fy * by_k1.y, fy * by_k2.y,
        );
        Some((uv_px, by_point, by_intrinsics))
    }
}

impl Distortion {
    /// First two coefficients (or the only one) and their number; `None` without distortion.
    fn leading_coefficients(&self) -> Option<([f64; 2], usize)> {
        match self {
            Self::None => None,
            Self::Radtan([k1, k2, ..]) | Self::Equidistant([k1, k2, ..]) => Some(([*k1, *k2], 2)),
            Self::Rational(lens) => {
                let [k1, k2, ..] = *lens.coefficients();
                Some(([k1, k2], 2))
            }
            Self::Fov(w) => Some(([*w, 0.0], 1)),
        }
    }

    fn with_leading_coefficients(&self, [k1, k2]: [f64; 2]) -> Self {
        match self {
            Self::None => Self::None,
            Self::Radtan([_, _, p1, p2]) => Self::Radtan([k1, k2, *p1, *p2]),
            Self::Equidistant([_, _, k3, k4]) => Self::Equidistant([k1, k2, *k3, *k4]),
            Self::Rational(lens) => {
                let [_, _, rest @ ..] = *lens.coefficients();
                let [p1, p2, k3, k4, k5, k6] = rest;
                Self::Rational(RationalLens::new([k1, k2, p1, p2, k3, k4, k5, k6]))
            }
            Self::Fov(_) => Self::Fov(k1),
        }
    }

    /// Derivatives of the distorted point with respect to the first two coefficients, at a point of the normalized
    /// plane.
    fn by_leading_coefficients(&self, plane: &Vector2<f64>) -> [Vector2<f64>; 2] {
        let square = plane.norm_squared();
        match self {
            Self::None => [Vector2::zeros(); 2],
            Self::Radtan(_) => [plane * square, plane * (square * square)],
            Self::Rational(lens) => {
                let by_k1 = plane * (square / lens.denominator(square));
                [by_k1, by_k1 * square]
            }
            // θ³ / r and θ⁵ / r times the plane's point, which vanish on the axis.
            Self::Equidistant(_) => {
                let radius = square.sqrt();
                if radius == 0.0 {
                    return [Vector2::zeros(); 2];
                }
                let theta = radius.atan();
                let by_k1 = plane * (theta * theta * theta / radius);
                [by_k1, by_k1 * (theta * theta)]
            }
            Self::Fov(w) => [plane * fov_scale_by_angle(*w, square.sqrt()), Vector2::zeros()],
        }
    }
}

/// Derivative of `atan(q) / (w r)` with `q = 2 r tan(w/2)`, the ratio of the distorted radius to the radius `r`, with
/// respect to `w`.
fn fov_scale_by_angle(w: f64, radius: f64) -> f64 {
    let tangent = (0.5 * w).tan();
    let stretched = 2.0 * tangent * radius;
    // atan(q) / r, with the limit 2 tan(w/2) on the axis.
    let angle_per_radius = if radius > 0.0 { stretched.atan() / radius } else { 2.0 * tangent };
    ((1.0 + tangent * tangent) / (1.0 + stretched * stretched) - angle_per_radius / w) / w
}
