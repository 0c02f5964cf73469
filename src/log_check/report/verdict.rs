//! The first lines of a check: whether results of the log can be trusted, and what to do first.

use std::fmt::{Display, Formatter, Result};

use serde::{Serialize, Serializer};

use super::{Area, Basis, CheckReport, Finding, Severity};
use crate::text::{Named, counted, printable};

/// Sentence about a log whose results nothing speaks against.
const NO_FAULT: &str = "No fault found in the log and its rig";
/// Number of findings that a verdict names.
const NAMED: usize = 3;

/// Trust in the results of a log or of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trust {
    /// Nothing speaks against the results.
    #[default]
    Trusted,
    /// Results are degraded, or something could not be verified.
    Doubtful,
    /// Results are invalid until a fault is corrected.
    NotUsable,
}

impl Named for Trust {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Trusted, "trusted"), (Self::Doubtful, "doubtful"), (Self::NotUsable, "not usable")];
}

impl Serialize for Trust {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name().replace(' ', "_"))
    }
}

impl Trust {
    /// Symbol before a sentence; unique without a colour.
    pub const fn mark(self) -> &'static str {
        match self {
            Self::Trusted => "✔",
            Self::Doubtful => "⚠",
            Self::NotUsable => "✖",
        }
    }

    /// Trust that a finding leaves; [`Self::Trusted`] for notes, and for values of the rig that are only assumed.
    pub fn after(finding: &Finding) -> Self {
        match finding.severity {
            Severity::Error => Self::NotUsable,
            Severity::Warning if finding.basis != Basis::Assumed => Self::Doubtful,
            Severity::Warning | Severity::Note | Severity::Good => Self::Trusted,
        }
    }

    /// First sentence of window, command line and report about results that are not trusted:
    /// `✖ Not usable: joint 'yaw' counts in the other direction than in the rig`.
    pub fn sentence(self, since_s: Option<f64>, statement: &str) -> String {
        let since = since_s.map_or_else(String::new, |since_s| format!(" since {since_s:.1} s"));
        let name = match self {
            Self::Trusted => "Trusted",
            Self::Doubtful => "Doubtful",
            Self::NotUsable => "Not usable",
        };
        format!("{} {name}{since}: {statement}", self.mark())
    }
}

/// Errors and warnings, the ones with the largest effect on a result first.
pub fn problems(findings: &[Finding]) -> Vec<&Finding> {
    let mut problems: Vec<&Finding> = findings.iter().filter(|it| it.severity >= Severity::Warning).collect();
    // Of one subject, a known cause precedes what may be its consequence.
    problems.sort_by_key(|it| {
        (std::cmp::Reverse(it.severity), it.basis == Basis::Assumed, effect(it.area), it.faults.is_empty())
    });
    problems
}

/// Statement of the findings with the largest effect, by their statements: the first one, or causes that are about equally
/// likely.
pub fn joint_statement(statements: &[&str]) -> String {
    let alternatives: Vec<&str> = statements.iter().map_while(|it| it.strip_prefix(MOST_LIKELY)).collect();
    match (alternatives.as_slice(), statements.first()) {
        ([first, others @ ..], _) => {
            others.iter().fold(format!("{MOST_LIKELY}{first}"), |all, other| format!("{all}, or {other}"))
        }
        ([], Some(first)) => (*first).to_owned(),
        ([], None) => String::new(),
    }
}

/// First words of the statement of a cause that is not the only one.
pub(crate) const MOST_LIKELY: &str = "most likely ";

/// Trust in the results of a log, with its most important findings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    pub trust: Trust,
    /// The verdict in one sentence.
    pub sentence: String,
    pub errors: usize,
    pub warnings: usize,
    /// At most three errors and warnings, those with the largest effect on a result first.
    pub first: Vec<Finding>,
}

impl Verdict {
    pub(crate) fn of(findings: &[Finding]) -> Self {
        let count = |severity: Severity| findings.iter().filter(|finding| finding.severity == severity).count();
        let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
        let trust = findings.iter().map(Trust::after).max().unwrap_or_default();
        let problems = problems(findings);
        let titles: Vec<&str> = problems.iter().map(|it| it.title.as_str()).collect();
        let sentence = match trust {
            Trust::Trusted => {
                let unverified = findings.iter().filter(|it| it.basis == Basis::Unverified);
                let limits: Vec<&str> = unverified.map(|it| it.title.as_str()).collect();
                let limits = limits.into_iter().fold(String::new(), |all, title| format!("{all}; {title}"));
                format!("{} {NO_FAULT}{limits}", trust.mark())
            }
            Trust::Doubtful | Trust::NotUsable => {
                trust.sentence(problems.first().and_then(|it| it.since_s()), &joint_statement(&titles))
            }
        };
        let first = problems.into_iter().take(NAMED).cloned().collect();
        Self { trust, sentence, errors, warnings, first }
    }
}

