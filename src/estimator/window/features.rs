//! Features of the window: observations, anchors, triangulation, and those that take part in a solve.

use std::collections::BTreeMap;

use crate::estimator::config::EstimatorOptions;
use crate::estimator::state::camera_view::{CameraView, Track, TrackObservation};
use crate::frontend::{FeatureId, ObservedPixel, TrackedFeature};
use crate::optimization::{self, CameraPose, Landmark, LandmarkModel, Ray, TriangulationOptions};

#[derive(Clone, Debug, Default)]
pub(crate) struct Feature {
    /// By ascending slot; the first observation is the anchor's.
    pub(crate) observations: Vec<ObservedPixel<usize>>,
    /// Observations by the other camera of a stereo pair, by ascending slot; each beside one of the camera itself.
    pub(crate) matched: Vec<ObservedPixel<usize>>,
    /// Landmark in the anchor's camera, `None` until triangulated.
    pub(crate) landmark: Option<Landmark>,
}

impl Feature {
    fn track(&self) -> Track {
        let seen = |matched: bool| {
            move |seen: &ObservedPixel<usize>| TrackObservation { slot: seen.view, matched, uv_px: seen.uv_px }
        };
        let mut observations: Vec<TrackObservation> = self.observations.iter().map(seen(false)).collect();
        if !self.matched.is_empty() {
            observations.extend(self.matched.iter().map(seen(true)));
            observations.sort_by_key(|observation| (observation.slot, observation.matched));
        }
        Track { observations }
    }

    pub(crate) fn observation(&self, slot: usize) -> Option<&ObservedPixel<usize>> {
        self.observations.iter().find(|observation| observation.view == slot)
    }
}

pub(crate) type FeatureMap = BTreeMap<FeatureId, Feature>;

/// Adds the features observed in a frame to the features of the camera; skips non-finite ones. `matched` are those that the
/// other camera of a pair observes as well.
pub(crate) fn observe(features: &mut FeatureMap, slot: usize, seen: &[TrackedFeature], matched: &[TrackedFeature]) {
    for tracked in seen {
        if let Some(observation) = tracked.seen_in(slot) {
            features.entry(tracked.id).or_default().observations.push(observation);
        }
    }
    for tracked in matched {
        let feature = features.get_mut(&tracked.id).filter(|feature| feature.observation(slot).is_some());
        if let (Some(feature), Some(observation)) = (feature, tracked.seen_in(slot)) {
            feature.matched.push(observation);
        }
    }
}

/// Removes a frame: drops its observations, renumbers later slots, and moves landmarks anchored in it to
/// the next observing frame. `view` has the poses before the removal.
pub(crate) fn drop_frame(features: &mut FeatureMap, gone: usize, view: &CameraView<'_>) {
    for feature in features.values_mut() {
        let anchor = feature.observations.first().filter(|first| first.view == gone).map(|first| first.uv_px);
        feature.observations.retain(|observation| observation.view != gone);
        feature.matched.retain(|observation| observation.view != gone);
        if let Some(uv_px) = anchor {
            feature.landmark = feature.observations.first().and_then(|next| {
                let (from, to) = (view.pose(gone, &uv_px), view.pose(next.view, &next.uv_px));
                moved(feature.landmark.as_ref()?, &from, &to)
            });
        }
        for observation in feature.observations.iter_mut().chain(&mut feature.matched) {
            if observation.view > gone {
                observation.view -= 1;
            }
        }
    }
    features.retain(|_, feature| !feature.observations.is_empty());
}

/// Transforms a landmark to another camera; `None` when it lies in the centre of that camera:
///
/// ```text
/// d = R_WCi b + λ (p_Ci − p_Cj)    b' = R_WCjᵀ d / |d|    λ' = λ / |d|
/// ```
fn moved(landmark: &Landmark, from: &CameraPose, to: &CameraPose) -> Option<Landmark> {
    let direction_in_world =
        from.rotation * landmark.bearing + (from.position_m - to.position_m) * landmark.inverse_distance;
    let length = direction_in_world.norm();
    (length > 1e-6).then(|| Landmark {
        bearing: to.rotation.transpose() * direction_in_world / length,
        inverse_distance: landmark.inverse_distance / length,
    })
}

