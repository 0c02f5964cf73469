//! Epipolar geometry of unit bearings in two images.
//!
//! The bearings `f` and `f'` of one point in the previous and in the current image satisfy `f'ᵀ E f = 0` with the
//! essential matrix `E = [t]× R` (Longuet-Higgins, "A computer algorithm for reconstructing a scene from two
//! projections", Nature 1981): `R` is the rotation `camera_now_from_camera_previous`, `t` the unit direction of the
//! translation of points from the previous camera frame to the current one.
//!
//! With the normals `n = t × R f` and `n' = f' × t` of both epipolar planes the residual `e = f'ᵀ E f` has the variance
//! `v = |n|² + |n'|² − 2 e²` for isotropic noise of both bearings with variance 1, so that `|e|/√v` is Sampson's
//! distance as an angle (Hartley and Zisserman, *Multiple View Geometry*, section 11.4.3, there for pixels).

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use crate::geometry::{so3, tangent_basis};

/// Unit directions of one feature in two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingPair {
    /// `f`, in the previous camera frame.
    pub previous: Vector3<f64>,
    /// `f'`, in the current camera frame.
    pub now: Vector3<f64>,
}

impl BearingPair {
    /// Pair with `R f` in place of `f`.
    #[inline]
    pub(super) fn rotated(&self, rotation: &UnitQuaternion<f64>) -> Self {
        Self { previous: rotation * self.previous, now: self.now }
    }
}

/// Rotation and direction of translation with their cost.
#[derive(Clone, Copy)]
pub(super) struct MotionHypothesis {
    pub(super) rotation: UnitQuaternion<f64>,
    pub(super) direction: Vector3<f64>,
    pub(super) cost: f64,
}

/// Epipolar constraint of one pair, whose previous bearing is already rotated, at a direction of translation.
pub(super) struct EpipolarConstraint {
    rotated: Vector3<f64>,
    now: Vector3<f64>,
    /// `n`, of the epipolar plane of the previous bearing.
    pub(super) normal: Vector3<f64>,
    /// `n'`, of the epipolar plane of the current bearing.
    pub(super) other_normal: Vector3<f64>,
    /// Epipolar residual `e`, without unit.
    pub(super) residual: f64,
    /// `v`, the variance of `e` relative to the variance of the bearings.
    pub(super) variance: f64,
}

impl EpipolarConstraint {
    #[inline]
    pub(super) fn new(pair: &BearingPair, direction: &Vector3<f64>) -> Self {
        let BearingPair { previous: rotated, now } = *pair;
        let (n, n_other) = (direction.cross(&rotated), now.cross(direction));
        let e = now.dot(&n);
        let variance = n.norm_squared() + n_other.norm_squared() - 2.0 * e * e;
        Self { rotated, now, normal: n, other_normal: n_other, residual: e, variance }
    }

    /// True if the pair constrains the motion: its bearings are not parallel to the direction.
    #[inline]
    pub(super) fn is_regular(&self) -> bool {
        self.variance >= MIN_VARIANCE
    }

    /// Derivative of `e` by a rotation vector of `R f` in the current camera frame, `R f × n'` (3 × 1).
    #[inline]
    pub(super) fn by_rotation(&self) -> Vector3<f64> {
        self.rotated.cross(&self.other_normal)
    }

    /// Derivative of `e` by `t`, `R f × f'` (3 × 1).
    #[inline]
    pub(super) fn by_direction(&self) -> Vector3<f64> {
        self.rotated.cross(&self.now)
    }
}

/// Smallest variance of the residual of a pair that constrains the motion.
const MIN_VARIANCE: f64 = 1e-12;

/// Sampson's distance of a pair from the epipolar geometry as an angle in radians.
///
/// A point in front of both cameras moves towards `direction`; for a point that moves the other way the distance is the
/// length of its motion.
#[inline]
pub(super) fn epipolar_distance(pair: &BearingPair, rotation: &UnitQuaternion<f64>, direction: &Vector3<f64>) -> f64 {
    epipolar_distances(&pair.rotated(rotation), direction)[0]
}

