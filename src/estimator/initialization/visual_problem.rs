//! Reprojection of anchored features in a handful of views: cost, normal equations, depths eliminated.
//!
//! A feature has a direction in its anchor view and an inverse distance (1/m, or 1/baseline before the scale is known);
//! the residual is the angle error in the tangent plane of each measured bearing, divided by its standard deviation.
//! The anchor's bearing is a measurement like the others: taking it as exact would make views that anchor many features
//! look several times better known than they are, and with them the gyroscope's bias.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix2x6, Matrix3, Matrix6, Matrix6x3, Vector2, Vector3, Vector6};

use super::bearing::huber_weight;
use crate::frontend::FeatureId;
use crate::geometry::{RigidTransform, so3, tangent_basis};

/// Huber's threshold in standard deviations.
pub(super) const HUBER_SIGMAS: f64 = 1.5;
/// What a point behind a camera costs, in standard deviations.
const BEHIND_SIGMAS: f64 = 100.0;

/// One further observation of a feature.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sighting {
    /// Number of the view.
    pub(super) view: usize,
    /// Measured unit bearing there.
    pub(super) bearing: Vector3<f64>,
    basis: Matrix2x3<f64>,
}

impl Sighting {
    pub(super) fn new(view: usize, bearing: Vector3<f64>) -> Self {
        Self { view, bearing, basis: tangent_basis(&bearing).transpose() }
    }
}

/// A feature with its depth.
#[derive(Clone, Debug)]
pub(super) struct Landmark {
    pub(super) id: FeatureId,
    /// First view that saw it.
    pub(super) anchor: usize,
    /// Estimated direction there, unit length.
    pub(super) direction: Vector3<f64>,
    /// Inverse of the distance along `direction`.
    pub(super) inverse_distance: f64,
    /// All observations, the anchor's first.
    pub(super) sightings: Vec<Sighting>,
}

impl Landmark {
    /// A feature along the bearing of its first observation.
    pub(super) fn new(id: FeatureId, inverse_distance: f64, sightings: Vec<Sighting>) -> Option<Self> {
        let first = sightings.first()?;
        Some(Self { id, anchor: first.view, direction: first.bearing, inverse_distance, sightings })
    }

    /// Moved by `[α (2, in the tangent plane of the direction); inverse distance]`.
    fn plus(&mut self, step: &Vector3<f64>) {
        let shift = tangent_basis(&self.direction) * step.fixed_rows::<2>(0);
        self.direction = (self.direction + shift).normalize();
        self.inverse_distance += step.z;
    }

    /// Where it is, `None` when its distance is not positive.
    pub(super) fn position(&self, world_from_camera: &[RigidTransform]) -> Option<Vector3<f64>> {
        let pose = world_from_camera.get(self.anchor)?;
        (self.inverse_distance > 0.0).then(|| pose.transform(&(self.direction / self.inverse_distance)))
    }

    /// Whitened residual in one observation, `None` when the point lies behind that camera.
    fn residual(
        &self,
        world_from_camera: &[RigidTransform],
        sighting: &Sighting,
        sigma_rad: f64,
    ) -> Option<Vector2<f64>> {
        let anchor = world_from_camera.get(self.anchor)?;
        let other = world_from_camera.get(sighting.view)?;
        let ray =
            anchor.rotation * self.direction + (anchor.translation_m - other.translation_m) * self.inverse_distance;
        let in_other = other.rotation.inverse_transform_vector(&ray);
        let length = in_other.norm();
        (in_other.dot(&sighting.bearing) > 1e-3 * length).then(|| sighting.basis * in_other / (length * sigma_rad))
    }

    /// Largest whitened residual over all observations.
    pub(super) fn worst_ratio(&self, world_from_camera: &[RigidTransform], sigma_rad: f64) -> f64 {
        self.sightings
            .iter()
            .map(|sighting| self.residual(world_from_camera, sighting, sigma_rad).map_or(BEHIND_SIGMAS, |r| r.norm()))
            .fold(0.0, f64::max)
    }
}

/// Robust cost of all observations.
pub(super) fn visual_cost(landmarks: &[Landmark], world_from_camera: &[RigidTransform], sigma_rad: f64) -> f64 {
    let mut cost = 0.0;
    for landmark in landmarks {
        for sighting in &landmark.sightings {
            let ratio = landmark
                .residual(world_from_camera, sighting, sigma_rad)
                .map_or(BEHIND_SIGMAS, |residual| residual.norm());
            cost += huber_cost(ratio);
        }
    }
    cost
}

