//! Metric scale, gravity, velocities and biases for camera poses that are known up to scale.
//!
//! All quantities are in the IMU frame of the first view ("start").
//! Rotations of the IMU come from the gyroscope, rotations of the camera from the images. Between them are the
//! extrinsics, which a gimbal rotates: only their rotation at the first view is an unknown, averaged over all
//! views.

use nalgebra::{Const, DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

use crate::estimator::state::navigation::ImuBias;
use crate::estimator::state::preintegration::Preintegration;
use crate::geometry::{RigidTransform, median, so3};
use crate::optimization::{NormalEquations, gauss_newton};

/// Standard deviation of a visual rotation between two views; added to the noise of the extrinsics.
const VISUAL_ROTATION_SIGMA_RAD: f64 = 0.002;
/// Typical distance of landmarks before the scale is known.
const FIRST_DISTANCE_M: f64 = 8.0;
/// Error of a gyroscope rotation over the window; it rotates gravity into a spurious acceleration.
const TILT_SIGMA_RAD: f64 = 0.003;
/// Iterations of the linear system; the second and later ones also estimate the rotation of the extrinsics.
const ROUNDS: usize = 5;

/// Gaussian prior on a vector with equal standard deviation on each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VectorPrior {
    pub mean: Vector3<f64>,
    /// Standard deviation of each component.
    pub sigma: f64,
}

pub(super) struct AlignmentInput<'a> {
    /// `first_camera_from_camera`, up to scale, one per view.
    pub(super) cameras: &'a [RigidTransform],
    /// Extrinsics from calibration and encoders, one per view.
    pub(super) imu_from_camera: &'a [RigidTransform],
    /// Motion from each view to the next; one fewer than views.
    pub(super) increments: &'a [Preintegration],
    /// Median distance of the landmarks, in the cameras' unit of length.
    pub(super) median_distance: f64,
    pub(super) bearing_sigma_rad: f64,
    pub(super) gravity_m_per_s2: f64,
    /// Rotation error of the extrinsics common to all views.
    pub(super) extrinsics_rotation_sigma_rad: f64,
    /// Rotation error of the extrinsics, independent in each view.
    pub(super) extrinsics_rotation_noise_rad: f64,
    pub(super) gyroscope_bias: VectorPrior,
    pub(super) accelerometer_bias: VectorPrior,
}

/// First metric solution, in the IMU frame of the first view.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    /// Metres per unit of the cameras' translations.
    pub(super) scale: f64,
    /// Gravity (pointing down) with exact magnitude, in m/s².
    pub(super) gravity: Vector3<f64>,
    /// Pose `start_from_imu` of each view.
    pub(super) poses: Vec<RigidTransform>,
    /// Velocity per view, in m/s.
    pub(super) velocities: Vec<Vector3<f64>>,
    /// Extrinsics per view, with the rotation from the images.
    pub(super) imu_from_camera: Vec<RigidTransform>,
    pub(super) bias: ImuBias,
    /// Weighted sum of squared residuals of the linear system.
    cost: f64,
}

/// Rotation of the extrinsics at the first view and gyroscope bias, from rotations alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct RotationAlignment {
    pub(super) imu_from_first_camera: UnitQuaternion<f64>,
    pub(super) gyroscope_bias: Vector3<f64>,
}

/// Returns `start_from_imu` of every view for a gyroscope bias, and its derivative with respect to the bias
/// (right perturbation, 3 × 3).
fn gyroscope_rotations(increments: &[Preintegration], bias: &Vector3<f64>) -> Vec<(UnitQuaternion<f64>, Matrix3<f64>)> {
    let mut rotations = vec![(UnitQuaternion::identity(), Matrix3::zeros())];
    let (mut rotation, mut by_bias) = (UnitQuaternion::identity(), Matrix3::zeros());
    for increment in increments {
        let bias = ImuBias { gyroscope_rad_per_s: *bias, ..*increment.bias() };
        let rotation_step = increment.corrected(&bias).rotation;
        let own: Matrix3<f64> = increment.bias_jacobian().fixed_view::<3, 3>(0, 0).into_owned();
        by_bias = rotation_step.inverse().to_rotation_matrix().into_inner() * by_bias + own;
        rotation = so3::composed(&rotation, &rotation_step);
        rotations.push((rotation, by_bias));
    }
    rotations
}

