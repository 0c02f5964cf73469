//! Interval of time of a finding.

use serde::{Deserialize, Serialize};

/// Time in which a finding holds, in seconds since the log began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FindingInterval {
    /// `None` from the start of the log on.
    pub since_s: Option<f64>,
    /// `None` up to the end of the log.
    pub until_s: Option<f64>,
}
