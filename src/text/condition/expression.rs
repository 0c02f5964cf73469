//! Syntax tree of a condition, and its value.

use std::cmp::Ordering;

use thiserror::Error;

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

/// Range of characters in the text, from 0; `end` is exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextRange {
    pub begin: usize,
    pub end: usize,
}

/// Values of the quantities `N` and of the properties `F` of a condition.
pub trait Values<N, F> {
    /// Result of a comparison in which a value is missing.
    const MISSING: Option<bool>;

    /// Value of a quantity, `None` if it is missing.
    fn number(&self, quantity: &N) -> Option<f64>;

    fn flag(&self, flag: &F) -> Option<bool>;
}

/// A numerical sub-expression over quantities `N`.
#[derive(Clone, Debug, PartialEq)]
pub enum Number<N> {
    Literal(f64),
    Quantity(N, TextRange),
    Negated(Box<Self>),
    Absolute(Box<Self>),
    Combined(Arithmetic, Box<Self>, Box<Self>),
}

impl<N> Number<N> {
    /// The value; `None` if a quantity is missing or the result is not finite.
    pub fn value<F>(&self, values: &impl Values<N, F>) -> Option<f64> {
        let value = match self {
            Self::Literal(value) => *value,
            Self::Quantity(quantity, _) => values.number(quantity)?,
            Self::Negated(inner) => -inner.value(values)?,
            Self::Absolute(inner) => inner.value(values)?.abs(),
            Self::Combined(arithmetic, left, right) => arithmetic.of(left.value(values)?, right.value(values)?),
        };
        value.is_finite().then_some(value)
    }

    /// Calls `visit` for every quantity, from left to right.
    pub fn visit<'a>(&'a self, visit: &mut dyn FnMut(&'a N, TextRange)) {
        match self {
            Self::Literal(_) => {}
            Self::Quantity(quantity, span) => visit(quantity, *span),
            Self::Negated(inner) | Self::Absolute(inner) => inner.visit(visit),
            Self::Combined(_, left, right) => {
                left.visit(visit);
                right.visit(visit);
            }
        }
    }
}

/// An operation on two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arithmetic {
    Sum,
    Difference,
    Product,
    Quotient,
    Min,
    Max,
}

impl Arithmetic {
    fn of(self, left: f64, right: f64) -> f64 {
        match self {
            Self::Sum => left + right,
            Self::Difference => left - right,
            Self::Product => left * right,
            Self::Quotient => left / right,
            Self::Min => left.min(right),
            Self::Max => left.max(right),
        }
    }
}

/// A sub-expression over quantities `N` and properties `F` that is true or false.
#[derive(Clone, Debug, PartialEq)]
pub enum Predicate<N, F> {
    Flag(F),
    Compared(ComparisonOperator, Number<N>, Number<N>),
    Not(Box<Self>),
    And(Box<Self>, Box<Self>),
    Or(Box<Self>, Box<Self>),
}

impl<N, F> Predicate<N, F> {
    /// True if the condition holds; `None` if a missing value decides it.
    pub fn holds<V: Values<N, F>>(&self, values: &V) -> Option<bool> {
        match self {
            Self::Flag(flag) => values.flag(flag),
            Self::Compared(comparison, left, right) => {
                let operands = left.value(values).zip(right.value(values));
                operands.map_or(V::MISSING, |(left, right)| Some(comparison.holds(left, right)))
            }
            Self::Not(inner) => inner.holds(values).map(|value| !value),
            // A missing value matters only where the other operand does not decide alone.
            Self::And(left, right) => match (left.holds(values), right.holds(values)) {
                (Some(false), _) | (_, Some(false)) => Some(false),
                (Some(true), Some(true)) => Some(true),
                _ => None,
            },
            Self::Or(left, right) => match (left.holds(values), right.holds(values)) {
                (Some(true), _) | (_, Some(true)) => Some(true),
                (Some(false), Some(false)) => Some(false),
                _ => None,
            },
        }
    }

    /// Calls `visit` for every quantity, from left to right.
    pub fn visit<'a>(&'a self, visit: &mut dyn FnMut(&'a N, TextRange)) {
        match self {
            Self::Flag(_) => {}
            Self::Compared(_, left, right) => {
                left.visit(visit);
                right.visit(visit);
            }
            Self::Not(inner) => inner.visit(visit),
            Self::And(left, right) | Self::Or(left, right) => {
                left.visit(visit);
                right.visit(visit);
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparisonOperator {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Unequal,
}

impl ComparisonOperator {
    fn holds(self, left: f64, right: f64) -> bool {
        left.partial_cmp(&right).map_or(self == Self::Unequal, |order| self.holds_for(order))
    }

    /// True if the comparison holds for two values in this order.
    pub fn holds_for(self, order: Ordering) -> bool {
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
