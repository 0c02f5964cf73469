//! Reprojection factors of one camera in a window: cost and normal equations over its poses.
//!
//! ```text
//! r_C = Ψ(R_CjCi b + λ t_CjCi) − z    T_CjCi = (T_WIj T_IjCj)⁻¹ T_WIi T_IiCi    (Eqs. 9, 10)
//! ```
//!
//! with the landmark's bearing b and inverse distance λ in the anchor's camera i and its pixel z in camera j; the sign of
//! the residual is the opposite of that in Eq. 9.

use nalgebra::Vector2;

use crate::camera::CameraModel;
use crate::estimator::config::EstimatorOptions;
use crate::estimator::state::camera_view::{CameraView, ROLLING_BLOCKS, RelativeTo, Track, TrackObservation};
use crate::optimization::{
    BlockTerm, DensePoseEquations, Landmark, LandmarkModel, LossSum, ReducedEquations, ReprojectionEquations,
    RobustLoss, reprojection,
};

/// Number of observations that determine a landmark: three unknowns, two coordinates each.
const OBSERVATIONS_PER_LANDMARK: f64 = 1.5;

/// Camera model of the rig, pixel noise and robust loss.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisualModel<'a> {
    /// Rig's model; a [`CameraView`] has the model with estimated intrinsics.
    pub(crate) camera: &'a CameraModel,
    pub(crate) sigma_px: f64,
    /// Robust loss of each observation.
    pub(crate) loss: RobustLoss,
    /// Robust loss of each track as a whole: see [`Self::track_cost_and_weight`].
    pub(crate) track_loss: RobustLoss,
    pub(crate) landmark_model: LandmarkModel,
}

impl<'a> VisualModel<'a> {
    /// Model with the ratio of its noise to the noise of the options, and with the robust losses of observations and of
    /// tracks.
    pub(crate) fn new(
        camera: &'a CameraModel,
        options: &EstimatorOptions,
        noise: f64,
        [loss, track_loss]: [RobustLoss; 2],
    ) -> Self {
        let sigma_px = noise * options.pixel_sigma_px;
        Self { camera, sigma_px, loss, track_loss, landmark_model: options.landmark_model }
    }

    /// Robust cost of a track and the weight of all its observations, from the sum of their robust costs.
    ///
    /// The loss applies to the mean over the degrees of freedom: a feature that is no point of the scene, such as a
    /// corner where an outline crosses the background, slides with the viewpoint. Each of its residuals is moderate,
    /// but they do not average out, so the track loses weight as a whole.
    fn track_cost_and_weight(&self, sum: f64, observations: usize) -> (f64, f64) {
        let freedom = (observations as f64 - OBSERVATIONS_PER_LANDMARK).max(0.5);
        let (cost, weight) = self.track_loss.cost_and_weight(sum / freedom);
        (freedom * cost, weight)
    }

    /// Robust weights of a track's observations by their residuals in pixels, zero where there is none.
    pub(crate) fn robust_weights(&self, residuals_px: &[Option<Vector2<f64>>]) -> Vec<f64> {
        let squared = |residual: &Option<Vector2<f64>>| residual.map(|it| it.norm_squared() / self.sigma_px.powi(2));
        let sum = self.sum_of_costs(residuals_px.iter().copied());
        let (_, of_track) = self.track_cost_and_weight(sum, residuals_px.len());
        let weight = |squared: f64| of_track * self.loss.cost_and_weight(squared).1;
        residuals_px.iter().map(|residual| squared(residual).map_or(0.0, weight)).collect()
    }

    /// Sum of the robust costs of a track's observations.
    fn observation_costs(
        &self,
        view: &CameraView<'_>,
        anchor: &RelativeTo<'_>,
        landmark: &Landmark,
        track: &Track,
    ) -> f64 {
        let measured = &track.observations[usize::from(!self.measures_in_anchor())..];
        self.sum_of_costs(measured.iter().map(|seen| observation_residual_px(view, anchor, landmark, seen)))
    }

    /// Sum of the robust costs of residuals in pixels.
    fn sum_of_costs(&self, residuals_px: impl Iterator<Item = Option<Vector2<f64>>>) -> f64 {
        let mut sum = LossSum::new(self.loss, self.sigma_px);
        residuals_px.for_each(|residual| sum.add(residual));
        sum.get()
    }

    /// True if the anchor's own observation has a residual.
    fn measures_in_anchor(&self) -> bool {
        self.landmark_model == LandmarkModel::BearingAndInverseDistance
    }
}

/// Reprojection residual of one observation in pixels (2 × 1), `None` when the landmark does not project into
/// the camera.
pub(crate) fn observation_residual_px(
    view: &CameraView<'_>,
    anchor: &RelativeTo<'_>,
    landmark: &Landmark,
    observation: &TrackObservation,
) -> Option<Vector2<f64>> {
    reprojection::residual(view.observer(observation).model(), &anchor.get(observation), landmark, &observation.uv_px)
}

/// Robust cost (half the sum of losses) of all reprojection factors.
pub(crate) fn cost(model: &VisualModel<'_>, view: &CameraView<'_>, tracks: &[Track], landmarks: &[Landmark]) -> f64 {
    let mut total = 0.0;
    for (track, landmark) in tracks.iter().zip(landmarks) {
        let Some(first) = track.observations.first() else { continue };
        let sum = model.observation_costs(view, &view.relative_to(first), landmark, track);
        total += model.track_cost_and_weight(sum, track.observations.len()).0;
    }
    0.5 * total
}

/// Normal equations of the reprojection factors of one camera over the blocks of its [`CameraView`].
pub(crate) type VisualEquations = ReprojectionEquations<DensePoseEquations>;

