//! Geometry of unit bearings: rotation between two sets, pose from known points.

use nalgebra::{Const, Matrix3, UnitQuaternion, Vector3};

use crate::geometry::{RigidTransform, median, so3, tangent_basis};
use crate::optimization::{NormalEquations, damp, gauss_newton};

/// Rotation between two sets of bearings, with the remaining parallax.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingRotation {
    pub rotation: UnitQuaternion<f64>,
    /// Median remaining angle in radians: the rotation-compensated parallax.
    pub median_parallax_rad: f64,
}

/// Rotation `camera_j_from_camera_i` that best maps the first bearings of the pairs onto the second ones, by robust
/// least squares from an initial value: minimizes `Σ w |R b_i − b_j|²` with Cauchy's weights w, whose normal equations
/// for a step φ are `Σ w (I − b_i b_iᵀ) φ = Σ w b_i × Rᵀ b_j`.
///
/// Parallax of near points biases a plain least-squares fit, so angles beyond the median get less weight (iteratively
/// reweighted). Returns `None` with fewer than three pairs.
pub fn fit_rotation(
    pairs: &[(Vector3<f64>, Vector3<f64>)],
    camera_j_from_camera_i: &UnitQuaternion<f64>,
) -> Option<BearingRotation> {
    const ROUNDS: usize = 8;
    if pairs.len() < 3 {
        return None;
    }
    let linearize = |rotation: &UnitQuaternion<f64>| {
        let scale = median_angle(pairs, rotation).max(1e-6);
        let camera_i_from_camera_j = rotation.inverse();
        let mut equations = NormalEquations::zeros(Const::<3>);
        for (bearing_i, bearing_j) in pairs {
            let measured_in_i = camera_i_from_camera_j * bearing_j;
            let error = measured_in_i.cross(bearing_i);
            let weight = 1.0 / (1.0 + (error.norm() / scale).powi(2));
            // A step φ moves `bearing_i` by φ × bearing_i; the component of φ along the bearing has no effect.
            equations.hessian += (Matrix3::identity() - bearing_i * bearing_i.transpose()) * weight;
            equations.gradient -= bearing_i.cross(&measured_in_i) * weight;
        }
        Some(equations)
    };
    let mut rotation = *camera_j_from_camera_i;
    gauss_newton(&mut rotation, ROUNDS, linearize, |rotation, step| {
        *rotation = so3::plus(rotation, step);
        step.norm() < 1e-7
    })?;
    Some(BearingRotation { rotation, median_parallax_rad: median_angle(pairs, &rotation) })
}

/// Median angle between `rotation · first` and `second`, in radians.
fn median_angle(pairs: &[(Vector3<f64>, Vector3<f64>)], rotation: &UnitQuaternion<f64>) -> f64 {
    // The chord is monotonic in the angle and faster to compute.
    let rotation_matrix = rotation.to_rotation_matrix();
    let chord = |(first, second): &(Vector3<f64>, Vector3<f64>)| (rotation_matrix * first - second).norm_squared();
    let squared = median(pairs.iter().map(chord)).unwrap_or(0.0);
    2.0 * (0.5 * squared.sqrt()).min(1.0).asin()
}

/// Angle between two unit vectors in radians, accurate for small angles too.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}

/// Returns `world_from_imu` that rotates gravity (in the IMU frame, pointing down) to −z, without yaw.
pub(super) fn level(gravity_in_imu: &Vector3<f64>) -> UnitQuaternion<f64> {
    let up = -gravity_in_imu.normalize();
    // The shortest rotation from `up` to z, or half a revolution about x when they are opposite.
    let tilt = UnitQuaternion::rotation_between(&up, &Vector3::z())
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI));
    let forward = tilt * Vector3::x();
    UnitQuaternion::from_scaled_axis(Vector3::z() * -forward.y.atan2(forward.x)) * tilt
}

/// Camera pose estimated from known points.
#[derive(Clone, Debug, PartialEq)]
pub struct ResectedPose {
    pub world_from_camera: RigidTransform,
    /// One flag per point, in the order given.
    pub inliers: Vec<bool>,
    /// Root mean square angle of the inliers, in radians.
    pub rms_rad: f64,
}

/// Refines a camera pose on known points `(point_in_world, bearing)` with a robust loss of decreasing scale.
///
/// `bearing_sigma_rad` is the noise of a bearing; a point is an inlier when its angle is below `inlier_sigmas` times
/// that.
/// Returns `None` with fewer than four points or when the equations are singular.
pub fn refine_camera_pose(
    points: &[(Vector3<f64>, Vector3<f64>)],
    guess: &RigidTransform,
    bearing_sigma_rad: f64,
    inlier_sigmas: f64,
) -> Option<ResectedPose> {
    const TIGHTENING: [f64; 4] = [40.0, 10.0, 3.0, 1.5];
    const ROUNDS: usize = 6;
    if points.len() < 4 {
        return None;
    }
    let mut pose = *guess;
    for sigmas in TIGHTENING {
        let scale = sigmas * bearing_sigma_rad;
        let linearize = |pose: &RigidTransform| {
            let mut equations = NormalEquations::zeros(Const::<6>);
            for (point, bearing) in points {
                let Some((error, jacobian)) = pose_residual(pose, point, bearing) else { continue };
                let weight = 1.0 / (1.0 + error.norm_squared() / (scale * scale));
                equations.add(&error, &jacobian, weight);
            }
            damp(&mut equations.hessian, 1e-9);
            Some(equations)
        };
        gauss_newton(&mut pose, ROUNDS, linearize, |pose, step| {
            *pose = pose.plus(step);
            step.norm() < 1e-8
        })?;
    }
    let limit = inlier_sigmas * bearing_sigma_rad;
    let angles: Vec<f64> = points
        .iter()
        .map(|(point, bearing)| angle_between(&(pose.rotation.inverse() * (point - pose.translation_m)), bearing))
        .collect();
    let inliers: Vec<bool> = angles.iter().map(|angle| *angle < limit).collect();
    let count = inliers.iter().filter(|inlier| **inlier).count();
    let sum: f64 = angles.iter().filter(|angle| **angle < limit).map(|angle| angle * angle).sum();
    Some(ResectedPose { world_from_camera: pose, inliers, rms_rad: (sum / count.max(1) as f64).sqrt() })
}

/// Angle error `Bᵀ Rᵀ (x − t) / |x − t|` of a known point x in the tangent plane B of its bearing (2 × 1) and its
/// derivative by the camera pose `[φ; δt]` (2 × 6); `None` when the point lies behind the camera.
fn pose_residual(
    world_from_camera: &RigidTransform,
    point: &Vector3<f64>,
    bearing: &Vector3<f64>,
) -> Option<(nalgebra::Vector2<f64>, nalgebra::Matrix2x6<f64>)> {
    let back = world_from_camera.rotation_matrix().transpose();
    let in_camera = back * (point - world_from_camera.translation_m);
    let distance = in_camera.norm();
    if in_camera.dot(bearing) <= 1e-3 * distance {
        return None;
    }
    let direction = in_camera / distance;
    let basis = tangent_basis(bearing).transpose();
    let by_point = basis * (Matrix3::identity() - direction * direction.transpose()) / distance;
    let mut jacobian = nalgebra::Matrix2x6::zeros();
    jacobian.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_point * so3::hat(&in_camera)));
    jacobian.fixed_view_mut::<2, 3>(0, 3).copy_from(&(-by_point * back));
    Some((basis * direction, jacobian))
}
