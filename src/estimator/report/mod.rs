//! Immutable reports of the steps: plain values with public fields, by subject.
//!
//! A report holds all data for panels, tables and the observability analysis; the window creates it.

mod allocation;
pub(crate) mod columns;
mod events;
mod features;
mod footprint;
mod information_gain;
mod jacobian;
pub(crate) mod jacobian_source;
pub(crate) mod linearization;
mod observations;
mod pose_covariance;
mod residuals;
mod step;

pub use allocation::allocated_bytes;
pub use columns::{ColumnBlock, ColumnGroup, ColumnId, FrameId};
pub use events::{Event, EventKind, FailureCause};
pub use features::{FeatureCounts, FeatureReport, LandmarkReport, ObservationReport};
pub use footprint::ReportBytes;
pub use information_gain::{InformationGain, Motion};
pub use jacobian::{FeatureRows, StepJacobian};
pub use jacobian_source::{FactorRows, JacobianFactor, JacobianRow, JacobianSource};
pub use linearization::Linearization;
pub use observations::Observations;
pub use pose_covariance::PoseCovariance;
pub use residuals::{FactorKind, IterationReport, ResidualSummary};
pub use step::{CalibrationEstimate, FrameStateReport, Phase, StageTimes, StepReport};
