use nalgebra::{Matrix2x3, Vector2, Vector3};

use super::CameraError;

/// Map from bearings to the normalized image plane, before distortion (Kalibr's `camera_model`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole projection `(x/z, y/z)`.
    Pinhole,
    /// Unified model of Mei and Rives: the unit sphere seen from a point `xi` behind its centre.
    Omni {
        /// Distance of the second projection centre, at least 0; 0 is the pinhole.
        xi: f64,
    },
    /// Extended unified model of Khomutenko, Garcia and Martinet.
    Eucm {
        /// Blend between perspective (0) and the surface (1).
        alpha: f64,
        /// Shape of the surface, positive; 1 is a sphere.
        beta: f64,
    },
    /// Double sphere of Usenko, Demmel and Cremers.
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

    /// Divisor of x and y for a point, `None` outside the model's domain.
    fn divisor(&self, x: f64, y: f64, z: f64) -> Option<f64> {
        let radial = x * x + y * y;
        match *self {
            Self::Pinhole => (z > 0.0).then_some(z),
            Self::Omni { xi } => {
                let distance = (radial + z * z).sqrt();
                let limit = if xi <= 1.0 { xi } else { 1.0 / xi };
                (z > -limit * distance).then_some(z + xi * distance)
            }
            Self::Eucm { alpha, beta } => {
                let distance = (beta * radial + z * z).sqrt();
                (z > -blend_limit(alpha) * distance).then_some(alpha * distance + (1.0 - alpha) * z)
            }
            Self::Ds { xi, alpha } => {
                let first = (radial + z * z).sqrt();
                let limit = blend_limit(alpha);
                let visible = z > -(limit + xi) / (2.0 * limit * xi + xi * xi + 1.0).sqrt() * first;
                let shifted = xi * first + z;
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
                let distance = (radial + z * z).sqrt();
                (xi / distance, 1.0 + xi * z / distance)
            }
            Self::Eucm { alpha, beta } => {
                let distance = (beta * radial + z * z).sqrt();
                (alpha * beta / distance, alpha * z / distance + 1.0 - alpha)
            }
            Self::Ds { xi, alpha } => {
                let first = (radial + z * z).sqrt();
                let shifted = xi * first + z;
                let second = (radial + shifted * shifted).sqrt();
                let by_shifted = alpha * shifted / second + 1.0 - alpha;
                (alpha / second + by_shifted * xi / first, by_shifted * (xi * z / first + 1.0))
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

    /// Unit bearing of a point of the normalized image plane, `None` if no bearing projects there.
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

/// Limit of a blended model's domain behind the image plane: points with `z > -limit · distance` project.
fn blend_limit(alpha: f64) -> f64 {
    if alpha <= 0.5 { alpha / (1.0 - alpha) } else { (1.0 - alpha) / alpha }
}
