//! A snapshot of the estimator in a third of its memory: what its numbers are made from instead of the numbers.

use super::estimator::{Estimator, PhaseState};
use super::start::initializer::Initializer;
use super::step_input::StepMeasurements;
use super::window::packed::PackedWindow;
use super::window::setup::Setup;
use crate::geometry::RigidTransform;

/// An estimator without what can be computed again to the same bits: integrated IMU intervals, products of the prior.
/// Measurements are places in the inputs of the steps before.
#[derive(Clone, Debug)]
pub struct PackedEstimator {
    setup: Setup,
    phase: PackedPhase,
    restarts: usize,
    resume_at: Option<RigidTransform>,
}

#[derive(Clone, Debug)]
enum PackedPhase {
    Initializing(Initializer),
    Tracking(Box<PackedWindow>),
}

impl Estimator {
    /// Packs the estimator. `past` are steps before the next one, the newest last; measurements that are not among them
    /// are copied.
    pub fn packed(&self, past: &[&dyn StepMeasurements]) -> PackedEstimator {
        let phase = match &self.phase {
            PhaseState::Initializing(initializer) => PackedPhase::Initializing(initializer.clone()),
            PhaseState::Tracking(window) => PackedPhase::Tracking(Box::new(PackedWindow::new(window, past))),
        };
        PackedEstimator { setup: self.setup.clone(), phase, restarts: self.restarts, resume_at: self.resume_at }
    }
}

impl PackedEstimator {
    /// The estimator as it was; `past` are the steps that it was packed with.
    pub fn unpacked(&self, past: &[&dyn StepMeasurements]) -> Estimator {
        let phase = match &self.phase {
            PackedPhase::Initializing(initializer) => PhaseState::Initializing(initializer.clone()),
            PackedPhase::Tracking(window) => PhaseState::Tracking(Box::new(window.unpacked(past))),
        };
        Estimator { setup: self.setup.clone(), phase, restarts: self.restarts, resume_at: self.resume_at }
    }

    /// Memory in bytes; data that all snapshots share counts with its inline size.
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + match &self.phase {
                PackedPhase::Initializing(initializer) => initializer.heap_bytes(),
                PackedPhase::Tracking(window) => size_of::<PackedWindow>() + window.heap_bytes(),
            }
    }
}
