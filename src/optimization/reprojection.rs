//! Reprojection residual of one observation (Eqs. 9–10) with its Jacobians.
//!
//! With the landmark's bearing `b` and inverse distance `ρ` in the anchor camera `a`, observed by camera `o`:
//!
//! ```text
//! R = R_woᵀ R_wa,  t = R_woᵀ (p_wa − p_wo)      observer_from_anchor
//! d = R b + ρ t                                 direction in the observing camera, up to the positive factor ρ
//! r = π(d) − z                                  predicted minus measured, in the unit of the projection (2)
//! ∂r/∂φ_a = −Π R [b]×     ∂r/∂p_a =  ρ Π R_woᵀ    by [φ; δt] of world_from_anchor (2 × 6)
//! ∂r/∂φ_o =  Π [d]×       ∂r/∂p_o = −ρ Π R_woᵀ    by [φ; δt] of world_from_observer (2 × 6)
//! ∂r/∂α   =  Π R B(b)     ∂r/∂ρ   =  Π t          by the landmark (2 × 3)
//! ```
//!
//! `Π = ∂π/∂d` (2 × 3), poses are perturbed by the rule of [`crate::geometry`], the landmark by [`Landmark::plus`].
//! Extrinsics, joint angles and time offsets change a residual only through the poses of the two cameras, parameters of
//! the camera model only through `π`: [`linearize`] is the only place where a new sensor model adds its derivative.

use nalgebra::{ArrayStorage, Matrix2, Matrix2x3, Matrix2x6, Matrix3, Vector2, Vector3};

use super::{Landmark, RobustLoss};
use crate::camera::CameraModel;
use crate::geometry::{RigidTransform, tangent_basis};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CameraPose {
    /// Rotation matrix of `world_from_camera`.
    pub(crate) rotation: Matrix3<f64>,
    /// Centre of the camera in the world, in metres.
    pub(crate) position_m: Vector3<f64>,
}

impl From<RigidTransform> for CameraPose {
    fn from(world_from_camera: RigidTransform) -> Self {
        Self { rotation: world_from_camera.rotation_matrix(), position_m: world_from_camera.translation_m }
    }
}

/// `observer_from_anchor` of two cameras.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RelativePose {
    /// Rotation from the anchor camera to the observing one.
    pub(crate) rotation: Matrix3<f64>,
    /// Centre of the anchor in the observing camera, in metres.
    pub(crate) translation_m: Vector3<f64>,
    /// Rotation from the world to the observing camera, for the derivatives by positions.
    pub(crate) observer_from_world: Matrix3<f64>,
}

impl RelativePose {
    pub(crate) fn new(anchor: &CameraPose, observer: &CameraPose) -> Self {
        let observer_from_world = observer.rotation.transpose();
        Self {
            rotation: observer_from_world * anchor.rotation,
            translation_m: observer_from_world * (anchor.position_m - observer.position_m),
            observer_from_world,
        }
    }

    /// Direction of the landmark in the observing camera, up to the positive factor `inverse_distance`.
    pub(crate) fn direction(&self, landmark: &Landmark) -> Vector3<f64> {
        self.rotation * landmark.bearing + self.translation_m * landmark.inverse_distance
    }
}

/// Relative poses of every pair of cameras, `[anchor][observer]`.
#[derive(Clone, Debug)]
pub(crate) struct RelativePoses {
    cameras: usize,
    pairs: Vec<RelativePose>,
}

impl RelativePoses {
    pub(crate) fn new(cameras: &[CameraPose]) -> Self {
        let pairs = cameras
            .iter()
            .flat_map(|anchor| cameras.iter().map(move |observer| RelativePose::new(anchor, observer)))
            .collect();
        Self { cameras: cameras.len(), pairs }
    }

    pub(crate) fn get(&self, anchor: usize, observer: usize) -> &RelativePose {
        &self.pairs[anchor * self.cameras + observer]
    }
}

/// Projection `π` of a direction in the camera to a measurement.
pub(crate) trait BearingProjection {
    /// Predicted measurement, `None` when the camera cannot observe the direction.
    fn project(&self, direction: &Vector3<f64>) -> Option<Vector2<f64>>;

    /// Predicted measurement and its derivative by the direction (2 × 3).
    fn project_with_jacobian(&self, direction: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)>;
}

impl BearingProjection for CameraModel {
    fn project(&self, direction: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.project(direction)
    }

    fn project_with_jacobian(&self, direction: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        self.project_with_jacobian(direction)
    }
}

/// Projection to angles in radians in the plane tangent to the unit sphere at a measured bearing, which is the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TangentPlane {
    /// Unit direction in the camera.
    pub(crate) bearing: Vector3<f64>,
    basis: Matrix2x3<f64>,
}

impl TangentPlane {
    pub(crate) fn new(bearing: Vector3<f64>) -> Self {
        Self { bearing, basis: tangent_basis(&bearing).transpose() }
    }

    /// Unit vector and length of a direction, `None` unless it points to the bearing's side.
    fn ahead(&self, direction: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
        let length = direction.norm();
        (direction.dot(&self.bearing) > 1e-3 * length).then(|| (direction / length, length))
    }
}

impl BearingProjection for TangentPlane {
    fn project(&self, direction: &Vector3<f64>) -> Option<Vector2<f64>> {
        let (unit, _) = self.ahead(direction)?;
        Some(self.basis * unit)
    }

