//! Errors of a run against ground truth, as a diagnosis states them.

use serde::Serialize;

/// Errors against ground truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TruthAgreement {
    /// Root mean square of the position error after alignment.
    pub ate_m: f64,
    /// Mean normalized error squared of the poses, 6 for consistent covariances.
    pub nees: Option<f64>,
}

impl TruthAgreement {
    pub(in crate::session) fn text(&self) -> String {
        let nees = self.nees.map_or_else(String::new, |nees| format!(", NEES {nees:.1} (6 is consistent)"));
        format!("ATE {:.3} m{nees}", self.ate_m)
    }
}