/// Estimates the rotation of the extrinsics at the first view together with the gyroscope bias, robustly.
///
/// Each view gives `imu_from_first_camera = start_from_imu · imu_from_camera · camera_from_first_camera`.
pub(super) fn align_rotations(input: &AlignmentInput<'_>) -> Option<RotationAlignment> {
    const ROUNDS: usize = 10;
    let sigma = input.extrinsics_rotation_noise_rad.hypot(VISUAL_ROTATION_SIGMA_RAD);
    let linearize = |at: &RotationAlignment| {
        let (extrinsics, bias) = (at.imu_from_first_camera, at.gyroscope_bias);
        let rotations = gyroscope_rotations(input.increments, &bias);
        let mut equations = NormalEquations::zeros(Const::<6>);
        let prior = 1.0 / input.gyroscope_bias.sigma.powi(2);
        for axis in 0..3 {
            equations.add_diagonal(3 + axis, bias[axis] - input.gyroscope_bias.mean[axis], prior);
        }
        for ((start_from_imu, by_bias), (given, camera)) in
            rotations.iter().zip(input.imu_from_camera.iter().zip(input.cameras))
        {
            let predicted = start_from_imu * given.rotation * camera.rotation.inverse();
            let error = so3::log(&(extrinsics.inverse() * predicted));
            // Moves the right perturbation of `start_from_imu` to the right end of the product.
            let onward = (given.rotation * camera.rotation.inverse()).inverse().to_rotation_matrix().into_inner();
            let by_bias = onward * by_bias;
            let ratio = error.norm() / sigma;
            let weight = 1.0 / (sigma * sigma * (1.0 + (ratio / 3.0).powi(2)));
            // error(δ, db) ≈ error − δ + by_bias · db, for a right perturbation δ of the extrinsics.
            let mut jacobian = nalgebra::Matrix3x6::zeros();
            jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
            jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&by_bias);
            equations.add(&error, &jacobian, weight);
        }
        Some(equations)
    };
    let mut alignment = RotationAlignment {
        imu_from_first_camera: input.imu_from_camera.first()?.rotation,
        gyroscope_bias: input.gyroscope_bias.mean,
    };
    gauss_newton(&mut alignment, ROUNDS, linearize, |at, step| {
        at.imu_from_first_camera = so3::plus(&at.imu_from_first_camera, &step.fixed_rows::<3>(0).into_owned());
        at.gyroscope_bias += step.fixed_rows::<3>(3);
        step.norm() < 1e-7
    })?;
    Some(alignment)
}

/// Columns of the linear system: scale, extrinsics (3), accelerometer bias (3), gravity (3), velocities (3 each).
const SCALE: usize = 0;
const EXTRINSICS: usize = 1;
const BIAS: usize = 4;
const GRAVITY: usize = 7;
const VELOCITY: usize = 10;

/// Above this uncertainty of the extrinsics' rotation, the alignment starts from several rotations.
const AMPLE_EXTRINSICS_SIGMA_RAD: f64 = 0.6;

/// Solves for scale, gravity of exact magnitude, velocities, accelerometer bias and the remaining rotation of
/// the extrinsics.
///
/// Without encoders the rotation of the camera is unknown: then the 24 rotations of a cube are tried as well, one of
/// which is within 63° of any rotation, and the solution of smallest cost is kept.
pub(super) fn align(input: &AlignmentInput<'_>, rotation: &RotationAlignment) -> Option<Alignment> {
    let mut best = align_from(input, rotation, rotation.imu_from_first_camera);
    if input.extrinsics_rotation_sigma_rad > AMPLE_EXTRINSICS_SIGMA_RAD {
        for rotation_step in cube_rotations() {
            let candidate = align_from(input, rotation, rotation_step * rotation.imu_from_first_camera);
            let better = match (&candidate, &best) {
                (Some(new), Some(old)) => new.scale > 0.0 && (old.scale <= 0.0 || new.cost < old.cost),
                (Some(_), None) => true,
                _ => false,
            };
            if better {
                best = candidate;
            }
        }
    }
    best
}

