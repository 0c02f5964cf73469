//! Conditions over the reports of a run, and where they came true.
//!
//! `rank < 18 or features < 40`: quantities of a step compared with numbers, joined by `and`, `or` and `not`. What a step
//! does not have (a rank while it initializes) makes no condition true. A breakpoint is hit where its condition becomes
//! true.

mod evaluate;
mod expression;
mod lexer;
mod list;
mod parser;
mod quantities;
#[cfg(test)]
mod tests;

pub use evaluate::{Moment, NamedValue};
pub use expression::{Condition, ConditionProblem};
pub use list::{Breakpoint, Breakpoints, Hit};
pub use quantities::quantity_help;
