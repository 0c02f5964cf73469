//! Features that take part in a solve.

use super::features::{FeatureMap, FeatureObservation};
use crate::estimator::state::track::{Track, TrackObservation};
use crate::frontend::FeatureId;
use crate::optimization::Landmark;

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
            if feature.observations.len() < 2 {
                continue;
            }
            let track_observation = |observation: &FeatureObservation| TrackObservation {
                slot: observation.slot,
                uv_px: observation.uv_px,
            };
            active.ids.push(*id);
            active.tracks.push(Track { observations: feature.observations.iter().map(track_observation).collect() });
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