/// The 23 rotations of a cube other than the identity.
fn cube_rotations() -> impl Iterator<Item = UnitQuaternion<f64>> {
    let axes = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()];
    axes.into_iter().flat_map(|up| (0..4).map(move |quarter| (up, quarter))).filter_map(|(up, quarter)| {
        let tilt = UnitQuaternion::rotation_between(&Vector3::z(), &up)
            .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI));
        let rotation_step = Vector3::z() * (f64::from(quarter) * std::f64::consts::FRAC_PI_2);
        let rotation = tilt * UnitQuaternion::from_scaled_axis(rotation_step);
        (rotation.angle() > 0.1).then_some(rotation)
    })
}

/// Returns the alignment from one initial rotation of the extrinsics at the first view.
fn align_from(
    input: &AlignmentInput<'_>,
    rotation: &RotationAlignment,
    imu_from_first_camera: UnitQuaternion<f64>,
) -> Option<Alignment> {
    let rotations: Vec<UnitQuaternion<f64>> = gyroscope_rotations(input.increments, &rotation.gyroscope_bias)
        .into_iter()
        .map(|(rotation, _)| rotation)
        .collect();
    let mut extrinsics = imu_from_first_camera;
    let mut scale: Option<f64> = None;
    let mut rotation_change = so3::log(&(extrinsics * rotation.imu_from_first_camera.inverse()));
    let mut last: Option<(DVector<f64>, f64)> = None;
    for _ in 0..ROUNDS {
        let (normal, rhs, square) = linear_system(input, &rotations, &extrinsics, scale, &rotation_change, rotation);
        let solution = solve_with_gravity_norm(&normal, &rhs, input.gravity_m_per_s2)?;
        let cost = square + (solution.transpose() * (&normal * &solution - &rhs * 2.0))[0];
        let rotation_step = solution.fixed_rows::<3>(EXTRINSICS).into_owned();
        extrinsics = so3::plus_left(&extrinsics, &rotation_step);
        rotation_change += rotation_step;
        // A negative scale would mirror the scene: continue from a small positive one.
        scale = Some(solution[SCALE].max(1e-6));
        last = Some((solution, cost));
    }
    let (solution, cost) = last?;
    let scale = solution[SCALE];
    if !solution.iter().all(|value| value.is_finite()) {
        return None;
    }
    let gravity = solution.fixed_rows::<3>(GRAVITY).into_owned();
    let lever = input.imu_from_camera.first()?.translation_m;
    let mut poses = Vec::new();
    let mut camera_extrinsics = Vec::new();
    for ((start_from_imu, camera), given) in rotations.iter().zip(input.cameras).zip(input.imu_from_camera) {
        let camera_rotation = extrinsics * camera.rotation;
        let position = extrinsics * camera.translation_m * scale + lever - start_from_imu * given.translation_m;
        poses.push(RigidTransform::new(*start_from_imu, position));
        camera_extrinsics.push(RigidTransform::new(start_from_imu.inverse() * camera_rotation, given.translation_m));
    }
    let velocities = (0..poses.len()).map(|k| solution.fixed_rows::<3>(VELOCITY + 3 * k).into_owned()).collect();
    let bias = ImuBias {
        gyroscope_rad_per_s: rotation.gyroscope_bias,
        accelerometer_m_per_s2: solution.fixed_rows::<3>(BIAS).into_owned(),
    };
    Some(Alignment { scale, gravity, poses, velocities, imu_from_camera: camera_extrinsics, bias, cost })
}

