//! The reprojection factors of one camera in a window: cost and normal equations over its poses.

use nalgebra::Vector2;

use crate::camera::CameraModel;
use crate::estimator::options::EstimatorOptions;
use crate::optimization::{
    CameraPose, DensePoseEquations, Landmark, LandmarkModel, ReducedEquations, RelativePoses, Reprojection,
    ReprojectionEquations, RobustLoss, reprojection,
};

/// An observation of a feature: slot of the frame and pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrackObservation {
    /// Slot of the frame in the window.
    pub(crate) slot: usize,
    /// Measured pixel.
    pub(crate) uv_px: Vector2<f64>,
}

/// Observations of one feature in the solve, the anchor's first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    /// In the order of the slots.
    pub(crate) observations: Vec<TrackObservation>,
}

/// Camera model, pixel noise and robust loss.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisualModel<'a> {
    pub(crate) camera: &'a CameraModel,
    pub(crate) sigma_px: f64,
    pub(crate) loss: RobustLoss,
    pub(crate) landmark_model: LandmarkModel,
}

impl<'a> VisualModel<'a> {
    pub(crate) fn new(camera: &'a CameraModel, options: &EstimatorOptions) -> Self {
        Self { camera, sigma_px: options.pixel_sigma_px, loss: options.loss, landmark_model: options.landmark_model }
    }

    /// Whether the anchor's own observation has a residual.
    fn measures_in_anchor(&self) -> bool {
        self.landmark_model == LandmarkModel::BearingAndInverseDistance
    }
}

/// Reprojection residual of one observation in pixels (2 × 1), `None` when the landmark does not project into
/// the camera.
pub(crate) fn observation_residual_px(
    model: &VisualModel<'_>,
    relative: &RelativePoses,
    anchor: usize,
    landmark: &Landmark,
    observation: &TrackObservation,
) -> Option<Vector2<f64>> {
    reprojection::residual(model.camera, relative.get(anchor, observation.slot), landmark, &observation.uv_px)
}

/// Robust cost (half the sum of losses) of all reprojection factors.
pub(crate) fn cost(model: &VisualModel<'_>, cameras: &[CameraPose], tracks: &[Track], landmarks: &[Landmark]) -> f64 {
    let relative = RelativePoses::new(cameras);
    let mut total = 0.0;
    for (track, landmark) in tracks.iter().zip(landmarks) {
        let Some(anchor) = track.observations.first().map(|first| first.slot) else { continue };
        for observation in &track.observations {
            if observation.slot == anchor && !model.measures_in_anchor() {
                continue;
            }
            let residual = observation_residual_px(model, &relative, anchor, landmark, observation);
            total += 0.5 * model.loss.cost_of(residual, model.sigma_px);
        }
    }
    total
}

/// Normal equations of the reprojection factors of one camera; poses are slots of the window.
pub(crate) type VisualEquations = ReprojectionEquations<DensePoseEquations>;

/// [`VisualEquations`] with the landmarks eliminated.
pub(crate) type ReducedVisualEquations = ReducedEquations<DensePoseEquations>;

/// Linearizes all observations at `current`, with the derivatives by poses taken at `linearized`.
pub(crate) fn equations(
    model: &VisualModel<'_>,
    current: &[CameraPose],
    linearized: &[CameraPose],
    tracks: &[Track],
    landmarks: &[Landmark],
) -> VisualEquations {
    let relative = RelativePoses::new(current);
    let linearized = RelativePoses::new(linearized);
    let mut equations = ReprojectionEquations::new(DensePoseEquations::new(current.len()), tracks.len());
    for (track, landmark) in tracks.iter().zip(landmarks) {
        // Observations come in the order of the slots and the anchor is the first of them.
        let anchor = track.observations.first().map(|first| first.slot);
        let terms = track.observations.iter().filter_map(|observation| {
            let term = whitened(model, &relative, &linearized, anchor?, landmark, observation, None)?;
            Some((observation.slot, term))
        });
        equations.add_landmark(anchor, track.observations.len(), terms);
    }
    equations
}

/// Linearizes one observation, divided by sigma and multiplied by the root of its robust weight: that of its
/// residual, unless given.
pub(crate) fn whitened(
    model: &VisualModel<'_>,
    relative: &RelativePoses,
    linearized: &RelativePoses,
    anchor: usize,
    landmark: &Landmark,
    observation: &TrackObservation,
    known_weight: Option<f64>,
) -> Option<Reprojection> {
    let term = if observation.slot == anchor {
        if !model.measures_in_anchor() {
            return None;
        }
        reprojection::linearize_in_anchor(model.camera, landmark, &observation.uv_px)?
    } else {
        reprojection::linearize(
            model.camera,
            relative.get(anchor, observation.slot),
            linearized.get(anchor, observation.slot),
            landmark,
            &observation.uv_px,
        )?
    };
    let mut term = match known_weight {
        Some(weight) => term.weighted(model.sigma_px, weight),
        None => term.whitened(model.sigma_px, model.loss),
    };
    if !model.measures_in_anchor() {
        term.by_landmark.fixed_view_mut::<2, 2>(0, 0).fill(0.0);
    }
    Some(term)
}
