//! Reprojection factors of the bundle over view poses, with landmarks eliminated.

use std::collections::BTreeMap;

use nalgebra::{Vector2, Vector3};

use super::landmark::AnchoredLandmark;
use super::state::ViewId;
use crate::camera::CameraModel;
use crate::optimization::{
    CameraPose, ReducedEquations, RelativePose, ReprojectionEquations, RobustLoss, SparsePoseEquations, reprojection,
};

/// An observation of a landmark in one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Observation {
    pub(super) view: ViewId,
    pub(super) uv_px: Vector2<f64>,
    /// Unit bearing in the camera.
    pub(super) bearing: Vector3<f64>,
}

/// All observations of one landmark, views ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Track {
    pub(super) observations: Vec<Observation>,
}

/// Pixel noise and camera models, indexed by [`super::state::Camera`].
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelModel<'a> {
    pub(super) cameras: [&'a CameraModel; 2],
    /// Standard deviation of a pixel coordinate of each camera.
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
        observation: &Observation,
    ) -> Option<Vector2<f64>> {
        let camera = self.cameras[Self::camera_index(observation.view)];
        let relative = RelativePose::new(&anchored.anchor, poses.get(&observation.view)?);
        reprojection::residual(camera, &relative, &anchored.landmark, &observation.uv_px)
    }

    /// Sum of the robust squared residuals of all observations, twice the cost.
    pub(super) fn cost(
        &self,
        poses: &BTreeMap<ViewId, CameraPose>,
        tracks: &[Track],
        landmarks: &[AnchoredLandmark],
    ) -> f64 {
        let mut cost = 0.0;
        for (track, landmark) in tracks.iter().zip(landmarks) {
            for observation in &track.observations {
                let sigma = self.sigma_px[Self::camera_index(observation.view)];
                cost += self.loss.cost_of(self.residual_px(poses, landmark, observation), sigma);
            }
        }
        cost
    }
}

/// Normal equations of all observations over the view poses.
pub(super) type VisualEquations = ReprojectionEquations<SparsePoseEquations<ViewId>>;

/// [`VisualEquations`] with the landmarks eliminated.
pub(super) type ReducedVisualEquations = ReducedEquations<SparsePoseEquations<ViewId>>;

/// Linearizes all observations.
pub(super) fn equations(
    model: &PixelModel<'_>,
    poses: &BTreeMap<ViewId, CameraPose>,
    tracks: &[Track],
    landmarks: &[AnchoredLandmark],
) -> VisualEquations {
    let mut equations = ReprojectionEquations::new(SparsePoseEquations::new(), tracks.len());
    for (track, anchored) in tracks.iter().zip(landmarks) {
        let terms = track.observations.iter().filter_map(|observation| {
            let relative = RelativePose::new(&anchored.anchor, poses.get(&observation.view)?);
            let camera_index = PixelModel::camera_index(observation.view);
            let camera = model.cameras[camera_index];
            let term = reprojection::linearize(camera, &relative, &relative, &anchored.landmark, &observation.uv_px)?;
            Some((observation.view, term.whitened(model.sigma_px[camera_index], model.loss)))
        });
        // Anchors are fixed: only observing views have columns.
        equations.add_landmark(None, track.observations.len(), terms);
    }
    equations
}
