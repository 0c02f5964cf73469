//! The warnings of a run's steps, equal ones once.

use std::sync::Arc;

use super::step::StepRecord;
use crate::estimator::{StepReport, StepWarning};

/// A warning and the steps that reported it.
#[derive(Clone, Debug, PartialEq)]
pub struct RunWarning {
    /// The problem and its remedy.
    pub warning: StepWarning,
    /// Header stamp of the first step that reported it.
    pub first_ns: i64,
    /// Header stamp of the last step that reported it.
    pub last_ns: i64,
    /// Number of steps that reported it.
    pub steps: usize,
}

/// The warnings of a run's steps, ordered by their first step.
pub(in crate::session) fn warnings_of(steps: &[Arc<StepRecord>]) -> Vec<RunWarning> {
    let mut warnings = Vec::new();
    for step in steps {
        add_warnings(&mut warnings, &step.report);
    }
    warnings
}

/// Adds the warnings of one more step.
pub(in crate::session) fn add_warnings(warnings: &mut Vec<RunWarning>, report: &StepReport) {
    for warning in &report.warnings {
        match warnings.iter_mut().find(|known| known.warning == *warning) {
            Some(known) => {
                known.steps += 1;
                known.last_ns = report.stamp_ns;
            }
            None => warnings.push(RunWarning {
                warning: warning.clone(),
                first_ns: report.stamp_ns,
                last_ns: report.stamp_ns,
                steps: 1,
            }),
        }
    }
}
