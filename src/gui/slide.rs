//! The selected run's chain moved along a direction, computed once for all panels.

use std::sync::Arc;

use super::PanelContext;
use crate::observability::{ChainSlide, SlidePosition, chain_of_step, slide};
use crate::session::{RunRecord, StepRecord};

/// The last result and its inputs.
#[derive(Clone, Debug, Default)]
pub(crate) struct MovedChain {
    answered: Option<(SlidePosition, Arc<StepRecord>)>,
    slide: Option<Arc<ChainSlide>>,
}

impl PartialEq for MovedChain {
    /// Always equal: the value follows from the rest of the selection, the recording and the cursor.
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

/// Computes the moved chain if position, run or step has changed.
pub(crate) fn update(ctx: &mut PanelContext<'_>) {
    let run = ctx.recording.runs.get(ctx.selection.run);
    let step = run.and_then(|run| Some((run, run.step_at(ctx.cursor_ns)?)));
    let (Some(position), Some((run, step))) = (&ctx.selection.slide, step) else {
        ctx.selection.moved = MovedChain::default();
        return;
    };
    let answered = ctx.selection.moved.answered.as_ref();
    if answered.is_some_and(|(known, of)| known == position && Arc::ptr_eq(of, step)) {
        return;
    }
    let slide = moved(ctx, run, step, position);
    let answered = Some((*position, Arc::clone(step)));
    ctx.selection.moved = MovedChain { answered, slide: slide.map(Arc::new) };
}

fn moved(ctx: &PanelContext<'_>, run: &RunRecord, step: &StepRecord, position: &SlidePosition) -> Option<ChainSlide> {
    let rank = step.rank.as_ref()?;
    let chain = chain_of_step(&step.report, rank)?;
    let weights = position.direction.weights(rank, &chain)?;
    let camera = ctx.recording.rig.camera(&run.camera_key).ok()?;
    slide(&step.report, &camera.model, &chain, &weights, position.amount)
}

/// Moved chain if it belongs to the step at the cursor.
pub(crate) fn of<'a>(ctx: &'a PanelContext<'_>, stamp_ns: i64) -> Option<&'a Arc<ChainSlide>> {
    ctx.selection.moved.slide.as_ref().filter(|slide| slide.stamp_ns == stamp_ns)
}
