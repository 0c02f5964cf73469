//! Verdicts on the calibration, withheld while a run is not trusted.

use super::answer::Answer;
use crate::observability::Determination;
use crate::session::record::{FlightParameter, Recording, RunRecord, flight_rows};
use crate::text::Named as _;

/// Reason for which verdicts of a run are withheld.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Withheld {
    /// Stamp from which on they are withheld, in nanoseconds since the log began; `i64::MIN` for the whole run.
    pub from_ns: i64,
    reason: String,
    remedy: String,
}

impl Answer {
    /// Reason for which the verdicts of the run are withheld; `None` for a trusted run, and for one about which only the
    /// ground truth raises a doubt.
    pub fn withheld(&self) -> Option<Withheld> {
        let of_estimate = || self.findings.iter().filter(|finding| !finding.is_about_ground_truth());
        let first = of_estimate().next()?;
        let trust = of_estimate().map(|finding| finding.trust).max()?;
        Some(Withheld {
            from_ns: of_estimate().map(|finding| finding.since_ns.unwrap_or(i64::MIN)).min()?,
            reason: format!("the run is {}: {}", trust.name(), first.statement),
            remedy: first.remedy.clone(),
        })
    }
}

impl Withheld {
    /// Verdict that is shown at a stamp.
    pub fn verdict(&self, stamp_ns: i64, verdict: Determination) -> Determination {
        let is_kept = matches!(verdict, Determination::Fixed | Determination::Initializing) || stamp_ns < self.from_ns;
        if is_kept { verdict } else { Determination::Unknown }
    }

    /// Withholds the verdicts of a calibration table.
    pub fn apply(&self, rows: &mut [FlightParameter]) {
        for row in rows {
            let verdict = self.verdict(i64::MAX, row.verdict);
            if verdict == Determination::Unknown {
                let since_ns = row.since_ns.map(|since_ns| since_ns.max(self.from_ns));
                (row.verdict, row.since_ns, row.cause) = (verdict, since_ns, None);
                (row.reason, row.remedy) = (self.reason.clone(), self.remedy.clone());
            }
        }
    }
}

/// Calibration table of a run after its last step: the same for window, report and files.
pub fn flight_table(recording: &Recording, run: &RunRecord) -> Vec<FlightParameter> {
    table_with(recording, run, &Answer::of_run(recording, run))
}

/// The same for a run whose answer is known.
pub(super) fn table_with(recording: &Recording, run: &RunRecord, answer: &Answer) -> Vec<FlightParameter> {
    let mut rows = flight_rows(recording, run);
    if let Some(withheld) = answer.withheld() {
        withheld.apply(&mut rows);
    }
    rows
}
