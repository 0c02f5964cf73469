//! Suggested excitation after a step, computed once for all panels that show it.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::observability::laboratory::Advice;
use crate::sensors::Rig;
use crate::session::{StepRecord, flight_advice};

/// Steps whose advice is kept: the newest steps of a few runs, and those at the cursor.
const KEPT: usize = 16;

/// Advice of the steps that were asked for last, the newest at the end.
static KNOWN: Mutex<Vec<StepAdvice>> = Mutex::new(Vec::new());

struct StepAdvice {
    step: Weak<StepRecord>,
    rig: Weak<Rig>,
    camera_key: String,
    advice: Option<Arc<Advice>>,
}

impl StepAdvice {
    fn is_of(&self, step: &Arc<StepRecord>, rig: &Arc<Rig>, camera_key: &str) -> bool {
        std::ptr::eq(self.step.as_ptr(), Arc::as_ptr(step))
            && std::ptr::eq(self.rig.as_ptr(), Arc::as_ptr(rig))
            && self.camera_key == camera_key
    }
}

/// Suggested excitation for the chain after a step of a run with a rig's camera; `None` if no parameter is estimated.
pub(in crate::gui) fn step_advice(step: &Arc<StepRecord>, rig: &Arc<Rig>, camera_key: &str) -> Option<Arc<Advice>> {
    let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known().iter().find(|it| it.is_of(step, rig, camera_key)) {
        return found.advice.clone();
    }
    // Without the lock: a thread of the pool may take up other work that asks for advice meanwhile.
    let advice = flight_advice(step, rig, camera_key).map(Arc::new);
    let mut known = known();
    known.retain(|it| it.step.strong_count() > 0);
    let surplus = (known.len() + 1).saturating_sub(KEPT);
    known.drain(..surplus);
    let (step, rig, camera_key) = (Arc::downgrade(step), Arc::downgrade(rig), camera_key.to_owned());
    known.push(StepAdvice { step, rig, camera_key, advice: advice.clone() });
    advice
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording;

    #[test]
    fn panels_share_the_advice_of_a_step() {
        let recording = sample_recording();
        let run = &recording.runs[0];
        let [step, earlier] = [run.steps.len() - 1, run.steps.len() - 2].map(|number| &run.steps[number]);
        let advice = |step| step_advice(step, &recording.rig, &run.camera_key).expect("parameters are estimated");
        let first = advice(step);
        let other = advice(earlier);
        assert!(Arc::ptr_eq(&first, &advice(step)) && Arc::ptr_eq(&other, &advice(earlier)));
        assert!(!Arc::ptr_eq(&first, &other));
        assert_eq!(Some(&*first), flight_advice(step, &recording.rig, &run.camera_key).as_ref());
        // Another rig may have other limits of the joints.
        let rig = Arc::new(Rig::clone(&recording.rig));
        assert!(!Arc::ptr_eq(&first, &step_advice(step, &rig, &run.camera_key).expect("parameters are estimated")));
    }
}
