//! Result of a diagnosis, as text and as JSON.

use std::fmt;

use serde::{Serialize, Serializer};

use super::truth_agreement::TruthAgreement;

use crate::faults::{FaultKind, Severity};
use crate::log_check::{Finding, MOST_LIKELY, joint_statement};
use crate::session::misfit::AgreementValue;
use crate::session::plan::ForkChanges;
use crate::text::Named as _;

/// Conclusion of a diagnosis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisVerdict {
    /// The residuals agree with their noise: no cause is looked for.
    Agrees,
    /// One cause explains the residuals.
    Cause,
    /// A few causes explain the residuals about as well.
    Several,
    /// The check of the log measures a fault that no change of a run undoes.
    LogFault,
    /// No tried cause explains the residuals.
    Unexplained,
    /// No image reached the estimator.
    #[default]
    NoSteps,
}

/// Cause that was tried, with the fork that undoes it and what it leaves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RankedCause {
    #[serde(serialize_with = "key")]
    pub cause: FaultKind,
    /// The cause with its value.
    pub statement: String,
    pub remedy: String,
    /// Changes of a fork that undo the cause.
    #[serde(serialize_with = "text")]
    pub changes: ForkChanges,
    /// Stamp of the fork's first step, in nanoseconds and in seconds since the log began.
    #[serde(skip)]
    pub from_ns: i64,
    pub from_s: f64,
    /// Stamp from which on the cause acts, in nanoseconds since the log began; `None` for the whole run.
    #[serde(skip)]
    pub since_ns: Option<i64>,
    /// Number of values that the cause takes from the recording.
    pub parameters: usize,
    /// True if the search has found no value of the cause: the value of `changes` is the best one of a coarse search.
    pub beyond_search: bool,
    /// Decrease of −2·ln of the likelihood against the run without a change, less the penalty of the parameters.
    pub gain: f64,
    /// Values of the run with the change, over the scored steps.
    pub values: Vec<AgreementValue>,
    /// Against ground truth, if there is one.
    pub accuracy: Option<TruthAgreement>,
}

fn key<S: Serializer>(cause: &FaultKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(cause.name())
}

fn keys<S: Serializer>(causes: &[FaultKind], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(causes.iter().map(|cause| cause.name()))
}

fn text<S: Serializer>(changes: &ForkChanges, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(changes)
}

/// A reason for which attempts to initialize waited.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct WaitingReason {
    pub reason: String,
    /// Number of images at which it was a reason.
    pub images: usize,
}

/// Agreement of a run with its noise, and the causes of a disagreement, best first.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Diagnosis {
    /// File name of the log.
    pub log: String,
    /// Specification of the run.
    pub run: String,
    pub verdict: DiagnosisVerdict,
    /// At most three errors and warnings of the log's check, those with the largest effect first.
    pub log_faults: Vec<Finding>,
    /// True if the causes undo faults that the check of the log measures: no others were tried.
    pub measured: bool,
    /// Values of the whole run with their limits.
    pub values: Vec<AgreementValue>,
    /// Stamp from which on the residuals disagree after they agreed, in seconds since the log began.
    pub onset_s: Option<f64>,
    /// Reasons of the attempts of a run that never initialized, the most frequent first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub waiting: Vec<WaitingReason>,
    pub accuracy: Option<TruthAgreement>,
    /// Disagreement of the ground truth with a run whose residuals agree.
    pub ground_truth: Option<String>,
    /// Steps that were computed again for each cause, as stamps in seconds.
    pub span_s: Option<(f64, f64)>,
    /// Number of causes of `causes` that explain the residuals: 0, 1, or a few.
    pub explaining: usize,
    /// Causes with the largest gain, the best first.
    pub causes: Vec<RankedCause>,
    pub trials: usize,
    /// True if it was interrupted before the last trial.
    pub interrupted: bool,
    /// Processor time in seconds after which the trials ended before the last one, `None` if they were completed or interrupted.
    pub ended_after_s: Option<f64>,
    /// Keys of the causes that an interrupt or the end of the processor time left untried.
    #[serde(serialize_with = "keys", skip_serializing_if = "Vec::is_empty")]
    pub not_tried: Vec<FaultKind>,
}

/// Remark in place of trials about a fault that only a correction of the log undoes.
const ONLY_IN_LOG: &str = "no change of a run undoes this fault: correct it in the log, then diagnose again";
/// Causes that a text lists beside those that explain the residuals.
const LISTED: usize = 4;

