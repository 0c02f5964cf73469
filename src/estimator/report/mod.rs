//! Immutable reports of the steps: plain values with public fields, by subject.
//!
//! A report holds all data for panels, tables and the observability analysis; the window creates it.

mod events;
mod features;
mod footprint;
pub(crate) mod jacobian_source;
mod observations;
mod pose_covariance;
mod residuals;
mod step;

pub use events::{Event, EventKind, FailureCause};
pub use features::{FeatureCounts, FeatureReport, LandmarkReport};
pub use footprint::ReportBytes;
pub use jacobian_source::{FactorRows, JacobianFactor, JacobianRow, JacobianSource};
pub use observations::{ObservationReport, Observations};
pub use pose_covariance::PoseCovariance;
pub use residuals::{ResidualSummary, StepWarning};
pub use step::{CalibrationEstimate, FrameStateReport, FurtherCameraEstimate, Phase, Stage, StageTimes, StepReport};