/// Triangulates a feature from all its observations. `None` with too few of them, or when the parallax is too small or
/// the point out of range or behind a camera.
pub(crate) fn triangulate(feature: &Feature, view: &CameraView<'_>, options: &EstimatorOptions) -> Option<Landmark> {
    let anchor = feature.observations.first()?;
    // A stereo pair determines the distance in one frame.
    if feature.matched.is_empty() && feature.observations.len() < options.min_observations {
        return None;
    }
    let ray = |view: &CameraView<'_>, observation: &ObservedPixel<usize>| {
        let pose = view.pose(observation.view, &observation.uv_px);
        let direction = pose.rotation * view.bearing(&observation.uv_px, &observation.bearing);
        Ray { centre: pose.position_m, direction }
    };
    let own = feature.observations.iter().map(|observation| ray(view, observation));
    let partner = view.partner().into_iter();
    let matched = partner.flat_map(|view| feature.matched.iter().map(move |observation| ray(view, observation)));
    let rays: Vec<Ray> = own.chain(matched).collect();
    let limits = TriangulationOptions::of_anchored(options.min_triangulation_angle_rad);
    let point = optimization::triangulate(&rays, &limits)?;
    let camera = view.pose(anchor.view, &anchor.uv_px);
    let in_anchor = camera.rotation.transpose() * (point - camera.position_m);
    let distance = in_anchor.norm();
    let (nearest, farthest) = options.distance_range_m;
    (distance >= nearest && distance <= farthest).then(|| {
        let bearing = match options.landmark_model {
            LandmarkModel::InverseDistance => view.bearing(&anchor.uv_px, &anchor.bearing),
            LandmarkModel::BearingAndInverseDistance => in_anchor / distance,
        };
        Landmark { bearing, inverse_distance: 1.0 / distance }
    })
}

/// Mean rotation-compensated parallax between two frames, in radians, and the number of common features.
pub(crate) fn compensated_parallax(
    features: &FeatureMap,
    view: &CameraView<'_>,
    from: usize,
    to: usize,
) -> (f64, usize) {
    let in_world = |observation: &ObservedPixel<usize>| {
        view.pose(observation.view, &observation.uv_px).rotation
            * view.bearing(&observation.uv_px, &observation.bearing)
    };
    let to_from_from = view.first_row(to).rotation.transpose() * view.first_row(from).rotation;
    let angles: Vec<f64> = features
        .values()
        .filter_map(|feature| {
            let (first, second) = (feature.observation(from)?, feature.observation(to)?);
            let (first, second) = if view.has_nominal_bearings() {
                (to_from_from * first.bearing, second.bearing)
            } else {
                (in_world(first), in_world(second))
            };
            Some(first.cross(&second).norm().atan2(first.dot(&second)))
        })
        .collect();
    let mean = if angles.is_empty() { 0.0 } else { angles.iter().sum::<f64>() / angles.len() as f64 };
    (mean, angles.len())
}

/// Features of one camera that take part in a solve, ordered by id.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActiveTracks {
    pub(crate) ids: Vec<FeatureId>,
    pub(crate) tracks: Vec<Track>,
    pub(crate) landmarks: Vec<Landmark>,
}

impl ActiveTracks {
    /// Selects the triangulated features with at least two observations.
    pub(crate) fn new(features: &FeatureMap) -> Self {
        let mut active = Self::default();
        for (id, feature) in features {
            let Some(landmark) = feature.landmark else { continue };
            if feature.observations.len() + feature.matched.len() < 2 {
                continue;
            }
            active.ids.push(*id);
            active.tracks.push(feature.track());
            active.landmarks.push(landmark);
        }
        active
    }

    /// Keeps the features whose tracks satisfy `wanted`.
    pub(crate) fn filtered(self, wanted: impl Fn(&Track) -> bool) -> Self {
        let mut kept = Self::default();
        for ((id, track), landmark) in self.ids.into_iter().zip(self.tracks).zip(self.landmarks) {
            if wanted(&track) {
                kept.ids.push(id);
                kept.tracks.push(track);
                kept.landmarks.push(landmark);
            }
        }
        kept
    }
}
