//! The syntax tree of a condition.

use std::cmp::Ordering;
use std::fmt;

use thiserror::Error;

use super::quantities::{FlagName, NamedNumber, NumberName};
use crate::estimator::EventKind;

/// A syntax error in a condition and its column.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("column {column}: {message}\n  {text}\n  {}^", " ".repeat(column - 1))]
pub struct ConditionProblem {
    /// The text of the whole condition.
    pub text: String,
    /// Column of the error in characters, from 1; after the last character if something is missing.
    pub column: usize,
    /// The error and what was expected.
    pub message: String,
}

/// A Boolean expression over the quantities of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    pub(super) text: String,
    pub(super) predicate: Predicate,
}

impl Condition {
    pub fn text(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.text)
    }
}

/// Range of characters in the text, from 0; `end` is exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TextRange {
    pub(crate) begin: usize,
    pub(crate) end: usize,
}

/// A numerical sub-expression.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Number {
    Literal(f64),
    Quantity(NumberName, TextRange),
    /// A quantity with an argument: `sigma(yaw.alpha)`.
    Named(NamedNumber, String, TextRange),
    /// A singular value by its number from 1, largest first: `singular(1)`.
    Singular(usize, TextRange),
    /// The difference from the step before: `rise(x)`.
    Rise(Box<Self>, TextRange),
    Negated(Box<Self>),
    Absolute(Box<Self>),
    Combined(Arithmetic, Box<Self>, Box<Self>),
}

/// An operation on two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arithmetic {
    Sum,
    Difference,
    Product,
    Quotient,
    Min,
    Max,
}

/// A sub-expression that is true or false.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Predicate {
    Literal(bool),
    Flag(FlagName),
    Event(Vec<EventKind>, TextRange),
    Compared(ComparisonOperator, Number, Number),
    Not(Box<Self>),
    And(Box<Self>, Box<Self>),
    Or(Box<Self>, Box<Self>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ComparisonOperator {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Unequal,
}

impl ComparisonOperator {
    pub(crate) fn holds(self, left: f64, right: f64) -> bool {
        match self {
            Self::Less => left < right,
            Self::LessOrEqual => left <= right,
            Self::Greater => left > right,
            Self::GreaterOrEqual => left >= right,
            Self::Equal => left == right,
            Self::Unequal => left != right,
        }
    }

    /// True if the comparison holds for two values in this order.
    pub(crate) fn holds_for(self, order: Ordering) -> bool {
        match self {
            Self::Less => order.is_lt(),
            Self::LessOrEqual => order.is_le(),
            Self::Greater => order.is_gt(),
            Self::GreaterOrEqual => order.is_ge(),
            Self::Equal => order.is_eq(),
            Self::Unequal => order.is_ne(),
        }
    }
}
