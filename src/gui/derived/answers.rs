//! Answers of the runs, computed again only after new steps or findings.

use std::sync::{Arc, Mutex, PoisonError};

use crate::sensors::RequiredAccuracy;
use crate::session::{Answer, Recording, RunRecord};

/// Steps after which an answer is computed again while its run computes.
const STEPS_AT_ONCE: usize = 20;

/// Answers of all runs; clones share them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Answers {
    known: Arc<Mutex<Vec<KnownAnswer>>>,
}

impl PartialEq for Answers {
    /// Always equal: the answers follow from the recording.
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

/// Answer with what it was computed from.
#[derive(Debug)]
struct KnownAnswer {
    run: u64,
    state: (usize, bool, bool, bool, RequiredAccuracy),
    answer: Arc<Answer>,
}

impl Answers {
    /// Answer of a run as far as it is computed.
    pub(crate) fn of(&self, recording: &Recording, run: &RunRecord) -> Arc<Answer> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|it| recording.runs.iter().any(|run| run.id == it.run));
        let steps = if run.has_ended() { run.steps.len() } else { run.steps.len() / STEPS_AT_ONCE };
        let required = recording.rig.required_accuracy.clone();
        let state = (steps, run.has_ended(), recording.check.is_some(), run.diagnosis.is_some(), required);
        if let Some(found) = known.iter().find(|it| it.run == run.id && it.state == state) {
            return Arc::clone(&found.answer);
        }
        known.retain(|it| it.run != run.id);
        let answer = Arc::new(Answer::of_run(recording, run));
        known.push(KnownAnswer { run: run.id, state, answer: Arc::clone(&answer) });
        answer
    }
}
