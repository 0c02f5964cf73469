//! The sliding-window estimator: state (Eq. 7), residuals (Eqs. 8–10), solver, marginalization.
//!
//! It takes a [`StepInput`] per image and leaves a [`StepReport`] behind; nobody reaches in between.

mod calibration;
mod calibrations;
mod camera_pose;
mod config;
mod contradictions;
mod dense;
#[expect(clippy::module_inception, reason = "the type that the folder is about")]
mod estimator;
mod features;
mod footprint;
mod gain;
pub mod imu_factor;
pub mod initialization;
mod interventions;
mod jacobian;
mod jacobian_source;
mod joints;
mod layout;
mod linearization;
mod marginalization;
mod motion_parts;
mod observations;
mod options;
mod pose_blocks;
pub mod preintegration;
mod prior;
mod problem;
mod projection;
mod report;
mod reporting;
mod reprojection;
mod rows;
mod solver;
mod standstill;
mod startup;
mod supposed;
#[cfg(test)]
mod tests;
mod tracking;
mod visual;
mod window;

pub use config::{DEFAULT_CHAIN_PRIOR, EstimatorConfig, RigidCamera, rigid_columns};
pub use estimator::Estimator;
pub use footprint::{ReportBytes, allocated_bytes};
pub use gain::{InformationGain, Motion};
pub use interventions::InterventionError;
pub use jacobian::{FeatureRows, StepJacobian};
pub use jacobian_source::{FactorRows, JacobianFactor, JacobianRow, JacobianSource, column_scale};
pub use observations::Observations;
pub use options::{EstimatorOptions, LandmarkModel, RobustLoss, TrackContinuation};
pub use preintegration::{ImuBias, MotionIncrement, NavigationState, Preintegration};
pub use supposed::{JointKnowledge, PoseKnowledge, SupposedFrame, SupposedLandmark, SupposedWindow};
pub(crate) use visual::damped_inverse;

pub use report::{
    CalibrationEstimate, ColumnBlock, ColumnGroup, Event, EventKind, FeatureCounts, FeatureReport, FrameStateReport,
    IterationReport, LandmarkReport, Linearization, ObservationReport, Phase, ResidualSummary, StageTimes, StepReport,
};

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
