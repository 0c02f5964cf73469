use std::ops::Mul;

use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector3, Vector6};

use super::so3;

/// Rigid transform that maps points from one frame to another; a value is named `to_from_from`, as in
/// `world_from_imu`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidTransform {
    /// Rotates vectors into the outer frame.
    pub rotation: UnitQuaternion<f64>,
    /// Origin of the inner frame in the outer frame, in metres.
    pub translation_m: Vector3<f64>,
}

impl RigidTransform {
    pub fn new(rotation: UnitQuaternion<f64>, translation_m: Vector3<f64>) -> Self {
        Self { rotation, translation_m }
    }

    pub fn identity() -> Self {
        Self::new(UnitQuaternion::identity(), Vector3::zeros())
    }

    /// From a 4×4 homogeneous matrix, or `None` when its upper left block is further than `tolerance` (largest entry of
    /// `RᵀR − I`) from a rotation, its determinant is negative, or its last row is not `0 0 0 1`.
    pub fn from_matrix(matrix: &Matrix4<f64>, tolerance: f64) -> Option<Self> {
        let block: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
        let defect = (block.transpose() * block - Matrix3::identity()).amax();
        let last_row = (matrix.row(3) - nalgebra::RowVector4::new(0.0, 0.0, 0.0, 1.0)).amax();
        let finite = matrix.iter().all(|entry| entry.is_finite());
        if !finite || defect > tolerance || last_row > tolerance || block.determinant() <= 0.0 {
            return None;
        }
        let svd = block.svd(true, true);
        let orthonormal = svd.u? * svd.v_t?;
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(orthonormal));
        Some(Self::new(rotation, matrix.fixed_view::<3, 1>(0, 3).into_owned()))
    }

    /// Homogeneous matrix `[R t; 0 1]` (4 × 4).
    pub fn to_matrix(self) -> Matrix4<f64> {
        let mut matrix = Matrix4::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.rotation_matrix());
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation_m);
        matrix
    }

    pub fn rotation_matrix(&self) -> Matrix3<f64> {
        self.rotation.to_rotation_matrix().into_inner()
    }

    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self::new(rotation, -(rotation * self.translation_m))
    }

    /// Transforms a position vector from the inner to the outer frame (rotation and translation).
    pub fn transform(&self, position: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * position + self.translation_m
    }

    /// Interpolates at a fraction (0 to 1) of the way to `to`: positions along a line, rotations at a constant rate.
    pub fn interpolate(&self, to: &Self, fraction: f64) -> Self {
        // Two attitudes 180° apart have no shortest rotation between them; the earlier one is kept.
        let rotation = self.rotation.try_slerp(&to.rotation, fraction, 1e-9).unwrap_or(self.rotation);
        Self::new(rotation, self.translation_m.lerp(&to.translation_m, fraction))
    }

    /// `x ⊞ [φ; δt]` by the perturbation rule of this module.
    #[must_use]
    pub fn plus(&self, delta: &Vector6<f64>) -> Self {
        let phi = Vector3::new(delta[0], delta[1], delta[2]);
        Self::new(so3::plus(&self.rotation, &phi), self.translation_m + Vector3::new(delta[3], delta[4], delta[5]))
    }

    /// `self ⊟ origin`, the `[φ; δt]` with `origin.plus([φ; δt]) = self`.
    pub fn minus(&self, origin: &Self) -> Vector6<f64> {
        let phi = so3::log(&(origin.rotation.inverse() * self.rotation));
        let shift = self.translation_m - origin.translation_m;
        Vector6::new(phi.x, phi.y, phi.z, shift.x, shift.y, shift.z)
    }
}

impl Mul for RigidTransform {
    type Output = Self;

    fn mul(self, inner: Self) -> Self {
        Self::new(self.rotation * inner.rotation, self.transform(&inner.translation_m))
    }
}
