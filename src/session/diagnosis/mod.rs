//! Diagnosis of a run whose residuals disagree with their noise: trials with one change each, ranked by what they explain.
//!
//! - `misfit`, `pixel_histogram`: residuals of a trial by sensor, on one scale for all trials.
//! - `agreement`: limits within which residuals agree with their noise, and the step at which that ends.
//! - `trial`, `span`, `cost_bound`: a run computed again with a change, on a part of it, as long as it may be the best.
//! - `hypotheses`, `axes`, `refinement`, `tuning`: the causes that are tried, with the values to try.
//! - `scoring`, `ranking`: the best cause of each kind, and whether it is decisive.
//! - `measured`: faults that the check of the log measures, and the changes that undo them.
//! - `statement`, `truth`, `outcome`: the result in words.
//! - `diagnose`: the search.

mod agreement;
mod axes;
mod cost_bound;
mod diagnose;
mod hypotheses;
mod measured;
mod misfit;
mod outcome;
mod pixel_histogram;
mod ranking;
mod refinement;
mod scoring;
mod span;
mod statement;
mod trial;
mod truth;
mod tuning;

pub use agreement::AgreementValue;
pub use diagnose::diagnose;
#[cfg(test)]
pub(in crate::session) use diagnose::diagnose_run;
pub use measured::LogFaults;
pub use outcome::{Diagnosis, DiagnosisVerdict, RankedCause, TruthAgreement, WaitingReason};
