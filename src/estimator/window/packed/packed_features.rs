//! Features of the window whose observations are references to the inputs of earlier steps.

use crate::estimator::step_input::StepMeasurements;
use crate::estimator::window::features::{Feature, FeatureMap, FeatureObservation};
use crate::frontend::FeatureId;
use crate::optimization::Landmark;

#[derive(Clone, Debug)]
pub(crate) struct PackedFeatures {
    features: Vec<PackedFeature>,
    /// Twice the slot of each observation, plus one if it is copied.
    observations: Vec<u16>,
    /// Copied observations: those missing in the step of their frame.
    own: Vec<FeatureObservation>,
}

#[derive(Clone, Debug)]
struct PackedFeature {
    id: FeatureId,
    landmark: Option<Landmark>,
    count: u32,
}

impl PackedFeatures {
    /// `steps` are the steps of the window's frames, by slot.
    pub(crate) fn new(features: &FeatureMap, steps: &[Option<&dyn StepMeasurements>], camera: usize) -> Self {
        let count = features.values().map(|feature| feature.observations.len()).sum();
        let mut packed = Self {
            features: Vec::with_capacity(features.len()),
            observations: Vec::with_capacity(count),
            own: Vec::new(),
        };
        for (id, feature) in features {
            for observation in &feature.observations {
                let copied = observation_of(steps, observation.slot, camera, *id) != Some(*observation);
                packed.observations.push(2 * observation.slot as u16 + u16::from(copied));
                packed.own.extend(copied.then_some(*observation));
            }
            let count = feature.observations.len() as u32;
            packed.features.push(PackedFeature { id: *id, landmark: feature.landmark, count });
        }
        packed
    }

    pub(crate) fn unpacked(&self, steps: &[Option<&dyn StepMeasurements>], camera: usize) -> FeatureMap {
        let (mut observations, mut own) = (self.observations.iter(), self.own.iter());
        let mut feature = |packed: &PackedFeature| {
            let observation = |place: &u16| match place % 2 {
                0 => observation_of(steps, usize::from(place / 2), camera, packed.id),
                _ => own.next().copied(),
            };
            let observations = observations.by_ref().take(packed.count as usize).filter_map(observation).collect();
            (packed.id, Feature { observations, landmark: packed.landmark })
        };
        self.features.iter().map(&mut feature).collect()
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.features.capacity() * size_of::<PackedFeature>()
            + self.observations.capacity() * size_of::<u16>()
            + self.own.capacity() * size_of::<FeatureObservation>()
    }
}

/// Observation of a feature in the step of the frame at `slot`, `None` without one.
fn observation_of(
    steps: &[Option<&dyn StepMeasurements>],
    slot: usize,
    camera: usize,
    id: FeatureId,
) -> Option<FeatureObservation> {
    let features = (*steps.get(slot)?)?.features(camera);
    let place = features.binary_search_by_key(&id, |feature| feature.id).ok()?;
    let feature = &features[place];
    Some(FeatureObservation { slot, uv_px: feature.uv_px, bearing: feature.bearing })
}
