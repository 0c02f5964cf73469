//! Suggested excitation and motion after a step, computed once for all panels that show them.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::observability::laboratory::{Advice, LONGEST_MOTION_S, NEXT_MOTION_S, SufficientMotion};
use crate::sensors::Rig;
use crate::session::{StepRecord, flight_advice, motion_after};

/// Steps whose results are kept: the newest steps of a few runs, and those at the cursor.
const KEPT: usize = 16;

static ADVICE: StepResults<Advice> = StepResults(Mutex::new(Vec::new()));
static MOTIONS: StepResults<SufficientMotion> = StepResults(Mutex::new(Vec::new()));

/// Results of the steps that were asked for last, the newest at the end.
struct StepResults<T>(Mutex<Vec<StepResult<T>>>);

struct StepResult<T> {
    step: Weak<StepRecord>,
    rig: Weak<Rig>,
    camera_key: String,
    result: Option<Arc<T>>,
}

impl<T> StepResult<T> {
    fn is_of(&self, step: &Arc<StepRecord>, rig: &Arc<Rig>, camera_key: &str) -> bool {
        std::ptr::eq(self.step.as_ptr(), Arc::as_ptr(step))
            && std::ptr::eq(self.rig.as_ptr(), Arc::as_ptr(rig))
            && self.camera_key == camera_key
    }
}

impl<T> StepResults<T> {
    /// Result for a step of a run with a rig's camera, computed the first time.
    fn of(
        &self,
        step: &Arc<StepRecord>,
        rig: &Arc<Rig>,
        camera_key: &str,
        compute: fn(&StepRecord, &Rig, &str) -> Option<T>,
    ) -> Option<Arc<T>> {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().iter().find(|it| it.is_of(step, rig, camera_key)) {
            return found.result.clone();
        }
        // Without the lock: a thread of the pool may take up other work that asks for a result meanwhile.
        let result = compute(step, rig, camera_key).map(Arc::new);
        let mut known = known();
        known.retain(|it| it.step.strong_count() > 0);
        let surplus = (known.len() + 1).saturating_sub(KEPT);
        known.drain(..surplus);
        let (step, rig, camera_key) = (Arc::downgrade(step), Arc::downgrade(rig), camera_key.to_owned());
        known.push(StepResult { step, rig, camera_key, result: result.clone() });
        result
    }
}

/// Suggested excitation for the chain after a step of a run with a rig's camera; `None` if no parameter is estimated.
pub(in crate::gui) fn step_advice(step: &Arc<StepRecord>, rig: &Arc<Rig>, camera_key: &str) -> Option<Arc<Advice>> {
    ADVICE.of(step, rig, camera_key, flight_advice)
}

/// Motion after a step of a run with a rig's camera that reaches the required accuracy; `None` if it is reached.
pub(in crate::gui) fn step_motion(
    step: &Arc<StepRecord>,
    rig: &Arc<Rig>,
    camera_key: &str,
) -> Option<Arc<SufficientMotion>> {
    MOTIONS.of(step, rig, camera_key, |step, rig, camera_key| motion_after(step, rig, camera_key, LONGEST_MOTION_S))
}

/// The next moves after a step of a flight that goes on, towards the required accuracy; `None` if it is reached.
pub(in crate::gui) fn next_motion(step: &StepRecord, rig: &Rig, camera_key: &str) -> Option<Arc<SufficientMotion>> {
    motion_after(step, rig, camera_key, NEXT_MOTION_S).map(Arc::new)
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
