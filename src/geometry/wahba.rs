//! Rotation between two sets of vectors.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Rotation that minimizes `Σ |measured − R·predicted|²` over pairs `(predicted, measured)` (Wahba's problem, by SVD),
/// with the ratio of the second singular value to the first, which is near zero if all vectors are along one axis.
pub fn best_rotation(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<(UnitQuaternion<f64>, f64)> {
    let sum: Matrix3<f64> = pairs.iter().map(|(predicted, measured)| measured * predicted.transpose()).sum();
    let svd = sum.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut handed = Matrix3::identity();
    handed[(2, 2)] = (u * v_t).determinant().signum();
    let rotation = Rotation3::from_matrix_unchecked(u * handed * v_t);
    Some((UnitQuaternion::from_rotation_matrix(&rotation), svd.singular_values[1] / svd.singular_values[0].max(1e-12)))
}