fn huber_cost(ratio: f64) -> f64 {
    if ratio <= HUBER_SIGMAS { ratio * ratio } else { 2.0 * HUBER_SIGMAS * ratio - HUBER_SIGMAS * HUBER_SIGMAS }
}

/// Mean square whitened residual per coordinate over all observations, and how many coordinates there are.
pub(super) fn mean_square(
    landmarks: &[Landmark],
    world_from_camera: &[RigidTransform],
    sigma_rad: f64,
) -> (f64, usize) {
    let (mut sum, mut count) = (0.0, 0);
    for landmark in landmarks {
        for sighting in &landmark.sightings {
            if let Some(residual) = landmark.residual(world_from_camera, sighting, sigma_rad) {
                sum += residual.norm_squared();
                count += 2;
            }
        }
    }
    (sum / count.max(1) as f64, count)
}

/// The normal equations over the camera poses (6 per view, `[φ; δt]`), the landmarks eliminated.
pub(super) struct VisualNormal {
    /// 6K × 6K, symmetric.
    pub(super) hessian: DMatrix<f64>,
    /// Gradient `Jᵀ r`, 6K.
    pub(super) gradient: DVector<f64>,
    eliminated: Vec<EliminatedLandmark>,
}

/// What is needed to find a landmark again once the poses have moved.
struct EliminatedLandmark {
    inverse_curvature: Matrix3<f64>,
    gradient: Vector3<f64>,
    coupling: Vec<(usize, Matrix6x3<f64>)>,
}

impl VisualNormal {
    /// Linearizes all observations; `damping` is added relatively to each landmark's own curvature.
    pub(super) fn new(
        landmarks: &[Landmark],
        world_from_camera: &[RigidTransform],
        sigma_rad: f64,
        damping: f64,
    ) -> Self {
        let columns = 6 * world_from_camera.len();
        let mut normal = Self {
            hessian: DMatrix::zeros(columns, columns),
            gradient: DVector::zeros(columns),
            eliminated: Vec::new(),
        };
        for landmark in landmarks {
            let eliminated = normal.add(landmark, world_from_camera, sigma_rad, damping);
            normal.eliminated.push(eliminated);
        }
        normal.hessian.fill_lower_triangle_with_upper_triangle();
        normal
    }

