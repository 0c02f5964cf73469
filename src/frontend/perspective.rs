//! Correction of affine matches of reference patches for perspective.
//!
//! The image of a plane is distorted by a homography: an offset `x` in the reference appears at `A x / (1 + wᵀx)`, with
//! the affine part `A` and the perspective `w`. An affine match is shifted by it, see [`Appearance::perspective_shift`].
//!
//! The homography of the plane `nᵀX = d` is `R + t nᵀ/d` up to scale (Hartley and Zisserman, *Multiple View Geometry*,
//! section 13.1). In coordinates of the plane at unit distance, shifted to the feature in both images, with the rotation
//! `S = T(−q_now) R T(q_reference)` and the slope `m` of the surface in the reference camera (inverse depth changes by
//! the ratio `mᵀx` at the offset `x`), the homography is `[s₁ s₂ s₃] + (h e₃ − s₃)(m₁, m₂, 1)`: it maps the
//! feature to itself, with `h` the ratio of its depths now and in the reference. Hence
//!
//! ```text
//! h A_ij = S_ij − S_i3 m_j        i, j = 1, 2
//! h w_j  = S_3j + (h − S_33) m_j
//! ```
//!
//! The first line determines `h` and `m` from a matched warp and the camera's rotation, without its translation; the
//! second one is the perspective. `m` belongs to the reference, so all its matches contribute.
//!
//! [`Appearance::perspective_shift`]: super::appearance::Appearance::perspective_shift

use nalgebra::{Matrix2, Matrix3, Matrix4x2, UnitQuaternion, Vector2, Vector3, Vector4};

use crate::camera::CameraModel;

/// Standard deviation of an entry of a matched warp: noise of the match, and deviations of the surface from a plane.
const WARP_SIGMA: f64 = 0.02;
/// Standard deviation of a surface's slope: the tangent of the angle between its normal and the line of sight.
const SLOPE_SIGMA: f64 = 1.0;
/// Largest perspective in 1/px: over half a window the scale changes by a third.
const MAX_PERSPECTIVE_PER_PX: f64 = 0.03;
/// Smallest cosine between a feature's direction and the optical axis for which the plane at unit distance is used.
const MIN_COSINE: f64 = 0.3;

/// Surface around a feature, as the matches of its reference patch show it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surface {
    /// Feature in the reference camera, on the plane at unit distance.
    reference: Vector2<f64>,
    /// Derivative of that plane's coordinates by pixels in the reference.
    by_px: Matrix2<f64>,
    /// `R`, the rotation `camera_now_from_camera_reference`.
    rotation: UnitQuaternion<f64>,
    /// Information about the slope (2 × 2), and its product with the slope (2 × 1).
    information: Matrix2<f64>,
    weighted_slope: Vector2<f64>,
}

impl Surface {
    /// Surface without any match; `None` if the feature is too far from the optical axis.
    pub(super) fn new(camera: &CameraModel, uv_px: &Vector2<f64>) -> Option<Self> {
        let (reference, by_px) = on_plane(camera, &camera.unproject(uv_px)?)?;
        Some(Self {
            reference,
            by_px,
            rotation: UnitQuaternion::identity(),
            information: Matrix2::identity() / (SLOPE_SIGMA * SLOPE_SIGMA),
            weighted_slope: Vector2::zeros(),
        })
    }

    /// Adds a match in the next image, to which the camera has rotated by `rotation`, and returns the perspective `w`
    /// (2 × 1, 1/px in the reference); `None` if it is too large for the correction.
    pub(super) fn perspective(
        &mut self,
        camera: &CameraModel,
        rotation: &UnitQuaternion<f64>,
        bearing: &Vector3<f64>,
        warp: &Matrix2<f64>,
    ) -> Option<Vector2<f64>> {
        self.rotation = rotation * self.rotation;
        let (now, now_by_px) = on_plane(camera, bearing)?;
        let warp = now_by_px * warp * self.by_px.try_inverse()?;
        let s = shift(&-now) * self.rotation.to_rotation_matrix().matrix() * shift(&self.reference);
        let affine = Vector4::new(warp.m11, warp.m21, warp.m12, warp.m22);
        let upper = Vector4::new(s.m11, s.m21, s.m12, s.m22);
        let side = s.fixed_view::<2, 1>(0, 2);
        let mut by_slope = Matrix4x2::zeros();
        by_slope.fixed_view_mut::<2, 1>(0, 0).copy_from(&side);
        by_slope.fixed_view_mut::<2, 1>(2, 1).copy_from(&side);
        let square = affine.norm_squared();
        // Parts of the warp across the depth ratio.
        let across = |vector: Vector4<f64>| vector - affine * (affine.dot(&vector) / square);
        let (first, second) = (across(by_slope.column(0).into_owned()), across(by_slope.column(1).into_owned()));
        let measured = Matrix4x2::from_columns(&[first, second]);
        let weight = 1.0 / (WARP_SIGMA * WARP_SIGMA);
        self.information += measured.tr_mul(&measured) * weight;
        self.weighted_slope += measured.tr_mul(&upper) * weight;

        let m = self.information.try_inverse()? * self.weighted_slope;
        let h = affine.dot(&(upper - by_slope * m)) / square;
        let w = self.by_px.tr_mul(&((Vector2::new(s.m31, s.m32) + m * (h - s.m33)) / h));
        (w.norm() < MAX_PERSPECTIVE_PER_PX).then_some(w)
    }
}

/// Point of a direction on the plane at unit distance, and its derivative by pixels.
fn on_plane(camera: &CameraModel, bearing: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    if bearing.z < MIN_COSINE * bearing.norm() {
        return None;
    }
    let point = bearing.xy() / bearing.z;
    let (_, by_point) = camera.project_with_jacobian(&point.push(1.0))?;
    Some((point, by_point.fixed_columns::<2>(0).into_owned().try_inverse()?))
}

/// Shift of the plane at unit distance, as a homography.
fn shift(by: &Vector2<f64>) -> Matrix3<f64> {
    Matrix3::new(1.0, 0.0, by.x, 0.0, 1.0, by.y, 0.0, 0.0, 1.0)
}
