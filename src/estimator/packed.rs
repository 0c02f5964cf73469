//! Snapshot of the estimator in a third of its memory: stores inputs instead of recomputable numbers.

use super::estimator::{Estimator, PhaseState};
use super::start::initializer::Initializer;
use super::step_input::StepMeasurements;
use super::window::packed_window::PackedWindow;
use super::window::setup::Setup;
use crate::geometry::RigidTransform;

/// Estimator without data that can be recomputed to the same bits: integrated IMU intervals, products of the prior.
/// Measurements are stored as references to the inputs of earlier steps.
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
    /// Packs the estimator. `past` has the inputs of earlier steps, newest last; measurements that are not among them
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
    /// Restores the estimator; `past` must be the steps with which it was packed.
    pub fn unpacked(&self, past: &[&dyn StepMeasurements]) -> Estimator {
        let phase = match &self.phase {
            PackedPhase::Initializing(initializer) => PhaseState::Initializing(initializer.clone()),
            PackedPhase::Tracking(window) => PhaseState::Tracking(Box::new(window.unpacked(past))),
        };
        Estimator { setup: self.setup.clone(), phase, restarts: self.restarts, resume_at: self.resume_at }
    }

    /// Memory use in bytes; data shared by all snapshots counts only with its inline size.
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + match &self.phase {
                PackedPhase::Initializing(initializer) => initializer.heap_bytes(),
                PackedPhase::Tracking(window) => size_of::<PackedWindow>() + window.heap_bytes(),
            }
    }
}
