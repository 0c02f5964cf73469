//! The reprojection factors of the bundle by view poses, with the landmarks eliminated.

use std::collections::BTreeMap;

use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Matrix6, Matrix6x3, Vector2, Vector3, Vector6};

use super::landmark::{self, Landmark, ViewPose};
use super::state::ViewId;
use crate::camera::CameraModel;
use crate::optimization::{RobustLoss, damped_inverse};

/// Squared whitened residual of a sighting whose landmark lies behind the camera.
const UNSEEN_SQUARED: f64 = 1e4;

/// One measurement of a landmark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sighting {
    pub(super) view: ViewId,
    pub(super) uv_px: Vector2<f64>,
    /// Unit direction in the camera.
    pub(super) bearing: Vector3<f64>,
}

/// All sightings of one landmark, views rising.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Track {
    pub(super) sightings: Vec<Sighting>,
}

/// How pixels are weighed: camera models by [`super::state::Camera`], static one first.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelModel<'a> {
    pub(super) cameras: [&'a CameraModel; 2],
    /// Standard deviation of a pixel of each camera.
    pub(super) sigma_px: [f64; 2],
    pub(super) loss: RobustLoss,
}

impl PixelModel<'_> {
    fn which(view: ViewId) -> usize {
        view.0 % 2
    }

    /// Residual in pixels, `None` when the landmark cannot be seen.
    pub(super) fn residual_px(
        &self,
        poses: &BTreeMap<ViewId, ViewPose>,
        landmark: &Landmark,
        sighting: &Sighting,
    ) -> Option<Vector2<f64>> {
        let camera = self.cameras[Self::which(sighting.view)];
        landmark::residual_px(camera, poses.get(&sighting.view)?, landmark, &sighting.uv_px)
    }

    /// Robust cost of all sightings, twice the halved sum.
    pub(super) fn cost(&self, poses: &BTreeMap<ViewId, ViewPose>, tracks: &[Track], landmarks: &[Landmark]) -> f64 {
        let mut cost = 0.0;
        for (track, landmark) in tracks.iter().zip(landmarks) {
            for sighting in &track.sightings {
                let sigma = self.sigma_px[Self::which(sighting.view)];
                let squared = self
                    .residual_px(poses, landmark, sighting)
                    .map_or(UNSEEN_SQUARED, |residual| residual.norm_squared() / (sigma * sigma));
                cost += self.loss.cost_and_weight(squared).0;
            }
        }
        cost
    }
}

/// One landmark's part of the normal equations.
#[derive(Clone, Debug)]
struct LandmarkBlock {
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    couplings: Vec<(ViewId, Matrix6x3<f64>)>,
}

/// Normal equations: view poses on one side, landmarks on the other.
#[derive(Clone, Debug)]
pub(super) struct VisualEquations {
    views: BTreeMap<ViewId, (Matrix6<f64>, Vector6<f64>)>,
    landmarks: Vec<LandmarkBlock>,
}

/// The side of the view poses after the landmarks were eliminated; pairs `(first, second)` with `first ≤ second`.
#[derive(Clone, Debug, Default)]
pub(super) struct ReducedEquations {
    pub(super) hessian: BTreeMap<(ViewId, ViewId), Matrix6<f64>>,
    pub(super) gradient: BTreeMap<ViewId, Vector6<f64>>,
    inverses: Vec<Matrix3<f64>>,
}

impl VisualEquations {
    /// Linearizes all observations.
    pub(super) fn new(
        model: &PixelModel<'_>,
        poses: &BTreeMap<ViewId, ViewPose>,
        tracks: &[Track],
        landmarks: &[Landmark],
    ) -> Self {
        let mut equations = Self { views: BTreeMap::new(), landmarks: Vec::with_capacity(tracks.len()) };
        for (track, landmark) in tracks.iter().zip(landmarks) {
            let mut block =
                LandmarkBlock { hessian: Matrix3::zeros(), gradient: Vector3::zeros(), couplings: Vec::new() };
            for sighting in &track.sightings {
                let which = PixelModel::which(sighting.view);
                let Some(term) = poses
                    .get(&sighting.view)
                    .and_then(|pose| landmark::linearize(model.cameras[which], pose, landmark, &sighting.uv_px))
                else {
                    continue;
                };
                let sigma = model.sigma_px[which];
                let squared = term.residual_px.norm_squared() / (sigma * sigma);
                let scale = model.loss.cost_and_weight(squared).1.sqrt() / sigma;
                let residual: Vector2<f64> = term.residual_px * scale;
                let by_view: Matrix2x6<f64> = term.by_view * scale;
                let by_landmark: Matrix2x3<f64> = term.by_landmark * scale;
                block.hessian += by_landmark.tr_mul(&by_landmark);
                block.gradient += by_landmark.tr_mul(&residual);
                block.couplings.push((sighting.view, by_view.tr_mul(&by_landmark)));
                let (hessian, gradient) =
                    equations.views.entry(sighting.view).or_insert_with(|| (Matrix6::zeros(), Vector6::zeros()));
                *hessian += by_view.tr_mul(&by_view);
                *gradient += by_view.tr_mul(&residual);
            }
            equations.landmarks.push(block);
        }
        equations
    }

    /// Eliminates the landmarks, their diagonal raised by the factor `1 + damping`.
    pub(super) fn eliminate(&self, damping: f64) -> ReducedEquations {
        let mut reduced = ReducedEquations::default();
        for (view, (hessian, gradient)) in &self.views {
            reduced.hessian.insert((*view, *view), *hessian);
            reduced.gradient.insert(*view, *gradient);
        }
        let mut weighted: Vec<Matrix6x3<f64>> = Vec::new();
        for block in &self.landmarks {
            let inverse = damped_inverse(&block.hessian, damping);
            weighted.clear();
            weighted.extend(block.couplings.iter().map(|(_, coupling)| coupling * inverse));
            for (index, (view, _)) in block.couplings.iter().enumerate() {
                if let Some(gradient) = reduced.gradient.get_mut(view) {
                    *gradient -= weighted[index] * block.gradient;
                }
                for (other, coupling) in &block.couplings[index..] {
                    *reduced.hessian.entry((*view, *other)).or_insert_with(Matrix6::zeros) -=
                        weighted[index] * coupling.transpose();
                }
            }
            reduced.inverses.push(inverse);
        }
        reduced
    }

    /// Steps of the landmarks that belong to steps of the view poses.
    pub(super) fn substitute(
        &self,
        reduced: &ReducedEquations,
        view_steps: &BTreeMap<ViewId, Vector6<f64>>,
    ) -> Vec<Vector3<f64>> {
        self.landmarks
            .iter()
            .zip(&reduced.inverses)
            .map(|(block, inverse)| {
                let mut right = -block.gradient;
                for (view, coupling) in &block.couplings {
                    if let Some(step) = view_steps.get(view) {
                        right -= coupling.tr_mul(step);
                    }
                }
                inverse * right
            })
            .collect()
    }
}
