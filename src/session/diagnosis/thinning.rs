//! Fewer features for trials: a cause changes the residuals of all of them, and a trial takes time for each.

use std::sync::Arc;

use crate::frontend::FeatureId;
use crate::geometry::SplitMix64;
use crate::session::engine::{InputImage, OwnedStepInput, RunEngine};

/// Mean number of features in an image of a trial.
const FEATURES: f64 = 150.0;

/// Choice of the features that trials use, the same for all steps of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Thinning {
    /// Ratio of the features that are kept.
    ratio: f64,
}

impl Thinning {
    /// Keeps a mean of [`FEATURES`] features per image of these inputs; all if there are no more.
    pub(super) fn of(inputs: &[Arc<OwnedStepInput>]) -> Self {
        let images = inputs.iter().flat_map(|input| &input.images).filter(|image| !image.tracks.features.is_empty());
        let (count, sum) =
            images.fold((0_usize, 0_usize), |(count, sum), image| (count + 1, sum + image.tracks.features.len()));
        Self { ratio: (FEATURES * count as f64 / sum.max(1) as f64).min(1.0) }
    }

    fn keeps(self, id: FeatureId) -> bool {
        SplitMix64::new(id.0).next_unit() < self.ratio
    }

    /// The input of a step without the features that are left out.
    pub(super) fn input(self, input: &Arc<OwnedStepInput>) -> Arc<OwnedStepInput> {
        if self.ratio >= 1.0 {
            return Arc::clone(input);
        }
        let thinned = |image: &InputImage| {
            let mut tracks = (*image.tracks).clone();
            tracks.features.retain(|feature| self.keeps(feature.id));
            tracks.matched.retain(|feature| self.keeps(feature.id));
            tracks.statistics.tracked = tracks.features.iter().filter(|feature| feature.age > 0).count();
            InputImage { tracks: Arc::new(tracks), ..image.clone() }
        };
        let images = input.images.iter().map(thinned).collect();
        Arc::new(OwnedStepInput { images, ..(**input).clone() })
    }

    /// Removes the features that are left out from the window of an engine.
    pub(super) fn apply(self, engine: &mut RunEngine) {
        if self.ratio < 1.0 {
            for camera in 0..engine.cameras() {
                engine.estimator_mut().drop_features(camera, |id| !self.keeps(id));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::engine::input_of;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    #[test]
    fn features_are_kept_over_their_whole_track() {
        let flight = synthetic_tracks(&SyntheticOptions { duration_s: 1.0, ..SyntheticOptions::default() });
        let inputs: Vec<Arc<OwnedStepInput>> =
            flight.frames.iter().map(|frame| Arc::new(input_of(frame, None))).collect();
        let features = |input: &OwnedStepInput| -> Vec<FeatureId> {
            input.main_tracks().features.iter().map(|feature| feature.id).collect()
        };
        assert_eq!(Thinning { ratio: 1.0 }.input(&inputs[3]), inputs[3]);
        let half = Thinning { ratio: 0.5 };
        let (mut all, mut kept) = (0_usize, 0_usize);
        for input in &inputs {
            let expected: Vec<FeatureId> = features(input).into_iter().filter(|id| half.keeps(*id)).collect();
            all += features(input).len();
            kept += expected.len();
            assert_eq!(features(&half.input(input)), expected);
        }
        let ratio = kept as f64 / all as f64;
        assert!((ratio - 0.5).abs() < 0.12, "{ratio}");
        let mean = all as f64 / inputs.len() as f64;
        assert_eq!(Thinning::of(&inputs).ratio, (FEATURES / mean).min(1.0));
    }
}
