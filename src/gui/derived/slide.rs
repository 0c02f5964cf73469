//! The selected run's chain moved along a direction, computed once for all panels.

use std::sync::Arc;

use crate::observability::{ChainSlide, SlidePosition, chain_of_step, slide};
use crate::session::{Recording, RunRecord, StepRecord};

/// The last result and its inputs.
#[derive(Clone, Debug, Default)]
pub(crate) struct MovedChain {
    answered: Option<(SlidePosition, Arc<StepRecord>)>,
    /// Id of the run.
    run: Option<u64>,
    slide: Option<Arc<ChainSlide>>,
}

impl PartialEq for MovedChain {
    /// Always equal: the value follows from the rest of the selection, the recording and the cursor.
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

impl MovedChain {
    /// Computes the moved chain of a run's step when position, run or step has changed.
    pub(in crate::gui) fn update(
        &mut self,
        recording: &Recording,
        step: Option<(&RunRecord, &Arc<StepRecord>)>,
        position: Option<&SlidePosition>,
    ) {
        let (Some(position), Some((run, step))) = (position, step) else {
            *self = Self::default();
            return;
        };
        if self.answered.as_ref().is_some_and(|(known, of)| known == position && Arc::ptr_eq(of, step)) {
            return;
        }
        let slide = moved(recording, run, step, position);
        let answered = Some((*position, Arc::clone(step)));
        *self = Self { answered, run: Some(run.id), slide: slide.map(Arc::new) };
    }

    /// The moved chain if it belongs to the step of this run with this stamp; other runs have steps at equal stamps.
    pub(in crate::gui) fn at(&self, run: &RunRecord, stamp_ns: i64) -> Option<&Arc<ChainSlide>> {
        self.slide.as_ref().filter(|slide| self.run == Some(run.id) && slide.stamp_ns == stamp_ns)
    }
}

fn moved(recording: &Recording, run: &RunRecord, step: &StepRecord, position: &SlidePosition) -> Option<ChainSlide> {
    let rank = step.rank.as_ref()?;
    let chain = chain_of_step(&step.report, rank)?;
    let weights = position.direction.weights(rank, &chain)?;
    let camera = recording.rig.camera(&run.camera_key).ok()?;
    slide(&step.report, &camera.model, &chain, &weights, position.amount)
}
