//! The first lines of a check: whether the log can be used, and what to do first.

use std::fmt::{Display, Formatter, Result};

use serde::Serialize;

use super::{Area, CheckReport, Finding, Severity};
use crate::text::{counted, printable};

/// Number of findings that a verdict names.
const NAMED: usize = 3;

/// Trust in the results of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Usability {
    /// No errors and no warnings.
    Usable,
    /// Warnings only: results are degraded, or something could not be verified.
    UsableWithCare,
    /// An error makes results invalid until it is corrected.
    NotUsable,
}

/// Usability of a log with its most important findings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    pub usability: Usability,
    pub errors: usize,
    pub warnings: usize,
    /// At most three errors and warnings, those with the largest effect on a result first.
    pub first: Vec<Finding>,
}

impl Verdict {
    pub(crate) fn of(findings: &[Finding]) -> Self {
        let count = |severity: Severity| findings.iter().filter(|finding| finding.severity == severity).count();
        let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
        let usability = match (errors, warnings) {
            (0, 0) => Usability::Usable,
            (0, _) => Usability::UsableWithCare,
            _ => Usability::NotUsable,
        };
        let mut problems: Vec<&Finding> =
            findings.iter().filter(|finding| finding.severity >= Severity::Warning).collect();
        problems
            .sort_by_key(|finding| (std::cmp::Reverse(finding.severity), finding.is_assumption, effect(finding.area)));
        let first = problems.into_iter().take(NAMED).cloned().collect();
        Self { usability, errors, warnings, first }
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
    /// Usability of the log with the findings that matter most.
    pub fn verdict(&self) -> Verdict {
        Verdict::of(&self.findings)
    }
}

impl Display for Verdict {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let (errors, warnings) = (counted(self.errors, "error"), counted(self.warnings, "warning"));
        match self.usability {
            Usability::Usable => writeln!(out, "usable: no errors and no warnings")?,
            Usability::UsableWithCare => writeln!(out, "usable with care: {warnings}")?,
            Usability::NotUsable => writeln!(out, "not usable as it is: {errors} and {warnings}")?,
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

    fn finding(severity: Severity, area: Area, title: &str) -> Finding {
        Finding {
            severity,
            area,
            title: title.to_owned(),
            evidence: "3 of 7".to_owned(),
            remedy: format!("mend {title}"),
            is_assumption: false,
            faults: Vec::new(),
        }
    }

    #[test]
    fn the_verdict_names_what_matters_most_first() {
        let assumed = Finding { is_assumption: true, ..finding(Severity::Warning, Area::Imu, "noise") };
        let mut findings = vec![
            finding(Severity::Note, Area::Log, "topics"),
            finding(Severity::Warning, Area::Images, "blur"),
            assumed,
            finding(Severity::Warning, Area::Time, "delay"),
        ];
        let verdict = Verdict::of(&findings);
        assert_eq!(verdict.usability, Usability::UsableWithCare);
        let titles = |verdict: &Verdict| verdict.first.iter().map(|it| it.title.clone()).collect::<Vec<_>>();
        assert_eq!(titles(&verdict), ["delay", "blur", "noise"]);
        findings.push(finding(Severity::Error, Area::Encoders, "joint"));
        let verdict = Verdict::of(&findings);
        assert_eq!(verdict.usability, Usability::NotUsable);
        assert_eq!(titles(&verdict), ["joint", "delay", "blur"]);
        let text = verdict.to_string();
        assert!(
            text.starts_with("not usable as it is: 1 error and 3 warnings\n  1. joint\n     → mend joint\n"),
            "{text}"
        );
        assert_eq!(Verdict::of(&findings[..1]).to_string(), "usable: no errors and no warnings\n");
    }
}
