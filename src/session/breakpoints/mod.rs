//! Conditions on the reports of a run, and the steps in which they become true.
//!
//! `rank < 18 or features < 40` compares quantities of a step with numbers and joins comparisons by `and`, `or` and
//! `not`. A comparison is false if the step lacks its quantity (a rank during initialization). A breakpoint is hit
//! where its condition becomes true.

mod evaluate;
mod expression;
mod lexer;
mod list;
mod parser;
mod quantities;
#[cfg(test)]
mod tests;

pub(crate) use expression::{ComparisonOperator, TextRange};
pub(crate) use lexer::{Token, tokens_with_single_equals};
pub(crate) use parser::factor_of_unit;

pub use evaluate::{NamedValue, StepContext};
pub use expression::{Condition, ConditionProblem};
pub use list::{Breakpoint, Breakpoints, Hit};
pub use quantities::quantity_help;
