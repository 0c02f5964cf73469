//! Exponential, logarithm, perturbations and right Jacobians of SO(3), and the best rotation between vectors; angles in radians.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Below this angle (rad) the series of the Jacobians replace the closed forms.
const SMALL_ANGLE_RAD: f64 = 1e-4;

/// The cross-product matrix `[v]^` (3 × 3) with `hat(v)·w = v × w`.
pub fn hat(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// `Exp(φ)` for a rotation vector in radians: the rotation by `|φ|` about `φ` (Rodrigues).
pub fn exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(*phi)
}

/// `R ⊞ φ = R·Exp(φ)`, normalized: the perturbation on the right, in the inner frame.
#[must_use]
pub fn plus(rotation: &UnitQuaternion<f64>, phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    composed(rotation, &exp(phi))
}

/// `Exp(φ)·R`, normalized: the left form that the paper's Eqs. 12–14 print, `φ` in the outer frame, `φ = R·φ_right`.
#[must_use]
pub fn plus_left(rotation: &UnitQuaternion<f64>, phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    composed(&exp(phi), rotation)
}

/// `R₁·R₂`, normalized: products of many rotations stay of unit length.
pub fn composed(first: &UnitQuaternion<f64>, second: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize((first * second).into_inner())
}

/// Rotation vector (rad) of a body over `duration_s` whose angular rate (rad/s, body frame) changes linearly from
/// `ω₁` = `first` to `ω₂` = `second`: `φ = (ω₁ + ω₂) T/2 + (ω₁ × ω₂) T²/12`, two terms of the Magnus expansion, with an
/// error of the fifth order in the duration.
pub fn of_linear_rate(first: &Vector3<f64>, second: &Vector3<f64>, duration_s: f64) -> Vector3<f64> {
    (first + second) * 0.5 * duration_s + first.cross(second) * (duration_s * duration_s / 12.0)
}

/// `Log(R)`, the rotation vector in radians with norm at most π.
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let q = if rotation.w < 0.0 { -rotation.into_inner() } else { rotation.into_inner() };
    let v = q.imag();
    let sine = v.norm();
    if sine < 1e-9 {
        return v * (2.0 / q.w);
    }
    v * (2.0 * sine.atan2(q.w) / sine)
}

/// The right Jacobian `J_r(φ)` (3 × 3) with `Exp(φ + δ) ≈ Exp(φ)·Exp(J_r(φ)·δ)`:
/// `I − (1 − cos θ)/θ²·[φ]^ + (θ − sin θ)/θ³·[φ]^²`, θ = |φ| in radians.
///
/// Its entries are accurate to 1e-12. The series below 1e-4 rad leaves out `θ²/24·[φ]^`, at most 4.2e-14; above, the
/// cancellation in `1 − cos θ` costs up to 5e-13 (measured), falling with 1/θ to below 1e-14 from 0.01 rad.
pub fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let k = hat(phi);
    if angle < SMALL_ANGLE_RAD {
        return Matrix3::identity() - k * 0.5 + k * k / 6.0;
    }
    let square = angle * angle;
    Matrix3::identity() - k * ((1.0 - angle.cos()) / square) + k * k * ((angle - angle.sin()) / (square * angle))
}

/// The inverse of [`right_jacobian`] (3 × 3): `Log(Exp(φ)·Exp(δ)) ≈ φ + J_r⁻¹(φ)·δ`, with
/// `I + [φ]^/2 + (1/θ² − (1 + cos θ)/(2·θ·sin θ))·[φ]^²`.
///
/// Its entries are accurate to 1e-15 up to 0.4 rad; it is singular at 2π.
pub fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let k = hat(phi);
    if angle < SMALL_ANGLE_RAD {
        return Matrix3::identity() + k * 0.5 + k * k / 12.0;
    }
    let factor = 1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin());
    Matrix3::identity() + k * 0.5 + k * k * factor
}

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
