//! The immutable report that every step leaves behind, and how it is made from a solved window.

mod footprint;
pub(crate) mod gain;
mod jacobian;
mod jacobian_source;
mod linearization;
pub(crate) mod motion_parts;
mod observations;
mod reporting;
mod step;

pub use footprint::{ReportBytes, allocated_bytes};
pub use gain::{InformationGain, Motion};
pub use jacobian::{FeatureRows, StepJacobian};
pub use jacobian_source::{FactorRows, JacobianFactor, JacobianRow, JacobianSource, column_scale};
pub use observations::Observations;
pub use step::{
    CalibrationEstimate, ColumnBlock, ColumnGroup, Event, EventKind, FeatureCounts, FeatureReport, FrameStateReport,
    IterationReport, LandmarkReport, Linearization, ObservationReport, Phase, ResidualSummary, StageTimes, StepReport,
};