/// [`VisualEquations`] with the landmarks eliminated.
pub(crate) type ReducedVisualEquations = ReducedEquations<DensePoseEquations>;

/// Reprojection factors of one camera, linearized at an estimate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisualFactors<'a> {
    pub(crate) model: &'a VisualModel<'a>,
    /// Estimate of the residuals.
    pub(crate) current: &'a CameraView<'a>,
    /// Poses by which the derivatives are taken.
    pub(crate) linearized: &'a CameraView<'a>,
    pub(crate) tracks: &'a [Track],
    pub(crate) landmarks: &'a [Landmark],
}

impl VisualFactors<'_> {
    pub(crate) fn equations(&self) -> VisualEquations {
        match self.current.blocks_per_image() {
            1 => self.equations_by_blocks::<1>(),
            _ => self.equations_by_blocks::<ROLLING_BLOCKS>(),
        }
    }

    /// [`Self::equations`] of a camera with `N` blocks per image.
    fn equations_by_blocks<const N: usize>(&self) -> VisualEquations {
        let current = self.current;
        let mut equations = ReprojectionEquations::new(DensePoseEquations::new(current.blocks()), self.tracks.len());
        for (track, landmark) in self.tracks.iter().zip(self.landmarks) {
            // Observations are in ascending order of the slots; the first one is the anchor's.
            let anchor = track.observations.first().map(|first| Anchor::new(current, self.linearized, first));
            let blocks = anchor.as_ref().map(|anchor| current.blocks_of::<N>(anchor.observation));
            let of_anchor = |anchor: &Anchor<'_>| anchor.weight(self.model, landmark, track);
            let weight = anchor.as_ref().map_or(RobustWeight::OfTrack(1.0), of_anchor);
            let terms = track
                .observations
                .iter()
                .filter_map(|observation| whitened(self.model, anchor.as_ref()?, landmark, observation, weight));
            let observations = track.observations.len() * current.blocks_per_image();
            equations.add_landmark_by_blocks(blocks, current.intrinsics_block(), observations, terms);
        }
        equations
    }
}

/// Anchor of a track at the current estimate and at the linearization point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Anchor<'a> {
    current: &'a CameraView<'a>,
    linearized: &'a CameraView<'a>,
    observation: &'a TrackObservation,
    to_current: RelativeTo<'a>,
    to_linearized: RelativeTo<'a>,
}

impl<'a> Anchor<'a> {
    pub(crate) fn new(
        current: &'a CameraView<'a>,
        linearized: &'a CameraView<'a>,
        observation: &'a TrackObservation,
    ) -> Self {
        let (to_current, to_linearized) = (current.relative_to(observation), linearized.relative_to(observation));
        Self { current, linearized, observation, to_current, to_linearized }
    }

    /// Weight of a track as a whole at the current estimate.
    pub(crate) fn weight(&self, model: &VisualModel<'_>, landmark: &Landmark, track: &Track) -> RobustWeight {
        if model.track_loss == RobustLoss::None {
            // No residuals are needed.
            return RobustWeight::OfTrack(1.0);
        }
        let sum = model.observation_costs(self.current, &self.to_current, landmark, track);
        RobustWeight::OfTrack(model.track_cost_and_weight(sum, track.observations.len()).1)
    }
}

/// Robust weight of an observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RobustWeight {
    /// Weight of the track as a whole, to be multiplied by the weight of the observation's residual.
    OfTrack(f64),
    /// Weight of the observation, from a report: the weight of its track times the weight of its residual.
    Known(f64),
}

/// Linearizes one observation by the `N` blocks per image, divided by sigma and multiplied by the root of its robust
/// weight.
#[inline]
pub(crate) fn whitened<const N: usize>(
    model: &VisualModel<'_>,
    anchor: &Anchor<'_>,
    landmark: &Landmark,
    observation: &TrackObservation,
    weight: RobustWeight,
) -> Option<BlockTerm<usize, N>> {
    let camera = anchor.current.observer(observation).model();
    let in_anchor = observation.slot == anchor.observation.slot && !observation.matched;
    let relative = anchor.to_current.get(observation);
    let (linearized, pose) = anchor.to_linearized.with_pose(observation);
    let term = if in_anchor {
        if !model.measures_in_anchor() {
            return None;
        }
        reprojection::linearize_in_anchor(camera, landmark, &observation.uv_px)?
    } else {
        reprojection::linearize(camera, &relative, &linearized, landmark, &observation.uv_px)?
    };
    let weight = match weight {
        RobustWeight::OfTrack(of_track) => of_track * term.robust_weight(model.sigma_px, model.loss),
        RobustWeight::Known(weight) => weight,
    };
    let mut term = term.weighted(model.sigma_px, weight);
    if !model.measures_in_anchor() {
        term.by_landmark.fixed_view_mut::<2, 2>(0, 0).fill(0.0);
    }
    let shared = match anchor.current.intrinsics_block() {
        None => None,
        Some(_) if observation.matched => None,
        Some(block) => {
            let direction = if in_anchor { landmark.bearing } else { relative.direction(landmark) };
            let (_, _, by_intrinsics) = camera.project_with_intrinsics_jacobian(&direction)?;
            Some((block, by_intrinsics * (weight.sqrt() / model.sigma_px)))
        }
    };
    let view = anchor.linearized;
    let (anchor, observer) = if in_anchor {
        (None, None)
    } else {
        (
            Some(view.by_blocks(anchor.observation, &anchor.to_linearized.pose, &term.by_anchor)),
            Some(view.by_blocks(observation, &pose, &term.by_observer)),
        )
    };
    Some(BlockTerm { residual: term.residual, by_landmark: term.by_landmark, anchor, observer, shared })
}
