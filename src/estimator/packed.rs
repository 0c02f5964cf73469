//! Snapshot of the estimator in a third of its memory: stores inputs instead of recomputable numbers.

use super::estimator::{Estimator, PhaseState};
use super::initialization::initializer::Initializer;
use super::setup::Setup;
use super::window::packed_window::PackedWindow;
use crate::frontend::TrackedFeature;
use crate::geometry::RigidTransform;
use crate::sensors::ImuSample;

/// Measurements of one step, from which a packed estimator restores those of its window.
pub trait StepMeasurements {
    /// Stamp of the image, as in [`StepInput`](super::StepInput).
    fn stamp_ns(&self) -> i64;
    /// IMU samples, as in [`StepInput`](super::StepInput).
    fn imu(&self) -> &[ImuSample];
    /// Features of a camera, ordered by id; index 0 is the main camera.
    fn features(&self, camera: usize) -> &[TrackedFeature];
}

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
