//! Runs experiments, on a thread of its own or while the caller waits.
//!
//! An experiment is made up of a mechanism, motions and joint readings alone: it has no log, no run and no step, so that
//! neither the session nor its record has a place for it, and the panel keeps its thread.

use std::sync::mpsc::{Receiver, channel};
use std::thread::Builder;

use crate::observability::laboratory::{LaboratoryForm, LaboratoryResult, LaboratorySetup};

/// A setup and the forms to compare.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Experiment {
    pub(super) setup: LaboratorySetup,
    pub(super) forms: Vec<LaboratoryForm>,
}

/// The experiment that was asked for last, and what is known of it.
#[derive(Default)]
pub(super) struct Worker {
    asked: Option<Experiment>,
    coming: Option<Receiver<LaboratoryResult>>,
    results: Vec<LaboratoryResult>,
}

impl Worker {
    /// Starts an experiment unless it is the one asked for before; takes what has come of it.
    pub(super) fn ask(&mut self, experiment: &Experiment, in_background: bool) {
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

    fn start(&mut self, experiment: &Experiment, in_background: bool) {
        self.asked = Some(experiment.clone());
        if in_background {
            let (sender, receiver) = channel();
            let given = experiment.clone();
            let work = move || {
                given.setup.run_each(&given.forms, |result| {
                    // Nobody waits any more when another experiment was asked for meanwhile.
                    sender.send(result).is_ok()
                });
            };
            if Builder::new().name("laboratory".to_owned()).spawn(work).is_ok() {
                self.coming = Some(receiver);
                return;
            }
        }
        self.results = experiment.setup.run_all(&experiment.forms);
    }

    /// Whether more is to come.
    pub(super) fn is_busy(&self) -> bool {
        self.coming.is_some()
    }

    /// What has come so far, and of how many forms.
    pub(super) fn results(&self) -> (&[LaboratoryResult], usize) {
        (&self.results, self.asked.as_ref().map_or(0, |experiment| experiment.forms.len()))
    }

    /// What is supposed.
    pub(super) fn setup(&self) -> Option<&LaboratorySetup> {
        self.asked.as_ref().map(|experiment| &experiment.setup)
    }
}
