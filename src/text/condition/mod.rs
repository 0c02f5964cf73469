//! Conditions such as `rank < 18 and not (rms > 0.5 px or tracking)` over quantities that the caller names.
//!
//! Comparisons of numbers are joined by `and`, `or` and `not`; numbers have units, arithmetic and brackets. A
//! [`Language`] gives quantities and properties their names, [`Values`] their values.

mod expression;
mod lexer;
mod parser;

pub use expression::ConditionProblem;
pub use expression::{Arithmetic, ComparisonOperator, Number, Predicate, TextRange, Values};
pub use lexer::Token;
pub use parser::{Expression, Language, Parser, parse};
