use nalgebra::{Matrix2x3, Vector2, Vector3};

use super::CameraError;

/// Map from bearings to the normalized image plane, before distortion (Kalibr's `camera_model`).
///
/// A point `(x, y, z)` is mapped to `(x, y)/D`; the divisor `D` defines the model. `α` blends between perspective and
/// sphere; points behind the image plane are in the domain while they project to one pixel only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole projection `(x/z, y/z)`.
    Pinhole,
    /// Unified model, `D = z + ξ d` with `d² = x² + y² + z²`: the unit sphere seen from a point `ξ` behind its centre
    /// (Mei and Rives, "Single view point omnidirectional camera calibration from planar grids", ICRA 2007).
    Omni {
        /// Distance of the second projection centre, at least 0; 0 is the pinhole.
        xi: f64,
    },
    /// Enhanced unified model, `D = α d + (1 − α) z` with `d² = β (x² + y²) + z²` (Khomutenko, Garcia and Martinet, "An
    /// enhanced unified camera model", RA-L 2016).
    Eucm {
        /// Blend between perspective (0) and the surface (1).
        alpha: f64,
        /// Shape of the surface, positive; 1 is a sphere.
        beta: f64,
    },
    /// Double sphere, `D = α d₂ + (1 − α) (ξ d₁ + z)` with `d₁² = x² + y² + z²`, `d₂² = x² + y² + (ξ d₁ + z)²` (Usenko,
    /// Demmel and Cremers, "The double sphere camera model", 3DV 2018).
    Ds {
        /// Distance of the two spheres' centres.
        xi: f64,
        /// Blend between the second sphere's centre and its shifted one, 0 to 1.
        alpha: f64,
    },
}