/// [`epipolar_distance`] of a pair whose previous bearing is already rotated, for a direction and its opposite, in
/// radians.
#[inline]
pub(super) fn epipolar_distances(pair: &BearingPair, direction: &Vector3<f64>) -> [f64; 2] {
    let EpipolarConstraint { rotated, now, normal, residual, variance, .. } = EpipolarConstraint::new(pair, direction);
    let sampson = if variance > MIN_VARIANCE { residual.abs() / variance.sqrt() } else { 0.0 };
    let along = (direction - rotated * rotated.dot(direction)).dot(&(now - rotated)) / normal.norm().max(1e-6);
    [sampson.max(-along), sampson.max(along)]
}

/// Geman–McClure weight `1/(1 + s)²` of a squared residual `s` in units of the loss's scale.
#[inline]
pub(super) fn geman_mcclure(s: f64) -> f64 {
    1.0 / ((1.0 + s) * (1.0 + s))
}

/// Adds `w·row·rowᵀ` to the lower triangle of a normal matrix.
#[inline]
pub(super) fn add_outer_product(normal: &mut SMatrix<f64, 5, 5>, row: &SVector<f64, 5>, weight: f64) {
    for column in 0..5 {
        for below in column..5 {
            normal[(below, column)] += row[below] * row[column] * weight;
        }
    }
}

/// Damping of directions that neither tracks nor prior constrain, in the unit of [`gauss_newton_step`]'s normal matrix.
const MIN_INFORMATION: f64 = 1e-9;

/// A Gauss–Newton step on the Sampson distances of `pairs` in units of `scale`, reweighted by the Geman–McClure
/// loss; `None` if the equations are singular.
///
/// The step is `[φ; δ]` (5 × 1): `R ← R Exp(φ)`, and two coordinates of `t` on its tangent plane.
/// `prior` is the information of the prior rotation (3 × 3), `rotation_error` its error in the current camera
/// frame, in radians; a step `φ` changes that error by `R φ` to first order in the error.
pub(super) fn gauss_newton_step(
    pairs: &[BearingPair],
    at: &MotionHypothesis,
    scale: f64,
    prior: &Matrix3<f64>,
    rotation_error: &Vector3<f64>,
) -> Option<(UnitQuaternion<f64>, Vector3<f64>)> {
    let basis = tangent_basis(&at.direction);
    let previous_from_now = at.rotation.to_rotation_matrix().into_inner().transpose();
    // The factorization reads the lower triangle only.
    let mut normal = SMatrix::<f64, 5, 5>::zeros();
    let mut right = SVector::<f64, 5>::zeros();
    for pair in pairs {
        let constraint = EpipolarConstraint::new(&pair.rotated(&at.rotation), &at.direction);
        if !constraint.is_regular() {
            continue;
        }
        let (e, variance) = (constraint.residual, constraint.variance * scale * scale);
        let s = e * e / variance;
        let weight = 1.0 / (variance * (1.0 + s) * (1.0 + s));
        let by_rotation = previous_from_now * constraint.by_rotation();
        let by_direction = basis.tr_mul(&constraint.by_direction());
        let row = SVector::<f64, 5>::new(by_rotation.x, by_rotation.y, by_rotation.z, by_direction.x, by_direction.y);
        add_outer_product(&mut normal, &row, weight);
        right -= row * (e * weight);
    }
    let mut corner = normal.fixed_view_mut::<3, 3>(0, 0);
    corner += previous_from_now * prior * previous_from_now.transpose();
    let mut top = right.fixed_rows_mut::<3>(0);
    top -= previous_from_now * (prior * rotation_error);
    for k in 0..5 {
        // Without parallax the direction is unobservable; without a prior, so is the rotation about a single track.
        normal[(k, k)] += MIN_INFORMATION;
    }
    let step = normal.cholesky()?.solve(&right);
    let rotation = so3::plus(&at.rotation, &Vector3::new(step[0], step[1], step[2]));
    let direction = (at.direction + basis * step.fixed_rows::<2>(3)).try_normalize(1e-9)?;
    Some((rotation, direction))
}
