//! Text of a rig for the choices of the form, computed on a thread, since it reads images and IMU samples of the log.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use crate::flight_log::FlightLog;
use crate::flight_log::rig_template::{RigChoices, RigTemplate};
use crate::sensors::AssumedField;

/// A rig with assumed values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RigDraft {
    pub(super) text: String,
    pub(super) assumed: Vec<AssumedField>,
}

/// The latest draft, and the one that is being computed.
#[derive(Default)]
pub(super) struct DraftWorker {
    pending: Option<(RigChoices, Receiver<Result<RigDraft, String>>)>,
    done: Option<(RigChoices, Result<RigDraft, String>)>,
}

impl DraftWorker {
    /// Draft for these choices; `None` while it is computed.
    pub(super) fn draft(&mut self, log: &Arc<FlightLog>, choices: &RigChoices) -> Option<&Result<RigDraft, String>> {
        if let Some((of, answer)) = self.pending.take() {
            match answer.try_recv() {
                Ok(draft) => self.done = Some((of, draft)),
                Err(TryRecvError::Empty) => self.pending = Some((of, answer)),
                Err(TryRecvError::Disconnected) => {
                    self.done = Some((of, Err("the computation of the rig stopped".to_owned())));
                }
            }
        }
        let is_done = self.done.as_ref().is_some_and(|(of, _)| of == choices);
        if !is_done && self.pending.is_none() {
            self.start(log, choices);
        }
        self.done.as_ref().filter(|_| is_done).map(|(_, draft)| draft)
    }

    fn start(&mut self, log: &Arc<FlightLog>, choices: &RigChoices) {
        let (sender, answer) = channel();
        let (log, wanted) = (Arc::clone(log), choices.clone());
        let compute = move || {
            let draft = RigTemplate::new(&wanted, Some(&log));
            let draft = draft.map(|rig| RigDraft { text: rig.to_yaml(), assumed: rig.assumed_fields() });
            // The receiver is dropped when the page is closed.
            drop(sender.send(draft.map_err(|error| error.to_string())));
        };
        match std::thread::Builder::new().name("rig-draft".to_owned()).spawn(compute) {
            Ok(_) => self.pending = Some((choices.clone(), answer)),
            Err(error) => self.done = Some((choices.clone(), Err(format!("cannot start a thread: {error}")))),
        }
    }
}
