//! Stored reports of every step of every run, and values derived from them without running an estimator.

mod antenna_record;
mod calibration_columns;
mod collected_information;
mod comparison;
mod diagnosis;
mod flight_parameter;
mod flight_verdicts;
mod image_residuals;
mod losses;
mod pose_errors;
mod recording;
mod rig_values;
mod run;
mod run_accuracy;
mod sigma_scale;
mod solver_trace;
mod step;
mod step_columns;
mod step_tracks;
mod summary;
mod trajectory_accuracy;
mod trajectory_lane;
mod truth_agreement;
mod warning_lines;

pub use antenna_record::PositionTruth;
pub use calibration_columns::CalibrationRow;
pub use collected_information::CollectedInformation;
pub use comparison::{ComparedQuantity, Comparison, Divergence};
pub use diagnosis::{Diagnosis, DiagnosisVerdict, RankedCause, WaitingReason};
pub(in crate::session) use flight_parameter::optional_seconds;
pub use flight_parameter::{FlightParameter, ParameterSummary};
pub(in crate::session) use flight_verdicts::flight_rows;
pub use flight_verdicts::{FlightVerdicts, add_errors, flight_advice, flight_headline, least_determined};
pub use image_residuals::{ImageResiduals, MeanResidual, ResidualSum};
pub(in crate::session) use losses::known_losses;
pub use losses::{KnownLossSummary, LostSince};
pub use pose_errors::{PoseConsistency, PoseError};
pub use recording::Recording;
pub use run::{ForkOrigin, PassProgress, RunMemory, RunRecord};
pub use solver_trace::{SolverPosition, SolverTrace};
#[cfg(test)]
pub(in crate::session) use step::warnings_of;
pub use step::{RunWarning, StepFactorRows, StepImage, StepRecord};
pub use step_columns::{RankColumn, StepColumn};
pub use step_tracks::StepTracks;
pub(in crate::session) use step_tracks::{KeptTracks, tracks_bytes};
pub use trajectory_accuracy::{
    RELATIVE_LENGTHS_M, RelativeAccuracy, TrajectoryAccuracy, TrajectoryEvaluation, evaluate_trajectory,
};
pub use trajectory_lane::TrajectoryLane;
pub use truth_agreement::TruthAgreement;
pub use warning_lines::{WarningLine, log_warning_lines, run_warning_lines, warning_lines};