    fn project_with_jacobian(&self, direction: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let (unit, length) = self.ahead(direction)?;
        let by_direction = self.basis * (Matrix3::identity() - unit * unit.transpose()) / length;
        Some((self.basis * unit, by_direction))
    }
}

/// Residual of one observation and its derivatives, in the unit of the projection or whitened.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reprojection {
    /// Predicted minus measured position, in pixels.
    pub(crate) residual: Vector2<f64>,
    /// Derivative by `[φ; δt]` of the anchor's camera pose; zero in the anchor's own observation.
    pub(crate) by_anchor: Matrix2x6<f64>,
    /// Derivative by `[φ; δt]` of the observing camera's pose.
    pub(crate) by_observer: Matrix2x6<f64>,
    /// Derivative by the landmark's step in [`Landmark::plus`].
    pub(crate) by_landmark: Matrix2x3<f64>,
}

impl Reprojection {
    /// Division by the standard deviation and multiplication by the root of the robust weight, so that `rᵀr` and `Jᵀr`
    /// are cost and gradient of the reweighted problem.
    pub(crate) fn whitened(&self, sigma: f64, loss: RobustLoss) -> Self {
        self.weighted(sigma, self.robust_weight(sigma, loss))
    }

    pub(crate) fn robust_weight(&self, sigma: f64, loss: RobustLoss) -> f64 {
        let squared = self.residual.norm_squared() / (sigma * sigma);
        loss.cost_and_weight(squared).1
    }

    /// [`Self::whitened`] with a given robust weight.
    #[inline]
    pub(crate) fn weighted(&self, sigma: f64, weight: f64) -> Self {
        let scale = weight.sqrt() / sigma;
        Self {
            residual: self.residual * scale,
            by_anchor: self.by_anchor * scale,
            by_observer: self.by_observer * scale,
            by_landmark: self.by_landmark * scale,
        }
    }
}

/// Residual without derivatives (2 × 1), `None` when the camera cannot observe the landmark.
pub(crate) fn residual(
    projection: &impl BearingProjection,
    relative: &RelativePose,
    landmark: &Landmark,
    measured: &Vector2<f64>,
) -> Option<Vector2<f64>> {
    let predicted = projection.project(&relative.direction(landmark))?;
    Some(predicted - measured)
}

/// Residual with its Jacobians, `None` when the camera cannot observe the landmark.
///
/// `relative` has the current pose; derivatives by the poses are evaluated at `linearized` (first estimates), while the
/// derivative of the projection and the landmark stay at the current estimate, as in Basalt.
#[inline]
pub(crate) fn linearize(
    projection: &impl BearingProjection,
    relative: &RelativePose,
    linearized: &RelativePose,
    landmark: &Landmark,
    measured: &Vector2<f64>,
) -> Option<Reprojection> {
    let direction = relative.direction(landmark);
    let (predicted, by_direction) = projection.project_with_jacobian(&direction)?;
    let by_shift = by_direction * linearized.observer_from_world * landmark.inverse_distance;
    let by_anchor_rotation = times_hat(&(by_direction * linearized.rotation), &-landmark.bearing);
    let by_observer_rotation = times_hat(&by_direction, &linearized.direction(landmark));
    Some(Reprojection {
        residual: predicted - measured,
        by_anchor: beside(&by_anchor_rotation, &by_shift),
        by_observer: beside(&by_observer_rotation, &-by_shift),
        by_landmark: landmark_columns(
            &(by_direction * relative.rotation * tangent_basis(&landmark.bearing)),
            &(by_direction * relative.translation_m),
        ),
    })
}

/// `rows · [v]×` (2 × 3).
#[inline]
fn times_hat(rows: &Matrix2x3<f64>, v: &Vector3<f64>) -> Matrix2x3<f64> {
    let [a, b, c] = &rows.data.0;
    let column = |p: &[f64; 2], x: f64, q: &[f64; 2], y: f64| [p[0] * x - q[0] * y, p[1] * x - q[1] * y];
    Matrix2x3::from_array_storage(ArrayStorage([
        column(b, v.z, c, v.y),
        column(c, v.x, a, v.z),
        column(a, v.y, b, v.x),
    ]))
}

/// The columns of `left`, then the columns of `right` (2 × 6).
#[inline]
fn beside(left: &Matrix2x3<f64>, right: &Matrix2x3<f64>) -> Matrix2x6<f64> {
    let ([a, b, c], [d, e, f]) = (left.data.0, right.data.0);
    Matrix2x6::from_array_storage(ArrayStorage([a, b, c, d, e, f]))
}

/// Residual of the anchor's own observation of its landmark, which depends only on the bearing.
pub(crate) fn linearize_in_anchor(
    projection: &impl BearingProjection,
    landmark: &Landmark,
    measured: &Vector2<f64>,
) -> Option<Reprojection> {
    let (predicted, by_direction) = projection.project_with_jacobian(&landmark.bearing)?;
    Some(Reprojection {
        residual: predicted - measured,
        by_anchor: Matrix2x6::zeros(),
        by_observer: Matrix2x6::zeros(),
        by_landmark: landmark_columns(&(by_direction * tangent_basis(&landmark.bearing)), &Vector2::zeros()),
    })
}

fn landmark_columns(by_tangent: &Matrix2<f64>, by_inverse_distance: &Vector2<f64>) -> Matrix2x3<f64> {
    Matrix2x3::from_columns(&[
        by_tangent.column(0).into_owned(),
        by_tangent.column(1).into_owned(),
        *by_inverse_distance,
    ])
}
