//! Conditions on the reports of a run, and the steps in which they become true.
//!
//! `rank < 18 or features < 40` compares quantities of a step with numbers and joins comparisons by `and`, `or` and
//! `not`. A comparison is false if the step lacks its quantity (a rank during initialization). A breakpoint is hit
//! where its condition becomes true.

mod condition;
mod language;
mod list;
mod quantities;
#[cfg(test)]
mod tests;

pub use condition::{Condition, NamedValue, StepContext};
pub use list::{Breakpoint, Breakpoints, Hit};
pub use quantities::quantity_help;

pub use crate::text::condition::ConditionProblem;
