//! Reprojection factors of the bundle over view poses, with landmarks eliminated.

use std::collections::BTreeMap;

use nalgebra::Vector2;
use rayon::prelude::*;

use super::state::{AnchoredLandmark, ViewId};
use crate::camera::CameraModel;
use crate::frontend::ObservedPixel;
use crate::optimization::{
    CameraPose, ReducedEquations, RelativePose, ReprojectionEquations, RobustLoss, SparsePoseEquations, reprojection,
};

/// Observations of one landmark, by ascending view.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct BundleTrack {
    pub(super) observations: Vec<ObservedPixel<ViewId>>,
}

/// Pixel noise and camera models, indexed by [`super::state::Camera`].
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelModel<'a> {
    pub(super) cameras: [&'a CameraModel; 2],
    /// Standard deviation of a pixel coordinate by camera.
    pub(super) sigma_px: [f64; 2],
    pub(super) loss: RobustLoss,
}

impl PixelModel<'_> {
    fn camera_index(view: ViewId) -> usize {
        view.0 % 2
    }

    /// Reprojection residual in pixels (2 × 1), `None` when the landmark does not project into the camera.
    pub(super) fn residual_px(
        &self,
        poses: &BTreeMap<ViewId, CameraPose>,
        anchored: &AnchoredLandmark,
        observation: &ObservedPixel<ViewId>,
    ) -> Option<Vector2<f64>> {
        let camera = self.cameras[Self::camera_index(observation.view)];
        let relative = RelativePose::new(&anchored.anchor, poses.get(&observation.view)?);
        reprojection::residual(camera, &relative, &anchored.landmark, &observation.uv_px)
    }

    /// Sum of the robust squared residuals of all observations (twice the cost).
    pub(super) fn cost(
        &self,
        poses: &BTreeMap<ViewId, CameraPose>,
        tracks: &[BundleTrack],
        landmarks: &[AnchoredLandmark],
    ) -> f64 {
        let costs = tracks.par_iter().zip(landmarks).map(|(track, landmark)| {
            let cost = |observation: &ObservedPixel<ViewId>| {
                let sigma = self.sigma_px[Self::camera_index(observation.view)];
                self.loss.cost_of(self.residual_px(poses, landmark, observation), sigma)
            };
            track.observations.iter().map(cost).collect::<Vec<f64>>()
        });
        // Summed in the order of the observations for any number of threads.
        costs.collect::<Vec<_>>().iter().flatten().fold(0.0, |sum, cost| sum + cost)
    }
}

/// Normal equations of all observations over the view poses.
pub(super) type VisualEquations = ReprojectionEquations<SparsePoseEquations<ViewId>>;

/// [`VisualEquations`] with the landmarks eliminated.
pub(super) type ReducedVisualEquations = ReducedEquations<SparsePoseEquations<ViewId>>;

pub(super) fn equations(
    model: &PixelModel<'_>,
    poses: &BTreeMap<ViewId, CameraPose>,
    tracks: &[BundleTrack],
    landmarks: &[AnchoredLandmark],
) -> VisualEquations {
    let mut equations = ReprojectionEquations::new(SparsePoseEquations::new(), tracks.len());
    let terms_of = |(track, anchored): (&BundleTrack, &AnchoredLandmark)| {
        let term = |observation: &ObservedPixel<ViewId>| {
            let relative = RelativePose::new(&anchored.anchor, poses.get(&observation.view)?);
            let camera_index = PixelModel::camera_index(observation.view);
            let camera = model.cameras[camera_index];
            let term = reprojection::linearize(camera, &relative, &relative, &anchored.landmark, &observation.uv_px)?;
            Some((observation.view, term.whitened(model.sigma_px[camera_index], model.loss)))
        };
        let mut terms = Vec::with_capacity(track.observations.len());
        terms.extend(track.observations.iter().filter_map(term));
        terms
    };
    let terms: Vec<_> = tracks.par_iter().zip(landmarks).map(terms_of).collect();
    for terms in terms {
        // Anchors are fixed: only observing views have columns.
        equations.add_landmark(None, terms.len(), terms.into_iter());
    }
    equations
}
