//! Reprojection of anchored features in a few views: cost and normal equations over the camera poses.
//!
//! The residual is the angle error in the tangent plane of each measured bearing, divided by its standard deviation.
//! The anchor's bearing is a measurement like the others: treating it as exact would make views with many anchors, and
//! with them the gyroscope bias, several times overconfident.

use nalgebra::{Vector2, Vector3};

use crate::frontend::FeatureId;
use crate::geometry::RigidTransform;
use crate::optimization::reprojection::{self, TangentPlane};
use crate::optimization::{
    CameraPose, DensePoseEquations, Landmark, RelativePoses, Reprojection, ReprojectionEquations, RobustLoss,
};

const LOSS: RobustLoss = RobustLoss::Huber(1.5);
/// Residual of a point behind a camera, in standard deviations.
const BEHIND_SIGMAS: f64 = 100.0;

#[derive(Clone, Copy, Debug)]
pub(super) struct BearingObservation {
    pub(super) view: usize,
    /// Tangent plane of the measured bearing.
    plane: TangentPlane,
}

impl BearingObservation {
    pub(super) fn new(view: usize, bearing: Vector3<f64>) -> Self {
        Self { view, plane: TangentPlane::new(bearing) }
    }
}

#[derive(Clone, Debug)]
pub(super) struct TrackedLandmark {
    pub(super) id: FeatureId,
    /// First view that observes it.
    pub(super) anchor: usize,
    /// Landmark in the anchor's frame; the inverse distance is in 1/baseline before the scale is known.
    pub(super) landmark: Landmark,
    /// Observations; the anchor's comes first.
    pub(super) observations: Vec<BearingObservation>,
}

impl TrackedLandmark {
    /// Landmark along the bearing of its first observation; `None` without observations.
    pub(super) fn new(id: FeatureId, inverse_distance: f64, observations: Vec<BearingObservation>) -> Option<Self> {
        let first = observations.first()?;
        let landmark = Landmark { bearing: first.plane.bearing, inverse_distance };
        Some(Self { id, anchor: first.view, landmark, observations })
    }

    /// Position in the world, `None` when it is infinitely far.
    pub(super) fn position(&self, world_from_camera: &[RigidTransform]) -> Option<Vector3<f64>> {
        let pose = world_from_camera.get(self.anchor)?;
        (!self.landmark.is_infinitely_far()).then(|| pose.transform(&self.landmark.point_in_anchor()))
    }

    /// Residual of one observation in radians (2 × 1), `None` when the landmark lies behind that camera.
    fn residual_rad(&self, poses: &RelativePoses, observation: &BearingObservation) -> Option<Vector2<f64>> {
        let relative = poses.get(self.anchor, observation.view);
        reprojection::residual(&observation.plane, relative, &self.landmark, &Vector2::zeros())
    }

    /// [`Self::residual_rad`] with its Jacobians.
    fn linearize(&self, poses: &RelativePoses, observation: &BearingObservation) -> Option<Reprojection> {
        if observation.view == self.anchor {
            return reprojection::linearize_in_anchor(&observation.plane, &self.landmark, &Vector2::zeros());
        }
        let relative = poses.get(self.anchor, observation.view);
        reprojection::linearize(&observation.plane, relative, relative, &self.landmark, &Vector2::zeros())
    }

    /// True if the distance is finite and every residual is below `limit` standard deviations.
    pub(super) fn fits(&self, poses: &RelativePoses, sigma_rad: f64, limit: f64) -> bool {
        let ratio = |observation| self.residual_rad(poses, observation).map_or(BEHIND_SIGMAS, |r| r.norm() / sigma_rad);
        !self.landmark.is_infinitely_far() && self.observations.iter().all(|observation| ratio(observation) < limit)
    }
}

/// Relative poses of all views.
pub(super) fn between(world_from_camera: &[RigidTransform]) -> RelativePoses {
    let cameras: Vec<CameraPose> = world_from_camera.iter().map(|pose| (*pose).into()).collect();
    RelativePoses::new(&cameras)
}

/// Robust cost of all observations.
pub(super) fn visual_cost(landmarks: &[TrackedLandmark], world_from_camera: &[RigidTransform], sigma_rad: f64) -> f64 {
    let poses = between(world_from_camera);
    let mut cost = 0.0;
    for landmark in landmarks {
        for observation in &landmark.observations {
            cost += LOSS.cost_of(landmark.residual_rad(&poses, observation), sigma_rad);
        }
    }
    cost
}

/// Mean square of the whitened residuals of all observations, per coordinate.
pub(super) fn mean_square(landmarks: &[TrackedLandmark], world_from_camera: &[RigidTransform], sigma_rad: f64) -> f64 {
    let poses = between(world_from_camera);
    let (mut sum, mut count) = (0.0, 0_usize);
    for landmark in landmarks {
        for observation in &landmark.observations {
            if let Some(residual) = landmark.residual_rad(&poses, observation) {
                sum += residual.norm_squared() / (sigma_rad * sigma_rad);
                count += 2;
            }
        }
    }
    sum / count.max(1) as f64
}

/// Normal equations of all observations over the camera poses (6 per view, `[φ; δt]`) and the landmarks.
pub(super) fn visual_equations(
    landmarks: &[TrackedLandmark],
    world_from_camera: &[RigidTransform],
    sigma_rad: f64,
) -> ReprojectionEquations<DensePoseEquations> {
    let poses = between(world_from_camera);
    let mut equations = ReprojectionEquations::new(DensePoseEquations::new(world_from_camera.len()), landmarks.len());
    for landmark in landmarks {
        let terms = landmark.observations.iter().filter_map(|observation| {
            let term = landmark.linearize(&poses, observation)?;
            Some((observation.view, term.whitened(sigma_rad, LOSS)))
        });
        equations.add_landmark(Some(landmark.anchor), landmark.observations.len(), terms);
    }
    equations
}

/// Landmarks updated by their steps.
pub(super) fn moved(landmarks: &[TrackedLandmark], steps: &[Vector3<f64>]) -> Vec<TrackedLandmark> {
    let plus = |(tracked, step): (&TrackedLandmark, &Vector3<f64>)| TrackedLandmark {
        landmark: tracked.landmark.plus(step),
        ..tracked.clone()
    };
    landmarks.iter().zip(steps).map(plus).collect()
}