impl fmt::Display for Diagnosis {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "{} on {}: {}", self.run, self.log, self.headline())?;
        let wrong = self.values.iter().filter(|value| !value.agrees());
        let named: Vec<String> = wrong.map(described).collect();
        if !named.is_empty() {
            let since = self.onset_s.map_or_else(String::new, |onset_s| format!("; they agree until {onset_s:.2} s"));
            writeln!(out, "  residuals    {}{since}", named.join(", "))?;
        }
        for fault in &self.log_faults {
            writeln!(out, "  log          {}: {}", fault.severity.label(), fault.title)?;
            if !fault.remedy.is_empty() {
                writeln!(out, "     remedy     {}", fault.remedy)?;
            }
        }
        if self.verdict == DiagnosisVerdict::LogFault {
            writeln!(out, "  no trials    {ONLY_IN_LOG}")?;
        }
        for waiting in self.waiting.iter().take(3) {
            writeln!(out, "  waits        {} ({} images)", waiting.reason, waiting.images)?;
        }
        if let Some(accuracy) = self.accuracy {
            writeln!(out, "  accuracy     {}", accuracy.text())?;
        }
        if let Some(text) = &self.ground_truth {
            writeln!(out, "  ground truth {text}")?;
        }
        for (place, cause) in self.causes.iter().take(self.explaining.max(LISTED)).enumerate() {
            let mark = if place < self.explaining { "→" } else { " " };
            writeln!(out, "{mark} {}. {} (gain {:.0}, {})", place + 1, cause.statement, cause.gain, cause.text())?;
            if place < self.explaining {
                writeln!(out, "     fork       {} at {:.2} s", cause.changes, cause.from_s)?;
                writeln!(out, "     remedy     {}", cause.remedy)?;
            }
        }
        self.tried().map_or(Ok(()), |text| writeln!(out, "  tried        {text}"))
    }
}

impl Diagnosis {
    /// Diagnosis of a run of which nothing is known yet.
    pub(in crate::session) fn before_trials(run: String) -> Self {
        Self { run, ..Self::default() }
    }

    /// True if an interrupt left causes or refined values untried.
    pub fn is_open(&self) -> bool {
        self.interrupted && !matches!(self.verdict, DiagnosisVerdict::Agrees | DiagnosisVerdict::LogFault)
    }

    /// The finding in one sentence: a fault that the check of the log measures precedes what the trials explain.
    pub fn headline(&self) -> String {
        if !self.is_open() {
            return self.headline_of_all();
        }
        let is_known = matches!(self.verdict, DiagnosisVerdict::Cause | DiagnosisVerdict::Several);
        let known = if is_known { self.headline_of_all() } else { "no cause found".to_owned() };
        let open = match self.not_tried_in_words() {
            open if !open.is_empty() => open,
            _ if self.trials == 0 => "any cause".to_owned(),
            _ => "refined values".to_owned(),
        };
        format!("stopped; so far {known}; not tried: {open}")
    }

    /// Number of trials, their span and the causes that were left out, as text; `None` without trials.
    fn tried(&self) -> Option<String> {
        let (from_s, to_s) = self.span_s?;
        let ended = match self.ended_after_s {
            _ if self.interrupted => "; stopped early".to_owned(),
            Some(after_s) => format!("; ended after about {after_s:.0} s of processor time{}", self.left_out()),
            None if self.measured => ", for the faults that the check measures".to_owned(),
            None => String::new(),
        };
        Some(format!("{} changes from {from_s:.2} to {to_s:.2} s{ended}", self.trials))
    }

    /// Sentence about the trials and what they left out, or why there are none; `None` for a run without residuals.
    pub fn trials_in_words(&self) -> Option<String> {
        let is_in_log = self.verdict == DiagnosisVerdict::LogFault;
        self.tried().map(|text| format!("tried {text}")).or_else(|| is_in_log.then(|| ONLY_IN_LOG.to_owned()))
    }

    fn not_tried_in_words(&self) -> String {
        self.not_tried.iter().map(|cause| cause.name().replace('_', " ")).collect::<Vec<_>>().join(", ")
    }

    /// Causes that were left out, as the end of a sentence.
    fn left_out(&self) -> String {
        let open = self.not_tried_in_words();
        if open.is_empty() { ", with fewer values".to_owned() } else { format!("; not tried: {open}") }
    }

