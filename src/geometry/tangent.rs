use nalgebra::{Matrix3x2, Vector3};

/// Returns an orthonormal basis of the plane tangent to the unit sphere at `direction`, one basis vector per column
/// (3 × 2).
///
/// With `direction` as third column the two form a right-handed frame: `first × second = direction`.
#[inline]
pub fn tangent_basis(direction: &Vector3<f64>) -> Matrix3x2<f64> {
    // The helper axis must not be parallel to the direction.
    let helper = if direction.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let first = direction.cross(&helper).normalize();
    let second = direction.cross(&first);
    Matrix3x2::from_columns(&[first, second])
}