/// Rank of a subject by the effect of its faults on a result, the largest first: without data there is none; a wrong IMU
/// or camera model makes it diverge; wrong joints and clocks bias it; images and motion decide how precise it is.
fn effect(area: Area) -> u8 {
    match area {
        Area::Log => 0,
        Area::Imu => 1,
        Area::Intrinsics => 2,
        Area::Encoders => 3,
        Area::Extrinsics => 4,
        Area::Time => 5,
        Area::Images => 6,
        Area::Motion => 7,
    }
}

impl CheckReport {
    /// Trust in the results of the log, with the findings that matter most.
    pub fn verdict(&self) -> Verdict {
        Verdict::of(&self.findings)
    }
}

impl Display for Verdict {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        writeln!(out, "{}", printable(&self.sentence))?;
        if self.errors + self.warnings > 0 {
            writeln!(out, "  {} and {}", counted(self.errors, "error"), counted(self.warnings, "warning"))?;
        }
        for (number, finding) in self.first.iter().enumerate() {
            write!(out, "  {}. {}", number + 1, printable(&finding.title))?;
            if !finding.remedy.is_empty() {
                write!(out, "\n     → {}", printable(&finding.remedy))?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log_check::FindingInterval;

    fn finding(severity: Severity, area: Area, title: &str) -> Finding {
        Finding {
            severity,
            area,
            title: title.to_owned(),
            evidence: "3 of 7".to_owned(),
            remedy: format!("mend {title}"),
            interval: FindingInterval::default(),
            basis: Basis::Measured,
            faults: Vec::new(),
        }
    }

    #[test]
    fn a_verdict_without_faults_says_what_is_not_verified() {
        let unverified =
            Finding { basis: Basis::Unverified, ..finding(Severity::Note, Area::Intrinsics, "no focal length") };
        let verdict = Verdict::of(&[finding(Severity::Good, Area::Imu, "gravity"), unverified]);
        assert_eq!((verdict.trust, verdict.warnings), (Trust::Trusted, 0));
        assert_eq!(verdict.sentence, "✔ No fault found in the log and its rig; no focal length");
    }

    #[test]
    fn the_verdict_names_what_matters_most_first() {
        let assumed = Finding { basis: Basis::Assumed, ..finding(Severity::Warning, Area::Imu, "noise") };
        let mut findings = vec![
            finding(Severity::Note, Area::Log, "topics"),
            finding(Severity::Warning, Area::Images, "blur"),
            assumed,
            finding(Severity::Warning, Area::Time, "delay"),
        ];
        let verdict = Verdict::of(&findings);
        assert_eq!(verdict.trust, Trust::Doubtful);
        let titles = |verdict: &Verdict| verdict.first.iter().map(|it| it.title.clone()).collect::<Vec<_>>();
        assert_eq!(titles(&verdict), ["delay", "blur", "noise"]);
        findings.push(finding(Severity::Error, Area::Encoders, "joint"));
        let verdict = Verdict::of(&findings);
        assert_eq!(verdict.trust, Trust::NotUsable);
        assert_eq!(titles(&verdict), ["joint", "delay", "blur"]);
        let text = verdict.to_string();
        assert!(
            text.starts_with("✖ Not usable: joint\n  1 error and 3 warnings\n  1. joint\n     → mend joint\n"),
            "{text}"
        );
        assert_eq!(Verdict::of(&findings[..1]).to_string(), "✔ No fault found in the log and its rig\n");
        // An assumed value alone is no reason to doubt.
        assert_eq!(Verdict::of(&findings[2..3]).trust, Trust::Trusted);
        let either = ["most likely A", "most likely B"].map(|title| finding(Severity::Error, Area::Imu, title));
        assert_eq!(Verdict::of(&either).sentence, "✖ Not usable: most likely A, or B");
    }
}
