//! Diagnosis of a run whose residuals disagree with their noise: trials with one change each, ranked by what they explain.
//!
//! - `budget`: bound on the processor time of all trials.
//! - `thinning`: the features that trials use.
//! - `trial`, `span`, `cost_bound`: a run computed again with a change, on a part of it, as long as it may be the best.
//! - `hypotheses`, `axes`, `refinement`, `tuning`: the causes that are tried, with the values to try.
//! - `scoring`, `ranking`: the best cause of each kind, and whether it is decisive.
//! - `measured`: faults that the check of the log measures, and the changes that undo them.
//! - `statement`: the causes in words.
//! - `diagnose`: the search.

mod axes;
mod budget;
mod cost_bound;
mod diagnose;
mod hypotheses;
mod measured;
mod ranking;
mod refinement;
mod scoring;
mod span;
mod statement;
mod thinning;
mod trial;
mod tuning;

#[cfg(test)]
pub(in crate::session) use diagnose::diagnose_run;
pub use diagnose::{TRIALS_S, diagnose};
pub use measured::LogFaults;
