//! The sliding-window estimator: state (Eq. 7), residuals (Eqs. 8–10), solver, marginalization.
//!
//! It takes a [`StepInput`] per image and leaves a [`StepReport`] behind; nobody reaches in between.

mod config;
#[expect(clippy::module_inception, reason = "the type that the folder is about")]
mod estimator;
mod factors;
pub mod initialization;
mod interventions;
mod options;
mod report;
mod state;
mod supposed;
#[cfg(test)]
mod tests;
mod window;

pub use config::{DEFAULT_CHAIN_PRIOR, EstimatorConfig, RigidCamera, rigid_columns};
pub use estimator::Estimator;
pub(crate) use factors::visual::damped_inverse;
pub use factors::{imu_factor, preintegration};
pub use interventions::InterventionError;
pub use options::{EstimatorOptions, LandmarkModel, RobustLoss, TrackContinuation};
pub use preintegration::{ImuBias, MotionIncrement, NavigationState, Preintegration};
pub use report::{
    CalibrationEstimate, ColumnBlock, ColumnGroup, ColumnId, Event, EventKind, FactorKind, FactorRows, FeatureCounts,
    FeatureReport, FeatureRows, FrameId, FrameStateReport, InformationGain, IterationReport, JacobianFactor,
    JacobianRow, JacobianSource, LandmarkReport, Linearization, Motion, ObservationReport, Observations, Phase,
    ReportBytes, ResidualSummary, StageTimes, StepJacobian, StepReport, allocated_bytes,
};
pub use supposed::{JointKnowledge, PoseKnowledge, SupposedFrame, SupposedLandmark, SupposedWindow};

use nalgebra::Vector3;

use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::sensors::{ImuSample, JointAngles};

/// What one image brings to the estimator.
#[derive(Clone, Debug)]
pub struct StepInput<'a> {
    /// Number of the image in its camera's stream.
    pub frame_index: usize,
    /// Header stamp of the image since the log began.
    pub stamp_ns: i64,
    /// IMU samples from the previous image's stamp to this one's, both ends included and interpolated.
    pub imu: &'a [ImuSample],
    /// Encoder angles at the stamp with their standard deviations, `None` without encoders.
    pub joint_angles: Option<&'a JointAngles>,
    /// The tracked features; none where the main camera has no image at this instant.
    pub tracks: &'a TrackedFrame,
    /// Those of [`EstimatorConfig::rigid_cameras`] at the same instant, in their order; none where an image is missing.
    pub rigid_tracks: &'a [&'a TrackedFrame],
}

impl StepInput<'_> {
    /// What a camera has seen, the main one being the first.
    pub(super) fn features(&self, camera: usize) -> &[TrackedFeature] {
        match camera.checked_sub(1) {
            None => &self.tracks.features,
            Some(rigid) => self.rigid_tracks.get(rigid).map_or(&[], |tracks| &tracks.features),
        }
    }
}

/// Gravity in the world frame, whose z axis points up: `(0, 0, −g)` in m/s².
pub fn gravity_in_world(gravity_m_per_s2: f64) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -gravity_m_per_s2)
}