    fn headline_of_all(&self) -> String {
        let of_trials = self.headline_of_trials();
        if self.measured {
            return format!("{of_trials}, by the check of the log and by the trials");
        }
        let is_named = |fault: &&Finding| fault.severity == Severity::Error || !fault.faults.is_empty();
        match self.log_faults.iter().find(is_named) {
            Some(fault) if self.verdict == DiagnosisVerdict::Agrees => {
                format!("the residuals agree with their noise; the check of the log says: {}", fault.title)
            }
            Some(fault) if self.verdict == DiagnosisVerdict::LogFault => {
                format!("{}, by the check of the log", fault.title)
            }
            Some(fault) => format!("{}, by the check of the log; by the trials: {of_trials}", fault.title),
            None => of_trials,
        }
    }

    fn headline_of_trials(&self) -> String {
        let first = || self.causes.first().map_or_else(String::new, |cause| cause.statement.clone());
        match self.verdict {
            DiagnosisVerdict::Agrees if self.ground_truth.is_some() => {
                "the residuals agree with their noise; the ground truth disagrees with the estimate".to_owned()
            }
            DiagnosisVerdict::Agrees => "nothing to diagnose: the residuals agree with their noise".to_owned(),
            DiagnosisVerdict::Cause => first(),
            DiagnosisVerdict::Several => self.alternatives(),
            DiagnosisVerdict::LogFault => "the log has a fault that no change of a run undoes".to_owned(),
            DiagnosisVerdict::Unexplained => {
                "unexplained: no tried change brings the residuals back to their noise".to_owned()
            }
            DiagnosisVerdict::NoSteps => "no image reached the estimator: see dcvins check".to_owned(),
        }
    }
}

impl Diagnosis {
    /// Causes that explain the residuals about equally well, in one sentence.
    fn alternatives(&self) -> String {
        let causes = self.causes.iter().take(self.explaining).map(RankedCause::as_alternative).collect::<Vec<_>>();
        joint_statement(&causes.iter().map(String::as_str).collect::<Vec<_>>())
    }
}

impl RankedCause {
    /// Statement of a cause that is not the only one.
    pub(in crate::session) fn as_alternative(&self) -> String {
        format!("{MOST_LIKELY}{}", self.statement)
    }

    /// Agreement that the cause leaves.
    pub(in crate::session) fn text(&self) -> String {
        let wrong: Vec<String> = self.values.iter().filter(|value| !value.agrees()).map(described).collect();
        let left = if wrong.is_empty() { "residuals agree".to_owned() } else { format!("left: {}", wrong.join(", ")) };
        self.accuracy.map_or_else(|| left.clone(), |accuracy| format!("{left}; {}", accuracy.text()))
    }
}

fn described(value: &AgreementValue) -> String {
    format!("{} {:.2} > {}", value.name, value.value, value.limit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::{Area, Fault};
    use crate::log_check::{Basis, FindingInterval};

    #[test]
    fn an_error_of_the_log_precedes_what_the_trials_say() {
        let fault = |severity| Finding {
            severity,
            area: Area::Encoders,
            title: "the heading of /vehicle/attitude steps by +20.1° at 4.00 s".to_owned(),
            evidence: String::new(),
            remedy: "take an attitude whose heading does not step".to_owned(),
            interval: FindingInterval::default(),
            basis: Basis::Measured,
            faults: Vec::new(),
        };
        let mut diagnosis = Diagnosis {
            verdict: DiagnosisVerdict::Unexplained,
            log_faults: vec![fault(Severity::Error)],
            ..Diagnosis::before_trials("auto".to_owned())
        };
        let headline = diagnosis.headline();
        assert!(headline.starts_with("the heading of /vehicle/attitude steps by +20.1° at 4.00 s, by the check"));
        let text = diagnosis.to_string();
        assert!(text.contains("  log          error: the heading"), "{text}");
        assert!(text.contains("  remedy     take an attitude"), "{text}");
        diagnosis.log_faults = vec![fault(Severity::Warning)];
        assert!(diagnosis.headline().starts_with("unexplained"), "{}", diagnosis.headline());
        assert!(diagnosis.to_string().contains("  log          warning: the heading"));
        diagnosis.verdict = DiagnosisVerdict::Agrees;
        assert!(diagnosis.headline().starts_with("nothing to diagnose"), "{}", diagnosis.headline());
        diagnosis.log_faults[0].faults = vec![Fault::new(FaultKind::JointScale, &[2.0])];
        assert!(diagnosis.headline().contains("agree with their noise; the check of the log says: the heading"));
    }
}
