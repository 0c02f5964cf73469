//! Conditions on a step, and their evaluation.

use std::fmt;
use std::str::FromStr;

use super::language::StepQuantities;
use super::quantities::{NamedNumber, Quantity, StepFlag};
use crate::estimator::ResidualSummary;
use crate::gimbal::{ParameterId, ParameterNames};
use crate::session::record::StepRecord;
use crate::text::Named as _;
use crate::text::condition::{ConditionProblem, Predicate, TextRange, Values, parse};

/// A Boolean expression over the quantities of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    text: String,
    predicate: Predicate<Quantity, StepFlag>,
}

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

impl FromStr for Condition {
    type Err = ConditionProblem;

    fn from_str(text: &str) -> Result<Self, ConditionProblem> {
        Ok(Self { text: text.to_owned(), predicate: parse(text, &StepQuantities)? })
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.text)
    }
}

impl Condition {
    pub fn text(&self) -> &str {
        &self.text
    }

    /// True if the condition holds in the step; `None` if the step lacks a quantity that decides it.
    pub fn holds(&self, context: &StepContext<'_>) -> Option<bool> {
        self.predicate.holds(context)
    }

    /// Every quantity of the condition once, in textual order.
    pub fn values(&self, context: &StepContext<'_>) -> Vec<NamedValue> {
        let mut values: Vec<NamedValue> = Vec::new();
        self.visit(&mut |quantity, span| {
            let name: String = self.text.chars().skip(span.begin).take(span.end - span.begin).collect();
            if !values.iter().any(|known| known.name == name) {
                values.push(NamedValue { name, value: context.number(quantity).filter(|value| value.is_finite()) });
            }
        });
        values
    }

    /// Parameters and joints in the condition that are not in `names` and `parameters`. A condition on such a name is
    /// never true.
    pub fn unknown_names(&self, names: &ParameterNames, parameters: &[ParameterId]) -> Vec<String> {
        let mut unknown = Vec::new();
        self.visit(&mut |quantity, _| {
            if let Quantity::Named(kind, name) = quantity {
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

    /// Calls `visit` for every quantity from left to right, a rise before its argument.
    fn visit(&self, visit: &mut dyn FnMut(&Quantity, TextRange)) {
        fn with_argument(quantity: &Quantity, span: TextRange, visit: &mut dyn FnMut(&Quantity, TextRange)) {
            visit(quantity, span);
            if let Quantity::Rise(argument) = quantity {
                argument.visit(&mut |quantity, span| with_argument(quantity, span, visit));
            }
        }
        self.predicate.visit(&mut |quantity, span| with_argument(quantity, span, visit));
    }
}

impl Values<Quantity, StepFlag> for StepContext<'_> {
    const MISSING: Option<bool> = None;

    fn number(&self, quantity: &Quantity) -> Option<f64> {
        match quantity {
            Quantity::Plain(name) => name.of(self.step),
            Quantity::Named(kind, name) => named(*kind, name, self),
            Quantity::Singular(index) => self.step.rank.as_ref()?.singular_values.get(index.checked_sub(1)?).copied(),
            Quantity::Rise(argument) => {
                let before = StepContext { step: self.previous?, previous: None, names: self.names };
                Some(argument.value(self)? - argument.value(&before)?)
            }
        }
    }

    fn flag(&self, flag: &StepFlag) -> Option<bool> {
        Some(match flag {
            StepFlag::Literal(value) => *value,
            StepFlag::Named(flag) => flag.of(self.step),
            StepFlag::Event(kinds) => self.step.report.events.iter().any(|event| kinds.contains(&event.kind)),
        })
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