/// Weighted normal equations `N x = b` of all intervals and priors, and the weighted sum of the squared right sides.
///
/// With `(R_k, p_k, v_k)` of the IMU, `p_k = s R_IC c_k + l_0 − R_k l_k` from the camera's position `c_k` and lever arm
/// `l_k`, an interval of T seconds gives six equations, linear in scale s, `v_k`, gravity g and a change of the bias `b_a`
/// and of `R_IC`, as the visual–inertial alignment of Qin et al. (VINS-Mono, TRO 2018):
///
/// ```text
/// p_k+1 − p_k = v_k T + ½ g T² + R_k Δp    v_k+1 − v_k = g T + R_k Δv
/// ```
fn linear_system(
    input: &AlignmentInput<'_>,
    rotations: &[UnitQuaternion<f64>],
    extrinsics: &UnitQuaternion<f64>,
    scale: Option<f64>,
    rotation_change: &Vector3<f64>,
    rotation: &RotationAlignment,
) -> (DMatrix<f64>, DVector<f64>, f64) {
    let columns = VELOCITY + 3 * rotations.len();
    let mut normal = DMatrix::zeros(columns, columns);
    let mut rhs = DVector::zeros(columns);
    let mut square = 0.0;
    let distance_m = scale.map_or(FIRST_DISTANCE_M, |scale| scale * input.median_distance);
    let visual_sigma_m = 0.3 * input.bearing_sigma_rad * distance_m;
    let bias =
        ImuBias { gyroscope_rad_per_s: rotation.gyroscope_bias, accelerometer_m_per_s2: input.accelerometer_bias.mean };
    let mut row = DMatrix::zeros(3, columns);
    for (k, increment) in input.increments.iter().enumerate() {
        let t = increment.duration_s();
        let motion = increment.corrected(&bias);
        let r = rotations[k].to_rotation_matrix().into_inner();
        let jacobian = increment.bias_jacobian();
        let p_by_ba: Matrix3<f64> = r * jacobian.fixed_view::<3, 3>(3, 3);
        let v_by_ba: Matrix3<f64> = r * jacobian.fixed_view::<3, 3>(6, 3);
        let lever = rotations[k + 1] * input.imu_from_camera[k + 1].translation_m
            - rotations[k] * input.imu_from_camera[k].translation_m;
        let baseline = extrinsics * (input.cameras[k + 1].translation_m - input.cameras[k].translation_m);
        let tilt = TILT_SIGMA_RAD * input.gravity_m_per_s2;

        row.fill(0.0);
        row.fixed_view_mut::<3, 1>(0, SCALE).copy_from(&baseline);
        if let Some(scale) = scale {
            row.fixed_view_mut::<3, 3>(0, EXTRINSICS).copy_from(&(-so3::hat(&baseline) * scale));
        }
        row.fixed_view_mut::<3, 3>(0, BIAS).copy_from(&-p_by_ba);
        row.fixed_view_mut::<3, 3>(0, GRAVITY).copy_from(&(Matrix3::identity() * (-0.5 * t * t)));
        row.fixed_view_mut::<3, 3>(0, VELOCITY + 3 * k).copy_from(&(Matrix3::identity() * -t));
        let sigma = visual_sigma_m.hypot(0.5 * tilt * t * t).max(1e-4);
        let side = r * motion.position_m + lever - p_by_ba * bias.accelerometer_m_per_s2;
        add_rows(&mut normal, &mut rhs, &mut square, &row, &side, sigma);

        row.fill(0.0);
        row.fixed_view_mut::<3, 3>(0, BIAS).copy_from(&-v_by_ba);
        row.fixed_view_mut::<3, 3>(0, GRAVITY).copy_from(&(Matrix3::identity() * -t));
        row.fixed_view_mut::<3, 3>(0, VELOCITY + 3 * k).copy_from(&-Matrix3::identity());
        row.fixed_view_mut::<3, 3>(0, VELOCITY + 3 * k + 3).copy_from(&Matrix3::identity());
        let sigma = (tilt * t).max(1e-4);
        let side = r * motion.velocity_m_per_s - v_by_ba * bias.accelerometer_m_per_s2;
        add_rows(&mut normal, &mut rhs, &mut square, &row, &side, sigma);
    }
    let bias_weight = 1.0 / input.accelerometer_bias.sigma.powi(2);
    let extrinsics_weight = 1.0 / input.extrinsics_rotation_sigma_rad.max(1e-4).powi(2);
    for axis in 0..3 {
        normal[(BIAS + axis, BIAS + axis)] += bias_weight;
        rhs[BIAS + axis] += bias_weight * input.accelerometer_bias.mean[axis];
        square += bias_weight * input.accelerometer_bias.mean[axis].powi(2);
        normal[(EXTRINSICS + axis, EXTRINSICS + axis)] += extrinsics_weight;
        rhs[EXTRINSICS + axis] -= extrinsics_weight * rotation_change[axis];
        square += extrinsics_weight * rotation_change[axis].powi(2);
    }
    (normal, rhs, square)
}

