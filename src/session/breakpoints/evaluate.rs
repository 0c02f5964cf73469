//! Whether a condition holds in a step.

use super::expression::{Arithmetic, Condition, Number, Span, Truth};
use super::quantities::NamedNumber;
use crate::estimator::ResidualSummary;
use crate::sensors::Rig;
use crate::session::record::StepRecord;

/// A step as a condition sees it.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// The step; its outline will do.
    pub step: &'a StepRecord,
    /// The step before it.
    pub previous: Option<&'a StepRecord>,
    /// The rig, which names the joints.
    pub rig: &'a Rig,
}

/// A quantity of a condition with its value in a step.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedValue {
    /// As written in the condition.
    pub name: String,
    /// Its value; `None` where the step has none.
    pub value: Option<f64>,
}

impl Condition {
    /// Whether it holds, `None` when the step lacks what decides it.
    pub fn holds(&self, moment: &Moment<'_>) -> Option<bool> {
        self.truth.holds(moment)
    }

    /// Every quantity that is asked for, once, in the order of the text.
    pub fn values(&self, moment: &Moment<'_>) -> Vec<NamedValue> {
        let mut parts = Vec::new();
        self.truth.visit(&mut |span, number| parts.push((span, number.value(moment))));
        let mut values: Vec<NamedValue> = Vec::new();
        for (span, value) in parts {
            let name: String = self.text.chars().skip(span.begin).take(span.end - span.begin).collect();
            if !values.iter().any(|known| known.name == name) {
                values.push(NamedValue { name, value });
            }
        }
        values
    }

    /// Parameters and joints that it names and that are not among these; a name of neither kind can never be found.
    pub fn unknown_names(&self, rig: &Rig, parameters: &[String]) -> Vec<String> {
        let mut unknown = Vec::new();
        self.truth.visit(&mut |_, number| {
            if let Number::Named(kind, name, _) = number {
                let known = match kind {
                    NamedNumber::Sigma | NamedNumber::PriorSigma | NamedNumber::Value => {
                        parameters.contains(&column_name(name, rig))
                    }
                    NamedNumber::Joint => joint_index(name, rig).is_some(),
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

impl Truth {
    fn holds(&self, moment: &Moment<'_>) -> Option<bool> {
        match self {
            Self::Literal(truth) => Some(*truth),
            Self::Flag(flag) => Some(flag.of(moment.step)),
            Self::Event(kinds, _) => Some(moment.step.report.events.iter().any(|event| kinds.contains(&event.kind))),
            Self::Compared(comparison, left, right) => {
                Some(comparison.holds(left.value(moment)?, right.value(moment)?))
            }
            Self::Not(inner) => inner.holds(moment).map(|truth| !truth),
            // What is missing decides nothing where the other side decides alone.
            Self::And(left, right) => match (left.holds(moment), right.holds(moment)) {
                (Some(false), _) | (_, Some(false)) => Some(false),
                (Some(true), Some(true)) => Some(true),
                _ => None,
            },
            Self::Or(left, right) => match (left.holds(moment), right.holds(moment)) {
                (Some(true), _) | (_, Some(true)) => Some(true),
                (Some(false), Some(false)) => Some(false),
                _ => None,
            },
        }
    }

    /// Calls for every quantity of the step, from left to right.
    fn visit<'a>(&'a self, visit: &mut impl FnMut(Span, &'a Number)) {
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
    fn value(&self, moment: &Moment<'_>) -> Option<f64> {
        let value = match self {
            Self::Literal(value) => *value,
            Self::Quantity(name, _) => name.of(moment.step)?,
            Self::Named(kind, name, _) => named(*kind, name, moment)?,
            Self::Singular(index, _) => *moment.step.rank.as_ref()?.singular_values.get(index.checked_sub(1)?)?,
            Self::Rise(inner, _) => {
                let before = Moment { step: moment.previous?, previous: None, rig: moment.rig };
                inner.value(moment)? - inner.value(&before)?
            }
            Self::Negated(inner) => -inner.value(moment)?,
            Self::Absolute(inner) => inner.value(moment)?.abs(),
            Self::Combined(arithmetic, left, right) => {
                let (left, right) = (left.value(moment)?, right.value(moment)?);
                match arithmetic {
                    Arithmetic::Sum => left + right,
                    Arithmetic::Difference => left - right,
                    Arithmetic::Product => left * right,
                    Arithmetic::Quotient => left / right,
                    Arithmetic::Least => left.min(right),
                    Arithmetic::Greatest => left.max(right),
                }
            }
        };
        value.is_finite().then_some(value)
    }

    fn visit<'a>(&'a self, visit: &mut impl FnMut(Span, &'a Self)) {
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

fn named(kind: NamedNumber, name: &str, moment: &Moment<'_>) -> Option<f64> {
    let report = &moment.step.report;
    let calibration = &report.calibration;
    let parameter = |values: &[f64]| {
        let column = column_name(name, moment.rig);
        values.get(calibration.names.iter().position(|known| *known == column)?).copied()
    };
    let factor = || report.residuals.iter().find(|summary| summary.factor.replace(' ', "_") == name);
    match kind {
        NamedNumber::Sigma => parameter(&calibration.sigmas),
        NamedNumber::PriorSigma => parameter(&calibration.prior_sigmas),
        NamedNumber::Value => parameter(&calibration.values),
        NamedNumber::Joint => report.newest()?.joint_angles_rad.get(joint_index(name, moment.rig)?).copied(),
        NamedNumber::Margin => calibration.margins.iter().find(|(known, _)| known == name).map(|(_, margin)| *margin),
        NamedNumber::Lost => {
            let rank = moment.step.rank.as_ref()?;
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

/// The column that a parameter is called by in the reports: `yaw.alpha` is `L1.alpha` where yaw is the first joint.
pub(in crate::session) fn column_name(name: &str, rig: &Rig) -> String {
    let of_joint = name.rsplit_once('.').and_then(|(joint, quantity)| {
        let number = joint_index(joint, rig)? + 1;
        Some(format!("L{number}.{quantity}"))
    });
    of_joint.unwrap_or_else(|| name.to_owned())
}

fn joint_index(name: &str, rig: &Rig) -> Option<usize> {
    rig.gimbal.as_ref()?.joints.iter().position(|joint| joint.name == name)
}
