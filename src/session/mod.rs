//! A log, the runs on it, and the reports of their steps.
//!
//! A [`Recording`] holds the reports so far; the window and the exports draw it at a cursor. [`compute`] fills one
//! without a window; a [`Session`] plays one while it is computed.
//!
//! A folder uses those above it in this list and none below it:
//!
//! - [`accuracy`]: trajectory errors against ground truth.
//! - [`antenna`]: the same against positions of an antenna, with its lever arm.
//! - `plan/`: the definition of a session: log, rig, runs, and the changes of a fork.
//! - `misfit/`: residuals of a run by sensor, and whether they agree with their noise.
//! - `record/`: the reports of every step as plain data; no threads, and nothing that runs an estimator.
//! - `result/`: the result of a run: its numbers, whether it can be trusted, and the required accuracy.
//! - [`breakpoints`]: conditions on those reports.
//! - `engine/`: runs on threads, and recomputation of their steps from step inputs and estimator snapshots. Messages of
//!   the threads become records in [`Computation`], nowhere else.
//! - `diagnosis/`: runs computed again with one change each, ranked by what the changes explain.
//! - `playback/`: a cursor over the record, the commands that move it, and the session that connects cursor, engine and
//!   record.

pub mod accuracy;
pub mod antenna;
pub mod breakpoints;
mod diagnosis;
mod engine;
mod misfit;
mod plan;
mod playback;
mod record;
mod result;
#[cfg(test)]
pub(crate) mod tests;

pub use diagnosis::{LogFaults, TRIALS_S, diagnose};
pub use engine::{
    BreakpointHit, CalibrationErrors, CalibrationRequest, CalibrationRun, CalibrationRunError, Computation,
    FlightNoiseError, SnapshotUse, Stopwatch, calibrate, camera_rotations, check_log, compute, compute_until,
    fit_flight_noise, image_rotations, record_synthetic, situation_before_flight,
};
pub use misfit::AgreementValue;
pub use plan::{
    DEFAULT_MEMORY_BUDGET_BYTES, EstimatorTuning, FORK_PARAMETERIZATIONS, FlightPrior, FlightSigmas, ForkChanges,
    ForkError, LoadedPositions, LoadedTrajectory, MAX_RUNS, MAX_TRAJECTORIES, ParameterizationChoice, RunSpec,
    RunSpecError, SessionError, SessionPlan, SessionRequest, TrajectorySource, TrajectorySpec, TrajectorySpecError,
};
pub use playback::{
    Command, Cursor, DiagnosisProgress, FrameImage, Marker, Markers, MoveOutcome, Moved, PlaybackSpeed,
    SavedBreakpoint, SavedFork, SavedLog, SavedPrior, SavedSession, SavedSessionError, Session, Wake,
};
pub use record::{
    CalibrationRow, CollectedInformation, ComparedQuantity, Comparison, Diagnosis, DiagnosisVerdict, Divergence,
    FlightParameter, FlightVerdicts, ForkOrigin, ImageResiduals, KnownLossSummary, LostSince, MeanResidual,
    ParameterSummary, PassProgress, PoseConsistency, PoseError, PositionTruth, RELATIVE_LENGTHS_M, RankColumn,
    RankedCause, Recording, RelativeAccuracy, ResidualSum, RunMemory, RunRecord, RunWarning, SolverPosition,
    SolverTrace, StepColumn, StepFactorRows, StepImage, StepRecord, StepTracks, TrajectoryAccuracy,
    TrajectoryEvaluation, TrajectoryLane, TruthAgreement, WaitingReason, WarningLine, add_errors, evaluate_trajectory,
    flight_advice, flight_headline, least_determined, log_warning_lines, run_warning_lines, warning_lines,
};
pub use result::{
    Answer, FindingSource, FrameCounts, RankSummary, Requirement, RunFinding, RunSummary, StageSummary, TimingSummary,
    Withheld, flight_table, motion_after, motion_text, short_motion_text, summarize, summarize_with_motion,
};
