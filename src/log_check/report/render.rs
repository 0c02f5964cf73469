use std::fmt::{Display, Formatter, Result};

use super::{CheckReport, Severity};
use crate::table::text::{TextTable, left, right};
use crate::text::{printable, shortened, without_signed_zeros};

/// Text report: the verdict, a table of topics, then all findings, most severe first.
impl Display for CheckReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let rig = self.rig.as_deref().map_or_else(|| "no rig".to_owned(), |name| format!("rig {name}"));
        writeln!(out, "{}: {:.3} s, {rig}", self.log, self.duration_s)?;
        write!(out, "{}", self.verdict())?;
        writeln!(out)?;
        let texts = ["topic", "type", "role"].map(|heading| left(heading, 0));
        let numbers = ["messages", "Hz", "first, s", "last, s", "delay, ms"].map(|heading| right(heading, 0));
        let rows = self.topics.iter().map(|topic| {
            [
                shortened(&topic.topic, WIDEST_NAME).into_owned(),
                shortened(&topic.schema, WIDEST_NAME).into_owned(),
                topic.role.clone(),
                topic.count.to_string(),
                format!("{:.1}", topic.rate_hz),
                time_cell(topic.first_s),
                time_cell(topic.last_s),
                topic
                    .latency_s
                    .map_or_else(String::new, |latency| without_signed_zeros(format!("{:.1}", latency * 1e3))),
            ]
        });
        write!(out, "{}", TextTable::new(texts.into_iter().chain(numbers), rows))?;
        for severity in [Severity::Error, Severity::Warning, Severity::Note, Severity::Good] {
            let findings: Vec<_> = self.findings.iter().filter(|finding| finding.severity == severity).collect();
            if findings.is_empty() {
                continue;
            }
            writeln!(out)?;
            for finding in findings {
                write!(
                    out,
                    "{:<8}{:<11} {}: {}",
                    severity.label(),
                    finding.area.label(),
                    printable(&finding.title),
                    printable(&finding.evidence)
                )?;
                if !finding.remedy.is_empty() {
                    write!(out, "\n{:20}→ {}", "", printable(&finding.remedy))?;
                }
                writeln!(out)?;
            }
        }
        Ok(())
    }
}

/// Time in seconds, `unset` for one that no clock has.
fn time_cell(time_s: f64) -> String {
    /// 63 years: stamps that were never set are farther from the stamps of a log.
    const FARTHEST_S: f64 = 2e9;
    if time_s.abs() > FARTHEST_S { "unset".to_owned() } else { without_signed_zeros(format!("{time_s:.3}")) }
}

/// Characters of a topic or a type in the table; longer ones are truncated.
const WIDEST_NAME: usize = 60;
