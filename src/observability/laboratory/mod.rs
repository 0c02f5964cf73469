//! The laboratory: what a mechanism, a parameterization and a motion can tell about the calibration, without a log.
//!
//! An experiment supposes a window, linearizes it with the estimator's own factors
//! ([`crate::estimator::HypotheticalWindow`]) and analyses it as every step is analysed.
//! [`truth_table`] runs all scenarios of docs/mathematics.md, section 7, and compares the ranks with the expected ones.

mod advice;
mod excitation;
mod experiment;
mod mechanism;
mod motion;
mod report;
mod situation;
mod spurious;
mod table;
#[cfg(test)]
mod tests;
mod truth;

pub use advice::{ADVICE_DURATION_S, Advice, CandidateReport, WeakDirection, advise};
pub use excitation::{Excitation, ParameterExcitation, excitation};
pub use experiment::{
    Deficit, FRAME_PERIOD_S, LABORATORY_IMU, LaboratoryForm, LaboratoryResult, LaboratorySetup, PIXEL_SIGMA_PX,
};
pub use mechanism::{LaboratoryJoint, Mechanism, UnknownMechanism};
pub use motion::{LaboratoryMotion, UnknownMotion};
pub use report::LaboratoryReport;
pub use situation::Situation;
pub use spurious::SpuriousRow;
pub use table::{TableEntry, TableRow, TableSection, TruthTable, truth_table};
