//! Computes experiments on another thread or while the caller waits.
//!
//! An experiment consists only of a mechanism, motions and joint readings, without log, run or step. It therefore
//! belongs neither to the session nor to its record, and the panel owns the thread.

use std::sync::mpsc::{Receiver, channel};
use std::thread::Builder;

use crate::observability::laboratory::{LaboratoryForm, LaboratoryResult, LaboratorySetup};

#[derive(Clone, Debug, PartialEq)]
pub(super) struct LaboratoryJob {
    pub(super) setup: LaboratorySetup,
    pub(super) parameterizations: Vec<LaboratoryForm>,
}

/// The requested experiment and its results so far.
#[derive(Default)]
pub(super) struct Worker {
    asked: Option<LaboratoryJob>,
    coming: Option<Receiver<LaboratoryResult>>,
    results: Vec<LaboratoryResult>,
}

impl Worker {
    /// Starts an experiment unless it is the current one, and receives results.
    pub(super) fn request(&mut self, experiment: &LaboratoryJob, in_background: bool) {
        if self.asked.as_ref() != Some(experiment) {
            self.results.clear();
            self.coming = None;
            self.start(experiment, in_background);
        }
        loop {
            let Some(coming) = &self.coming else { return };
            match coming.try_recv() {
                Ok(result) => self.results.push(result),
                Err(std::sync::mpsc::TryRecvError::Empty) => return,
                Err(std::sync::mpsc::TryRecvError::Disconnected) => self.coming = None,
            }
        }
    }

    fn start(&mut self, experiment: &LaboratoryJob, in_background: bool) {
        self.asked = Some(experiment.clone());
        if in_background {
            let (sender, receiver) = channel();
            let given = experiment.clone();
            let work = move || {
                given.setup.run_each(&given.parameterizations, |result| {
                    // The receiver has been dropped if another experiment was requested meanwhile.
                    sender.send(result).is_ok()
                });
            };
            if Builder::new().name("laboratory".to_owned()).spawn(work).is_ok() {
                self.coming = Some(receiver);
                return;
            }
        }
        self.results = experiment.setup.run_all(&experiment.parameterizations);
    }

    /// True if results are missing.
    pub(super) fn is_busy(&self) -> bool {
        self.coming.is_some()
    }

    /// Results so far, and the number of parameterizations.
    pub(super) fn results(&self) -> (&[LaboratoryResult], usize) {
        (&self.results, self.asked.as_ref().map_or(0, |experiment| experiment.parameterizations.len()))
    }

    pub(super) fn setup(&self) -> Option<&LaboratorySetup> {
        self.asked.as_ref().map(|experiment| &experiment.setup)
    }
}