fn add_rows(
    normal: &mut DMatrix<f64>,
    rhs: &mut DVector<f64>,
    square: &mut f64,
    rows: &DMatrix<f64>,
    side: &Vector3<f64>,
    sigma: f64,
) {
    let weight = 1.0 / (sigma * sigma);
    normal.gemm_tr(weight, rows, rows, 1.0);
    rhs.gemv_tr(weight, rows, side, 1.0);
    *square += weight * side.norm_squared();
}

/// Least-squares solution of `N x = b` whose three gravity entries have exactly the given norm.
///
/// All other unknowns are eliminated onto gravity, `A g = b` with the Schur complement A. The multiplier μ of the
/// constraint, with `(A + μ I) g = b`, is the root of a function that decreases monotonically beyond
/// the last pole, found by bisection.
pub(super) fn solve_with_gravity_norm(
    normal: &DMatrix<f64>,
    rhs: &DVector<f64>,
    magnitude: f64,
) -> Option<DVector<f64>> {
    let n = rhs.len();
    let others: Vec<usize> = (0..n).filter(|column| !(GRAVITY..GRAVITY + 3).contains(column)).collect();
    let count = others.len();
    let inner = DMatrix::from_fn(count, count, |row, col| normal[(others[row], others[col])]);
    let coupling = DMatrix::from_fn(count, 3, |row, col| normal[(others[row], GRAVITY + col)]);
    let inner_rhs = DVector::from_fn(count, |row, _| rhs[others[row]]);
    let factor = inner.cholesky()?;
    let solved_coupling = factor.solve(&coupling);
    let solved_rhs = factor.solve(&inner_rhs);
    let corner: Matrix3<f64> = normal.fixed_view::<3, 3>(GRAVITY, GRAVITY).into_owned();
    let reduced: Matrix3<f64> = corner - coupling.tr_mul(&solved_coupling).fixed_view::<3, 3>(0, 0);
    let reduced_rhs: Vector3<f64> = rhs.fixed_rows::<3>(GRAVITY) - coupling.tr_mul(&solved_rhs).fixed_rows::<3>(0);
    let gravity = quadratic_on_sphere(&reduced, &reduced_rhs, magnitude)?;
    let rest = solved_rhs - solved_coupling * gravity;
    let mut solution = DVector::zeros(n);
    for (value, column) in rest.iter().zip(&others) {
        solution[*column] = *value;
    }
    solution.fixed_rows_mut::<3>(GRAVITY).copy_from(&gravity);
    Some(solution)
}

/// Minimizes `xᵀ A x − 2 bᵀ x` over `x` of the given norm.
pub(super) fn quadratic_on_sphere(a: &Matrix3<f64>, b: &Vector3<f64>, norm: f64) -> Option<Vector3<f64>> {
    const HALVINGS: usize = 200;
    let eigen = ((a + a.transpose()) * 0.5).try_symmetric_eigen(1e-15, 500)?;
    let c = eigen.eigenvectors.tr_mul(b);
    let least = eigen.eigenvalues.min();
    if b.norm() == 0.0 || !b.norm().is_finite() || !norm.is_finite() {
        return None;
    }
    // (A + μ I) x = b with μ > −least: |x| falls from infinity to zero.
    let length = |mu: f64| c.component_div(&eigen.eigenvalues.add_scalar(mu)).norm();
    let (mut low, mut high) = (-least, -least + b.norm() / norm);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if length(middle) > norm { low = middle } else { high = middle }
    }
    let mu = high;
    let x = eigen.eigenvectors * c.component_div(&eigen.eigenvalues.add_scalar(mu));
    // The norm is exact up to rounding; in the hard case (b orthogonal to the eigenvector of the smallest
    // eigenvalue) it is enforced.
    let length = x.norm();
    (length.is_finite() && length > 0.0).then(|| x * (norm / length))
}

/// Median distance of landmarks from their anchors, in their own unit.
pub(super) fn median_distance(inverse_distances: impl Iterator<Item = f64>) -> f64 {
    1.0 / median(inverse_distances).unwrap_or(0.0).max(1e-9)
}