impl Projection {
    /// Kalibr's name of the model.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pinhole => "pinhole",
            Self::Omni { .. } => "omni",
            Self::Eucm { .. } => "eucm",
            Self::Ds { .. } => "ds",
        }
    }

    pub(super) fn check(&self) -> Result<(), CameraError> {
        let refuse = |field, value, expected| Err(CameraError::Value { field, value, expected });
        match *self {
            Self::Omni { xi } if !(xi.is_finite() && xi >= 0.0) => {
                refuse("xi of 'omni'", xi, "a finite number, 0 or more")
            }
            Self::Eucm { alpha, .. } if !(0.0..=1.0).contains(&alpha) => refuse("alpha of 'eucm'", alpha, "0 to 1"),
            Self::Eucm { beta, .. } if !(beta.is_finite() && beta > 0.0) => {
                refuse("beta of 'eucm'", beta, "a positive number")
            }
            Self::Ds { xi, .. } if !(xi.is_finite() && xi > -1.0) => refuse("xi of 'ds'", xi, "a number above -1"),
            Self::Ds { alpha, .. } if !(0.0..=1.0).contains(&alpha) => refuse("alpha of 'ds'", alpha, "0 to 1"),
            _ => Ok(()),
        }
    }

    /// Divisor `D` of x and y for a point, `None` outside the model's domain.
    fn divisor(&self, x: f64, y: f64, z: f64) -> Option<f64> {
        let radial = x * x + y * y;
        match *self {
            Self::Pinhole => (z > 0.0).then_some(z),
            Self::Omni { xi } => {
                let d = (radial + z * z).sqrt();
                let w = if xi <= 1.0 { xi } else { 1.0 / xi };
                (z > -w * d).then_some(z + xi * d)
            }
            Self::Eucm { alpha, beta } => {
                let d = (beta * radial + z * z).sqrt();
                (z > -blend_limit(alpha) * d).then_some(alpha * d + (1.0 - alpha) * z)
            }
            Self::Ds { xi, alpha } => {
                let d1 = (radial + z * z).sqrt();
                let w1 = blend_limit(alpha);
                let visible = z > -(w1 + xi) / (2.0 * w1 * xi + xi * xi + 1.0).sqrt() * d1;
                let shifted = xi * d1 + z;
                visible.then(|| alpha * (radial + shifted * shifted).sqrt() + (1.0 - alpha) * shifted)
            }
        }
        .filter(|divisor| *divisor > 0.0)
    }

    /// Point on the normalized image plane, `None` outside the model's domain.
    #[inline]
    pub fn project(&self, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        let divisor = self.divisor(point.x, point.y, point.z)?;
        Some(Vector2::new(point.x / divisor, point.y / divisor))
    }

    /// Point on the normalized image plane and its derivative with respect to the point (2 × 3, 1/m).
    #[inline]
    pub fn project_with_jacobian(&self, point: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let (x, y, z) = (point.x, point.y, point.z);
        let divisor = self.divisor(x, y, z)?;
        let radial = x * x + y * y;
        // The divisor depends on x and y only through x² + y²: its gradient is (x·lateral, y·lateral, axial).
        let (lateral, axial) = match *self {
            Self::Pinhole => (0.0, 1.0),
            Self::Omni { xi } => {
                let d = (radial + z * z).sqrt();
                (xi / d, 1.0 + xi * z / d)
            }
            Self::Eucm { alpha, beta } => {
                let d = (beta * radial + z * z).sqrt();
                (alpha * beta / d, alpha * z / d + 1.0 - alpha)
            }
            Self::Ds { xi, alpha } => {
                let d1 = (radial + z * z).sqrt();
                let shifted = xi * d1 + z;
                let d2 = (radial + shifted * shifted).sqrt();
                let by_shifted = alpha * shifted / d2 + 1.0 - alpha;
                (alpha / d2 + by_shifted * xi / d1, by_shifted * (xi * z / d1 + 1.0))
            }
        };
        let inverse = 1.0 / divisor;
        let (u, v) = (x / divisor, y / divisor);
        let jacobian = Matrix2x3::new(
            (1.0 - u * x * lateral) * inverse,
            -u * y * lateral * inverse,
            -u * axial * inverse,
            -v * x * lateral * inverse,
            (1.0 - v * y * lateral) * inverse,
            -v * axial * inverse,
        );
        Some((Vector2::new(u, v), jacobian))
    }

    /// Unit bearing of a point of the normalized image plane by the closed forms of the publications, `None` if no bearing
    /// projects there.
    #[inline]
    pub fn unproject(&self, plane: &Vector2<f64>) -> Option<Vector3<f64>> {
        let square = plane.norm_squared();
        let direction = match *self {
            Self::Pinhole => Vector3::new(plane.x, plane.y, 1.0),
            Self::Omni { xi } => {
                let discriminant = 1.0 + (1.0 - xi * xi) * square;
                if discriminant < 0.0 {
                    return None;
                }
                Vector3::new(plane.x, plane.y, 1.0 - xi * (square + 1.0) / (xi + discriminant.sqrt()))
            }
            Self::Eucm { alpha, beta } => {
                let discriminant = 1.0 - (2.0 * alpha - 1.0) * beta * square;
                if discriminant < 0.0 {
                    return None;
                }
                let z = (1.0 - beta * alpha * alpha * square) / (alpha * discriminant.sqrt() + 1.0 - alpha);
                Vector3::new(plane.x, plane.y, z)
            }
            Self::Ds { xi, alpha } => {
                let discriminant = 1.0 - (2.0 * alpha - 1.0) * square;
                if discriminant < 0.0 {
                    return None;
                }
                let z = (1.0 - alpha * alpha * square) / (alpha * discriminant.sqrt() + 1.0 - alpha);
                let root = z * z + (1.0 - xi * xi) * square;
                if root < 0.0 {
                    return None;
                }
                let scale = (z * xi + root.sqrt()) / (z * z + square);
                Vector3::new(scale * plane.x, scale * plane.y, scale * z - xi)
            }
        };
        let norm = direction.norm();
        (norm.is_finite() && norm > 0.0).then(|| direction / norm)
    }
}

/// Limit `w` of a blended model's domain behind the image plane, where points with `z > −w d` project: `α/(1 − α)` for
/// `α ≤ 0.5`, else `(1 − α)/α` (`w₁` of the double sphere).
fn blend_limit(alpha: f64) -> f64 {
    if alpha <= 0.5 { alpha / (1.0 - alpha) } else { (1.0 - alpha) / alpha }
}
