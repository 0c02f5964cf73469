//! What the steps of a run warned of, told once for all steps that say the same.

use std::sync::Arc;

use super::recording::StepRecord;
use crate::estimator::StepReport;

/// A warning in one wording, over all the steps that gave it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunWarning {
    /// What is wrong, and what to try.
    pub message: String,
    /// Header stamp of the first step that said so.
    pub first_ns: i64,
    /// How many steps said so.
    pub steps: usize,
}

/// The warnings of a run's steps in the order in which they first came.
pub(in crate::session) fn warnings_of(steps: &[Arc<StepRecord>]) -> Vec<RunWarning> {
    let mut warnings = Vec::new();
    for step in steps {
        add_warnings(&mut warnings, &step.report);
    }
    warnings
}

/// Adds what one more step warns of.
pub(in crate::session) fn add_warnings(warnings: &mut Vec<RunWarning>, report: &StepReport) {
    for message in &report.warnings {
        match warnings.iter_mut().find(|known| known.message == *message) {
            Some(known) => known.steps += 1,
            None => warnings.push(RunWarning { message: message.clone(), first_ns: report.stamp_ns, steps: 1 }),
        }
    }
}