    /// Adds one feature to the upper triangle.
    fn add(
        &mut self,
        landmark: &Landmark,
        world_from_camera: &[RigidTransform],
        sigma_rad: f64,
        damping: f64,
    ) -> EliminatedLandmark {
        let anchor = &world_from_camera[landmark.anchor];
        let tangent = tangent_basis(&landmark.direction).transpose();
        let (mut curvature, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
        let mut anchor_hessian = Matrix6::zeros();
        let mut anchor_gradient = Vector6::zeros();
        let mut anchor_coupling = Matrix6x3::zeros();
        let mut coupling = Vec::with_capacity(landmark.sightings.len());
        for sighting in &landmark.sightings {
            let at_anchor = sighting.view == landmark.anchor;
            let linear = if at_anchor {
                Some(linearize_anchor(landmark, sighting, &tangent, sigma_rad))
            } else {
                linearize(landmark, sighting, &tangent, anchor, &world_from_camera[sighting.view], sigma_rad)
            };
            let Some(linear) = linear else { continue };
            let weight = huber_weight(linear.residual.norm(), HUBER_SIGMAS);
            let weighted_landmark = linear.by_landmark.transpose() * weight;
            curvature += weighted_landmark * linear.by_landmark;
            gradient += weighted_landmark * linear.residual;
            if at_anchor {
                continue;
            }
            let weighted_anchor = linear.by_anchor.transpose() * weight;
            let weighted_view = linear.by_view.transpose() * weight;
            anchor_hessian += weighted_anchor * linear.by_anchor;
            anchor_gradient += weighted_anchor * linear.residual;
            anchor_coupling += weighted_anchor * linear.by_landmark;
            self.add_block(sighting.view, sighting.view, &(weighted_view * linear.by_view));
            self.add_block(landmark.anchor, sighting.view, &(weighted_anchor * linear.by_view));
            self.add_gradient(sighting.view, &(weighted_view * linear.residual));
            coupling.push((sighting.view, weighted_view * linear.by_landmark));
        }
        self.add_block(landmark.anchor, landmark.anchor, &anchor_hessian);
        self.add_gradient(landmark.anchor, &anchor_gradient);
        coupling.push((landmark.anchor, anchor_coupling));
        coupling.sort_by_key(|(view, _)| *view);
        for index in 0..3 {
            curvature[(index, index)] = curvature[(index, index)] * (1.0 + damping) + 1e-9;
        }
        // The curvature is a sum of squares with a positive diagonal added.
        let inverse_curvature = curvature.cholesky().map_or_else(Matrix3::zeros, |factor| factor.inverse());
        for (index, (view_a, a)) in coupling.iter().enumerate() {
            let eliminated = a * inverse_curvature;
            self.add_gradient(*view_a, &-(eliminated * gradient));
            for (view_b, b) in &coupling[index..] {
                let mut target = self.hessian.fixed_view_mut::<6, 6>(6 * view_a, 6 * view_b);
                target -= eliminated * b.transpose();
            }
        }
        EliminatedLandmark { inverse_curvature, gradient, coupling }
    }

    fn add_block(&mut self, row: usize, col: usize, block: &Matrix6<f64>) {
        if row <= col {
            let mut target = self.hessian.fixed_view_mut::<6, 6>(6 * row, 6 * col);
            target += block;
        } else {
            let mut target = self.hessian.fixed_view_mut::<6, 6>(6 * col, 6 * row);
            target += block.transpose();
        }
    }

    fn add_gradient(&mut self, view: usize, part: &Vector6<f64>) {
        let mut target = self.gradient.fixed_rows_mut::<6>(6 * view);
        target += part;
    }

    /// The landmarks after the poses moved by `step` (6K, zeros where a view is fixed).
    pub(super) fn moved_landmarks(&self, landmarks: &[Landmark], step: &DVector<f64>) -> Vec<Landmark> {
        let mut moved = landmarks.to_vec();
        for (landmark, eliminated) in moved.iter_mut().zip(&self.eliminated) {
            let mut gradient = eliminated.gradient;
            for (view, coupling) in &eliminated.coupling {
                gradient += coupling.tr_mul(&step.fixed_rows::<6>(6 * view));
            }
            landmark.plus(&-(eliminated.inverse_curvature * gradient));
        }
        moved
    }
}

/// One observation's whitened residual and derivatives; a landmark moves by two angles and its inverse distance.
struct LinearSighting {
    residual: Vector2<f64>,
    by_anchor: Matrix2x6<f64>,
    by_view: Matrix2x6<f64>,
    by_landmark: Matrix2x3<f64>,
}

/// In the anchor itself only the direction counts.
fn linearize_anchor(
    landmark: &Landmark,
    sighting: &Sighting,
    tangent: &Matrix2x3<f64>,
    sigma_rad: f64,
) -> LinearSighting {
    let mut by_landmark = Matrix2x3::zeros();
    by_landmark.fixed_view_mut::<2, 2>(0, 0).copy_from(&(sighting.basis * tangent.transpose() / sigma_rad));
    LinearSighting {
        residual: sighting.basis * landmark.direction / sigma_rad,
        by_anchor: Matrix2x6::zeros(),
        by_view: Matrix2x6::zeros(),
        by_landmark,
    }
}

/// `None` when the point lies behind the camera.
fn linearize(
    landmark: &Landmark,
    sighting: &Sighting,
    tangent: &Matrix2x3<f64>,
    anchor: &RigidTransform,
    view: &RigidTransform,
    sigma_rad: f64,
) -> Option<LinearSighting> {
    let back = view.rotation_matrix().transpose();
    let view_from_anchor = back * anchor.rotation_matrix();
    let baseline = back * (anchor.translation_m - view.translation_m);
    let in_view = view_from_anchor * landmark.direction + baseline * landmark.inverse_distance;
    let length = in_view.norm();
    if in_view.dot(&sighting.bearing) <= 1e-3 * length {
        return None;
    }
    let seen = in_view / length;
    let by_ray: Matrix2x3<f64> =
        sighting.basis * (Matrix3::identity() - seen * seen.transpose()) / (length * sigma_rad);
    let by_shift = by_ray * back * landmark.inverse_distance;
    let by_turned = by_ray * view_from_anchor;
    let mut by_anchor = Matrix2x6::zeros();
    by_anchor.fixed_view_mut::<2, 3>(0, 0).copy_from(&(-by_turned * so3::hat(&landmark.direction)));
    by_anchor.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_shift);
    let mut by_view = Matrix2x6::zeros();
    by_view.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_ray * so3::hat(&in_view)));
    by_view.fixed_view_mut::<2, 3>(0, 3).copy_from(&-by_shift);
    let mut by_landmark = Matrix2x3::zeros();
    by_landmark.fixed_view_mut::<2, 2>(0, 0).copy_from(&(by_turned * tangent.transpose()));
    by_landmark.fixed_view_mut::<2, 1>(0, 2).copy_from(&(by_ray * baseline));
    Some(LinearSighting { residual: sighting.basis * seen / sigma_rad, by_anchor, by_view, by_landmark })
}
