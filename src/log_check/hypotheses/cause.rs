//! Cause of a misfit as a finding.

use crate::log_check::measured_fault::MeasuredFault;
use crate::log_check::report::{Area, Severity};

/// Cause of a misfit in words.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::log_check) struct NamedCause {
    pub(in crate::log_check) severity: Severity,
    pub(in crate::log_check) area: Area,
    /// Names the cause with its value and time.
    pub(in crate::log_check) title: String,
    pub(in crate::log_check) remedy: String,
    pub(in crate::log_check) fault: Option<MeasuredFault>,
}

impl NamedCause {
    /// A cause without its value.
    pub(super) fn new(severity: Severity, area: Area, title: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { severity, area, title: title.into(), remedy: remedy.into(), fault: None }
    }
}
