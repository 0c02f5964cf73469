//! Pose of a camera from the known points that it sees.
//!
//! The pose minimizes the reprojection residuals `r_i = π(R·X_i + t) − z_i` in least squares over the points that fit.

use nalgebra::{Const, Matrix6, Vector6};

use super::point_residual::{by_pose, median_px, residual, residual_lengths};
use super::pose_start::pose_by_samples;
use crate::camera::CameraModel;
use crate::geometry::{MEDIAN_PLANAR_LENGTH, RigidTransform};
use crate::optimization::damped::{DampedOptions, LeastSquares, minimize};
use crate::optimization::{NormalEquations, RobustLoss};
use crate::sensors::{MapPoint, StillCamera, StillView};

/// A point is left out if its residual exceeds this multiple of the median length: 8.5 standard deviations.
const MAX_MEDIAN_RATIO: f64 = 10.0;
/// Residual of half weight in the first, robust refinement, in standard deviations.
const CAUCHY_SIGMAS: f64 = 3.0;
/// Median residual, relative to the focal length, above which a refined pose is wrong: 1° of direction.
const MAX_MEDIAN_PER_FOCAL: f64 = 0.0175;
/// Smallest number of points that determine pose and noise.
const MIN_POINTS: usize = 6;
const OPTIONS: DampedOptions = DampedOptions {
    iterations: 60,
    relative_cost_tolerance: 1e-15,
    first_damping: 1e-6,
    min_damping: 1e-12,
    max_damping: 1e12,
    growth: 20.0,
};

/// Pose of one view with its uncertainty.
#[derive(Clone, Debug)]
pub(super) struct ViewPose {
    pub(super) camera_from_world: RigidTransform,
    /// Covariance of `[φ; δt]` of `camera_from_world` by the noise of the pixels, points taken as exact.
    pub(super) covariance: Matrix6<f64>,
    /// Points whose residuals fit the pose.
    pub(super) points: Vec<MapPoint>,
    /// Number of points that do not fit.
    pub(super) left_out: usize,
    /// Mean length of the residuals over the points that fit.
    pub(super) mean_px: f64,
}

/// Refines the pose of a view; `None` if no pose explains its points.
///
/// The given pose is the start. Without one, or if the refined pose is wrong by [`MAX_MEDIAN_PER_FOCAL`], poses of three
/// points are tried ([`pose_by_samples`]).
pub(super) fn view_pose(camera: &StillCamera, view: &StillView) -> Option<ViewPose> {
    let limit_px = MAX_MEDIAN_PER_FOCAL * camera.model.focal_length_px();
    let of_given = view.camera_from_world.map(|given| robust_pose(&camera.model, &view.points, given, limit_px));
    let robust = match of_given {
        Some(pose) if median_px(&camera.model, &view.points, &pose) < limit_px => pose,
        _ => {
            let sampled = pose_by_samples(&camera.model, &view.points)?;
            robust_pose(&camera.model, &view.points, sampled, median_px(&camera.model, &view.points, &sampled))
        }
    };
    let median_px = median_px(&camera.model, &view.points, &robust);
    let fits = |point: &&MapPoint| {
        residual(&camera.model, &robust, point).is_some_and(|it| it.norm() <= MAX_MEDIAN_RATIO * median_px.max(1e-6))
    };
    let points: Vec<MapPoint> = view.points.iter().filter(fits).copied().collect();
    if median_px >= limit_px || points.len() < MIN_POINTS {
        return None;
    }
    let loss = RobustLoss::None;
    let mut problem = PoseProblem { model: &camera.model, points: &points, sigma_px: 1.0, loss };
    let camera_from_world = minimize(&mut problem, robust, &OPTIONS).estimate;
    let information = problem.linearize(&camera_from_world).hessian;
    let lengths = residual_lengths(&camera.model, &camera_from_world, &points)?;
    let squares: f64 = lengths.iter().map(|length| length * length).sum();
    let sigma_px = (squares / (2 * points.len() - 6) as f64).sqrt();
    Some(ViewPose {
        camera_from_world,
        covariance: information.cholesky()?.inverse() * sigma_px.max(1e-6).powi(2),
        mean_px: lengths.iter().sum::<f64>() / lengths.len() as f64,
        left_out: view.points.len() - points.len(),
        points,
    })
}

/// Pose with Cauchy's loss, whose scale follows the residuals.
fn robust_pose(model: &CameraModel, points: &[MapPoint], start: RigidTransform, limit_px: f64) -> RigidTransform {
    const ROUNDS: usize = 3;
    let mut pose = start;
    let mut sigma_px = limit_px;
    for _ in 0..ROUNDS {
        let loss = RobustLoss::Cauchy(CAUCHY_SIGMAS);
        pose = minimize(&mut PoseProblem { model, points, sigma_px, loss }, pose, &OPTIONS).estimate;
        sigma_px = (median_px(model, points, &pose) / MEDIAN_PLANAR_LENGTH).clamp(1e-4, limit_px.max(1e-4));
    }
    pose
}

struct PoseProblem<'a> {
    model: &'a CameraModel,
    points: &'a [MapPoint],
    sigma_px: f64,
    loss: RobustLoss,
}

impl LeastSquares for PoseProblem<'_> {
    type Estimate = RigidTransform;
    type Equations = NormalEquations<Const<6>>;

    fn cost(&self, pose: &RigidTransform) -> f64 {
        self.points.iter().map(|point| self.loss.cost_of(residual(self.model, pose, point), self.sigma_px)).sum()
    }

    fn linearize(&self, pose: &RigidTransform) -> Self::Equations {
        let mut equations = NormalEquations::zeros(Const);
        let rotation = pose.rotation_matrix();
        for point in self.points {
            let in_camera = pose.transform(&point.point_in_world_m);
            let Some((uv_px, by_point)) = self.model.project_with_jacobian(&in_camera) else { continue };
            let residual = (uv_px - point.uv_px) / self.sigma_px;
            let weight = self.loss.cost_and_weight(residual.norm_squared()).1;
            let rows = by_pose(&by_point, &rotation, point) / self.sigma_px;
            equations.add(&residual, &rows, weight);
        }
        equations
    }

    fn plus(&self, pose: &RigidTransform, step: &Vector6<f64>) -> RigidTransform {
        pose.plus(step)
    }
}
