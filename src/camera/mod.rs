//! Camera models: projection and back-projection with their Jacobians, Kalibr's models and conventions.
//!
//! Pixel centres lie at integer coordinates (`OpenCV`, Kalibr). The camera looks along +z, x to the right, y down.
//! A point becomes a pixel in three steps: the [`Projection`] maps it to the normalized image plane, the
//! [`Distortion`] moves it there, and focal lengths and principal point convert it to pixels.

mod distortion;
mod error;
mod intrinsics;
mod kalibr;
mod projection;
mod rational;
#[cfg(test)]
mod tests;

pub use distortion::Distortion;
pub use error::CameraError;
pub use projection::Projection;
pub use rational::RationalLens;

use nalgebra::{Matrix2x3, UnitQuaternion, Vector2, Vector3};

#[derive(Clone, Debug, PartialEq)]
pub struct CameraModel {
    pub projection: Projection,
    pub distortion: Distortion,
    /// `fx fy cx cy` in pixels.
    pub intrinsics_px: [f64; 4],
    /// Width and height in pixels.
    pub resolution_px: [usize; 2],
}

impl CameraModel {
    /// Creates a camera from its checked parts.
    ///
    /// # Errors
    /// When a number is not finite or out of its range, or the distortion is not defined for the projection.
    pub fn new(
        projection: Projection,
        distortion: Distortion,
        intrinsics_px: [f64; 4],
        resolution_px: [usize; 2],
    ) -> Result<Self, CameraError> {
        projection.check()?;
        distortion.check()?;
        let names = ["focal length fx", "focal length fy", "principal point cx", "principal point cy"];
        for (index, (field, value)) in names.into_iter().zip(intrinsics_px).enumerate() {
            if !value.is_finite() || (index < 2 && value <= 0.0) {
                let expected = if index < 2 { "a positive number of pixels" } else { "a finite number of pixels" };
                return Err(CameraError::Value { field, value, expected });
            }
        }
        for (field, value) in ["image width", "image height"].into_iter().zip(resolution_px) {
            if value == 0 {
                return Err(CameraError::Value { field, value: 0.0, expected: "at least one pixel" });
            }
        }
        let goes_together = match projection {
            Projection::Pinhole => true,
            Projection::Omni { .. } => matches!(distortion, Distortion::None | Distortion::Radtan(_)),
            Projection::Eucm { .. } | Projection::Ds { .. } => distortion == Distortion::None,
        };
        if !goes_together {
            return Err(CameraError::Combination {
                model: projection.name(),
                distortion: distortion.name(),
                expected: if matches!(projection, Projection::Omni { .. }) { "none or radtan" } else { "none" },
            });
        }
        Ok(Self { projection, distortion, intrinsics_px, resolution_px })
    }

    /// Undistorted pinhole camera.
    ///
    /// # Errors
    /// As [`CameraModel::new`].
    pub fn pinhole(intrinsics_px: [f64; 4], resolution_px: [usize; 2]) -> Result<Self, CameraError> {
        Self::new(Projection::Pinhole, Distortion::None, intrinsics_px, resolution_px)
    }

    /// Projects a point of the camera frame to a pixel; `None` if the point is not visible (behind the camera, or
    /// outside the model's domain).
    ///
    /// The pixel may lie outside the image; see [`CameraModel::contains`].
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        let undistorted = self.projection.project(point_in_camera)?;
        let distorted = self.distortion.distort(&undistorted)?;
        let [fx, fy, cx, cy] = self.intrinsics_px;
        let uv_px = Vector2::new(fx * distorted.x + cx, fy * distorted.y + cy);
        (uv_px.x.is_finite() && uv_px.y.is_finite()).then_some(uv_px)
    }

    /// Returns the pixel and its derivative with respect to the point (2 × 3, px/m).
    pub fn project_with_jacobian(&self, point_in_camera: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let (undistorted, by_point) = self.projection.project_with_jacobian(point_in_camera)?;
        let [fx, fy, cx, cy] = self.intrinsics_px;
        let (distorted, mut jacobian) = if self.distortion == Distortion::None {
            (undistorted, by_point)
        } else {
            let (distorted, by_undistorted) = self.distortion.distort_with_jacobian(&undistorted)?;
            (distorted, by_undistorted * by_point)
        };
        for column in 0..3 {
            jacobian[(0, column)] *= fx;
            jacobian[(1, column)] *= fy;
        }
        let uv_px = Vector2::new(fx * distorted.x + cx, fy * distorted.y + cy);
        (uv_px.x.is_finite() && uv_px.y.is_finite()).then_some((uv_px, jacobian))
    }

    /// Unit bearing of a pixel, `None` outside the model's domain.
    pub fn unproject(&self, uv_px: &Vector2<f64>) -> Option<Vector3<f64>> {
        let [fx, fy, cx, cy] = self.intrinsics_px;
        let distorted = Vector2::new((uv_px.x - cx) / fx, (uv_px.y - cy) / fy);
        let undistorted = self.distortion.undistort(&distorted)?;
        self.projection.unproject(&undistorted)
    }

    /// True if a pixel lies on the image, at least `border_px` inside the outermost pixel centres.
    pub fn contains(&self, uv_px: &Vector2<f64>, border_px: f64) -> bool {
        let [width, height] = self.resolution_px;
        uv_px.x >= border_px
            && uv_px.y >= border_px
            && uv_px.x <= width as f64 - 1.0 - border_px
            && uv_px.y <= height as f64 - 1.0 - border_px
    }

    /// Ratio of the image of another camera, rotated by `here_from_other`, whose directions lie in the image of this one.
    pub fn common_field(&self, other: &Self, here_from_other: &UnitQuaternion<f64>) -> f64 {
        const STEPS: usize = 12;
        let [width, height] = other.resolution_px.map(|size| size.saturating_sub(1) as f64 / STEPS as f64);
        let grid = (0..=STEPS).flat_map(|row| (0..=STEPS).map(move |column| (column as f64, row as f64)));
        let is_seen = |(column, row): &(f64, f64)| {
            let bearing = other.unproject(&Vector2::new(column * width, row * height));
            let uv_px = bearing.and_then(|bearing| self.project(&(here_from_other * bearing)));
            uv_px.is_some_and(|uv_px| self.contains(&uv_px, 0.0))
        };
        grid.filter(is_seen).count() as f64 / ((STEPS + 1) * (STEPS + 1)) as f64
    }

    /// Geometric mean of the two focal lengths, which converts an angle at the image centre to pixels.
    pub fn focal_length_px(&self) -> f64 {
        (self.intrinsics_px[0] * self.intrinsics_px[1]).sqrt()
    }
}
