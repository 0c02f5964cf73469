//! The reprojection residual of one feature seen again (Eqs. 9–10), in pixels, by camera poses.
//!
//! Calibration and joint angles move a residual only through the poses of the two cameras, so that is where it is
//! linearized; [`crate::estimator::state::camera_pose`] carries it on to the states.

use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Vector2, Vector3};

use crate::camera::CameraModel;
use crate::geometry::{so3, tangent_basis};

/// A feature in the frame of its anchor camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Landmark {
    /// Unit direction in the anchor camera.
    pub(crate) bearing: Vector3<f64>,
    /// One over its distance from the anchor camera, in 1/m; never negative.
    pub(crate) inverse_distance: f64,
}

/// Least inverse distance, in 1/m: beyond it a landmark counts as infinitely far.
const MIN_INVERSE_DISTANCE: f64 = 1e-5;

impl Landmark {
    /// `x ⊞ [two on the tangent plane of the bearing, inverse distance]`.
    pub(crate) fn plus(&self, delta: &Vector3<f64>) -> Self {
        let bearing = self.bearing + tangent_basis(&self.bearing) * Vector2::new(delta.x, delta.y);
        Self {
            bearing: bearing.normalize(),
            inverse_distance: (self.inverse_distance + delta.z).max(MIN_INVERSE_DISTANCE),
        }
    }

    /// The point in the anchor camera's frame, in metres.
    pub(crate) fn point_in_anchor(&self) -> Vector3<f64> {
        self.bearing / self.inverse_distance.max(MIN_INVERSE_DISTANCE)
    }
}

/// Where a camera is in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CameraPose {
    /// `world_from_camera`.
    pub(crate) rotation: Matrix3<f64>,
    /// Its centre in the world, in metres.
    pub(crate) position_m: Vector3<f64>,
}

/// `observer_from_anchor`, and what its derivatives need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RelativePose {
    /// Rotation from the anchor camera to the observing one.
    pub(crate) rotation: Matrix3<f64>,
    /// The anchor's centre in the observing camera, in metres.
    pub(crate) translation_m: Vector3<f64>,
    /// `observer_from_world`, the rotation that shifts in the world go through.
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

    /// The landmark in the observing camera, up to the positive factor `inverse_distance`.
    pub(crate) fn direction(&self, landmark: &Landmark) -> Vector3<f64> {
        self.rotation * landmark.bearing + self.translation_m * landmark.inverse_distance
    }
}

/// Residual of one observation and its derivatives, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reprojection {
    /// Predicted minus measured.
    pub(crate) residual_px: Vector2<f64>,
    /// By `[φ; δt]` of the anchor's camera pose; zero when the anchor observes itself.
    pub(crate) by_anchor: Matrix2x6<f64>,
    /// By `[φ; δt]` of the observing camera's pose.
    pub(crate) by_observer: Matrix2x6<f64>,
    /// By [`Landmark::plus`].
    pub(crate) by_landmark: Matrix2x3<f64>,
}

/// The residual only, `None` when the landmark cannot be seen there.
pub(crate) fn residual_px(
    camera: &CameraModel,
    relative: &RelativePose,
    landmark: &Landmark,
    measured_px: &Vector2<f64>,
) -> Option<Vector2<f64>> {
    let predicted = camera.project(&relative.direction(landmark))?;
    Some(predicted - measured_px)
}

/// The residual with its Jacobians.
///
/// `relative` holds the current poses; `linearized` the ones at which the derivatives by the poses are taken (first
/// estimates): the derivative of the image point and the landmark stay at the current estimate, as in Basalt.
pub(crate) fn linearize(
    camera: &CameraModel,
    relative: &RelativePose,
    linearized: &RelativePose,
    landmark: &Landmark,
    measured_px: &Vector2<f64>,
) -> Option<Reprojection> {
    let direction = relative.direction(landmark);
    let (predicted, by_direction) = camera.project_with_jacobian(&direction)?;
    let by_shift = by_direction * linearized.observer_from_world * landmark.inverse_distance;
    let by_anchor_turn = by_direction * linearized.rotation * so3::hat(&landmark.bearing) * -1.0;
    let by_observer_turn = by_direction * so3::hat(&linearized.direction(landmark));

    let mut by_anchor = Matrix2x6::zeros();
    by_anchor.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_anchor_turn);
    by_anchor.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_shift);
    let mut by_observer = Matrix2x6::zeros();
    by_observer.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_observer_turn);
    by_observer.fixed_view_mut::<2, 3>(0, 3).copy_from(&-by_shift);
    Some(Reprojection {
        residual_px: predicted - measured_px,
        by_anchor,
        by_observer,
        by_landmark: landmark_columns(
            &(by_direction * relative.rotation * tangent_basis(&landmark.bearing)),
            &(by_direction * relative.translation_m),
        ),
    })
}

/// The anchor's own measurement of its landmark: only the bearing moves it.
pub(crate) fn linearize_in_anchor(
    camera: &CameraModel,
    landmark: &Landmark,
    measured_px: &Vector2<f64>,
) -> Option<Reprojection> {
    let (predicted, by_direction) = camera.project_with_jacobian(&landmark.bearing)?;
    Some(Reprojection {
        residual_px: predicted - measured_px,
        by_anchor: Matrix2x6::zeros(),
        by_observer: Matrix2x6::zeros(),
        by_landmark: landmark_columns(&(by_direction * tangent_basis(&landmark.bearing)), &Vector2::zeros()),
    })
}

fn landmark_columns(by_tangent: &nalgebra::Matrix2<f64>, by_inverse_distance: &Vector2<f64>) -> Matrix2x3<f64> {
    Matrix2x3::from_columns(&[
        by_tangent.column(0).into_owned(),
        by_tangent.column(1).into_owned(),
        *by_inverse_distance,
    ])
}
