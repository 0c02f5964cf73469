//! A condition as a tree.

use std::fmt;

use thiserror::Error;

use super::quantities::{FlagName, NamedNumber, NumberName};
use crate::estimator::EventKind;

/// Why a text is no condition: what is wrong, and where.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("column {column}: {message}\n  {text}\n  {}^", " ".repeat(column - 1))]
pub struct ConditionProblem {
    /// The whole text.
    pub text: String,
    /// Where the mistake begins, counted in characters from 1; one more than the text has where something is missing.
    pub column: usize,
    /// What is wrong and what was expected.
    pub message: String,
}

/// Something that is true or not in a step of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    pub(super) text: String,
    pub(super) truth: Truth,
}

impl Condition {
    /// As it was written.
    pub fn text(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.text)
    }
}

/// Characters of the text, first and behind the last, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) begin: usize,
    pub(super) end: usize,
}

/// A part that is a number.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Number {
    Literal(f64),
    /// A quantity of the step, and where it is written.
    Quantity(NumberName, Span),
    /// A quantity that goes by a name, and where it is written.
    Named(NamedNumber, String, Span),
    /// A singular value by its number from 1, largest first.
    Singular(usize, Span),
    /// The change since the step before.
    Rise(Box<Self>, Span),
    Negated(Box<Self>),
    Absolute(Box<Self>),
    Combined(Arithmetic, Box<Self>, Box<Self>),
}

/// What two numbers become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arithmetic {
    Sum,
    Difference,
    Product,
    Quotient,
    Least,
    Greatest,
}

/// A part that is true or not.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Truth {
    Literal(bool),
    Flag(FlagName),
    Event(Vec<EventKind>, Span),
    Compared(Comparison, Number, Number),
    Not(Box<Self>),
    And(Box<Self>, Box<Self>),
    Or(Box<Self>, Box<Self>),
}

/// How two numbers compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Comparison {
    Less,
    AtMost,
    Greater,
    AtLeast,
    Equal,
    Unequal,
}

impl Comparison {
    pub(super) fn holds(self, left: f64, right: f64) -> bool {
        match self {
            Self::Less => left < right,
            Self::AtMost => left <= right,
            Self::Greater => left > right,
            Self::AtLeast => left >= right,
            Self::Equal => left == right,
            Self::Unequal => left != right,
        }
    }
}
