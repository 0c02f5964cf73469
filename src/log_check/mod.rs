//! Checks of a log and its rig that need no estimator, each finding with its evidence and remedy.
//!
//! `check.rs` calls the checks of the folders in their order. The ground floor is `report/` (findings), `survey/` (values
//! of all messages) and the loose files that import no folder; the folders of single subjects are built on it.

mod check;
mod clock_alignment;
mod extrinsics;
mod gimbal;
mod ground_truth;
mod images;
mod imu;
mod isolation;
mod noise;
mod pairs;
mod permutations;
mod report;
mod rig_sanity;
mod rotations;
mod stamps;
mod statistics;
mod survey;
#[cfg(test)]
mod tests;
mod topics;

pub use self::check::check;
pub use self::clock_alignment::{
    AlignmentError, AlignmentReference, ClockAlignment, RotationReference, align_camera, align_clocks,
};
pub use self::isolation::{AGREEING_MISFIT, LARGEST_MISFIT};
pub use self::noise::{
    AllanPoint, AllanReport, AxisNoise, GivenNoise, NoiseTerm, NoiseTerms, SensorNoise, measure_noise,
};
pub use self::pairs::{PairMatches, PairMeasurement, median_apart_s};
pub use self::report::agreement::{Agreement, PairAgreement, Quantity};
pub(crate) use self::report::verdict::MOST_LIKELY;
pub use self::report::verdict::{Trust, Verdict, joint_statement, problems};
pub use self::report::{
    Area, Basis, CheckReport, Finding, FindingInterval, ImageRotation, ProposedMask, Severity, TopicReport,
};
