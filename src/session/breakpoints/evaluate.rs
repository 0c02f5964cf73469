//! Evaluation of a condition in a step.

use super::expression::{Arithmetic, Condition, Number, Predicate, TextRange};
use super::quantities::NamedNumber;
use crate::estimator::ResidualSummary;
use crate::gimbal::{ParameterId, ParameterNames};
use crate::session::record::StepRecord;
use crate::text::Named as _;

/// The inputs of the evaluation of a condition.
#[derive(Clone, Copy, Debug)]
pub struct StepContext<'a> {
    /// The current step; its summary suffices.
    pub step: &'a StepRecord,
    /// The step before it.
    pub previous: Option<&'a StepRecord>,
    pub names: &'a ParameterNames,
}

/// A quantity of a condition and its value in a step.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedValue {
    /// The quantity as written in the condition.
    pub name: String,
    /// The value; `None` where the step does not have the quantity.
    pub value: Option<f64>,
}

impl Condition {
    /// True if the condition holds in the step; `None` if the step lacks a quantity that decides it.
    pub fn holds(&self, context: &StepContext<'_>) -> Option<bool> {
        self.predicate.holds(context)
    }

    /// Every quantity of the condition once, in textual order.
    pub fn values(&self, context: &StepContext<'_>) -> Vec<NamedValue> {
        let mut values_by_span = Vec::new();
        self.predicate.visit(&mut |span, number| values_by_span.push((span, number.value(context))));
        let mut values: Vec<NamedValue> = Vec::new();
        for (span, value) in values_by_span {
            let name: String = self.text.chars().skip(span.begin).take(span.end - span.begin).collect();
            if !values.iter().any(|known| known.name == name) {
                values.push(NamedValue { name, value });
            }
        }
        values
    }

    /// Parameters and joints in the condition that are not in `names` and `parameters`. A condition on such a name is
    /// never true.
    pub fn unknown_names(&self, names: &ParameterNames, parameters: &[ParameterId]) -> Vec<String> {
        let mut unknown = Vec::new();
        self.predicate.visit(&mut |_, number| {
            if let Number::Named(kind, name, _) = number {
                let known = match kind {
                    NamedNumber::Sigma | NamedNumber::PriorSigma | NamedNumber::Value => {
                        names.parse(name).is_some_and(|parameter| parameters.contains(&parameter))
                    }
                    NamedNumber::Joint => joint_index(name, names).is_some(),
                    NamedNumber::Margin | NamedNumber::Lost | NamedNumber::Chi2 | NamedNumber::Nis => true,
                };
                if !known && !unknown.contains(name) {
                    unknown.push(name.clone());
                }
            }
        });
        unknown
    }
}

impl Predicate {
    fn holds(&self, context: &StepContext<'_>) -> Option<bool> {
        match self {
            Self::Literal(value) => Some(*value),
            Self::Flag(flag) => Some(flag.of(context.step)),
            Self::Event(kinds, _) => Some(context.step.report.events.iter().any(|event| kinds.contains(&event.kind))),
            Self::Compared(comparison, left, right) => {
                Some(comparison.holds(left.value(context)?, right.value(context)?))
            }
            Self::Not(inner) => inner.holds(context).map(|value| !value),
            // A missing value matters only where the other operand does not decide alone.
            Self::And(left, right) => match (left.holds(context), right.holds(context)) {
                (Some(false), _) | (_, Some(false)) => Some(false),
                (Some(true), Some(true)) => Some(true),
                _ => None,
            },
            Self::Or(left, right) => match (left.holds(context), right.holds(context)) {
                (Some(true), _) | (_, Some(true)) => Some(true),
                (Some(false), Some(false)) => Some(false),
                _ => None,
            },
        }
    }

    /// Calls `visit` for every quantity, from left to right.
    fn visit<'a>(&'a self, visit: &mut impl FnMut(TextRange, &'a Number)) {
        match self {
            Self::Literal(_) | Self::Flag(_) | Self::Event(..) => {}
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

impl Number {
    fn value(&self, context: &StepContext<'_>) -> Option<f64> {
        let value = match self {
            Self::Literal(value) => *value,
            Self::Quantity(name, _) => name.of(context.step)?,
            Self::Named(kind, name, _) => named(*kind, name, context)?,
            Self::Singular(index, _) => *context.step.rank.as_ref()?.singular_values.get(index.checked_sub(1)?)?,
            Self::Rise(inner, _) => {
                let before = StepContext { step: context.previous?, previous: None, names: context.names };
                inner.value(context)? - inner.value(&before)?
            }
            Self::Negated(inner) => -inner.value(context)?,
            Self::Absolute(inner) => inner.value(context)?.abs(),
            Self::Combined(arithmetic, left, right) => {
                let (left, right) = (left.value(context)?, right.value(context)?);
                match arithmetic {
                    Arithmetic::Sum => left + right,
                    Arithmetic::Difference => left - right,
                    Arithmetic::Product => left * right,
                    Arithmetic::Quotient => left / right,
                    Arithmetic::Min => left.min(right),
                    Arithmetic::Max => left.max(right),
                }
            }
        };
        value.is_finite().then_some(value)
    }

    fn visit<'a>(&'a self, visit: &mut impl FnMut(TextRange, &'a Self)) {
        match self {
            Self::Literal(_) => {}
            Self::Quantity(_, span) | Self::Named(_, _, span) | Self::Singular(_, span) => visit(*span, self),
            Self::Rise(inner, span) => {
                visit(*span, self);
                inner.visit(visit);
            }
            Self::Negated(inner) | Self::Absolute(inner) => inner.visit(visit),
            Self::Combined(_, left, right) => {
                left.visit(visit);
                right.visit(visit);
            }
        }
    }
}

fn named(kind: NamedNumber, name: &str, context: &StepContext<'_>) -> Option<f64> {
    let report = &context.step.report;
    let calibration = &report.calibration;
    let parameter = |values: &[f64]| {
        let parameter = context.names.parse(name)?;
        values.get(calibration.index_of(parameter)?).copied()
    };
    let factor = || report.residuals.iter().find(|summary| summary.factor.name() == name);
    match kind {
        NamedNumber::Sigma => parameter(&calibration.sigmas),
        NamedNumber::PriorSigma => parameter(&calibration.prior_sigmas),
        NamedNumber::Value => parameter(&calibration.values),
        NamedNumber::Joint => report.newest()?.joint_angles_rad.get(joint_index(name, context.names)?).copied(),
        NamedNumber::Margin => {
            let singularity = context.names.parse_singularity(name)?;
            calibration.margins.iter().find(|(known, _)| *known == singularity).map(|(_, margin)| *margin)
        }
        NamedNumber::Lost => {
            let rank = context.step.rank.as_ref()?;
            let count = match name {
                "parameterization" => rank.deficit_parameterization,
                "joints" => rank.deficit_joints,
                "absorbed" => rank.deficit_absorbed,
                "motion" => rank.deficit_motion,
                _ => return None,
            };
            Some(count as f64)
        }
        NamedNumber::Chi2 => factor().map(|summary| summary.chi2_after),
        NamedNumber::Nis => factor().and_then(ResidualSummary::mean_square),
    }
}

fn joint_index(name: &str, names: &ParameterNames) -> Option<usize> {
    names.joints.iter().position(|joint| joint == name)
}
