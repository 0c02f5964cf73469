//! Warnings of the log and its runs, with one line for each kind.

use super::recording::Recording;
use super::run::RunRecord;
use crate::flight_log::LogWarning;
use crate::geometry::seconds_from_ns;

/// Words before numbers that say where or when, not how bad.
const PLACE_WORDS: [&str; 7] = ["at", "from", "to", "image", "second", "message", "byte"];

/// Warnings of one source that differ only in their numbers.
#[derive(Debug)]
pub struct WarningLine<'a> {
    /// Label of the run; `None` for the log.
    run: Option<&'a str>,
    /// The message with the largest values, the first of those.
    message: &'a str,
    pub first_ns: i64,
    last_ns: i64,
    /// Number of warnings of the log, or of steps of the run with the warning.
    count: usize,
    /// True if the messages have different values.
    varies: bool,
}

impl WarningLine<'_> {
    /// Message with the count, the time span, and a remark if it is the worst of several.
    fn without_run(&self) -> String {
        let Self { message, first_ns, last_ns, count, .. } = self;
        if *count == 1 {
            return (*message).to_owned();
        }
        let noun = if self.run.is_none() { "warnings" } else { "steps" };
        let (first_s, last_s) = (seconds_from_ns(*first_ns), seconds_from_ns(*last_ns));
        let worst = if self.varies { "; the worst is shown" } else { "" };
        format!("{message} ({count} {noun}, {first_s:.3}–{last_s:.3} s{worst})")
    }

    /// Message with its run, the count and the time span.
    pub fn text(&self) -> String {
        let run = self.run.map_or_else(String::new, |run| format!("{run}: "));
        format!("{run}{}", self.without_run())
    }

    /// Text behind the time of the first warning, without the run.
    pub fn with_time(&self) -> String {
        format!("{:.3} s: {}", seconds_from_ns(self.first_ns), self.without_run())
    }

    fn add(&mut self, next: &Self) {
        let (known, new) = (values(self.message), values(next.message));
        self.varies |= next.varies || known != new;
        if new.iter().partial_cmp(&known) == Some(std::cmp::Ordering::Greater) {
            self.message = next.message;
        }
        self.first_ns = self.first_ns.min(next.first_ns);
        self.last_ns = self.last_ns.max(next.last_ns);
        self.count += next.count;
    }
}

/// Lines of all warnings, those of the log first, each source in the order of the first stamps.
pub fn warning_lines(recording: &Recording) -> Vec<WarningLine<'_>> {
    let mut lines = log_warning_lines(&recording.warnings);
    lines.extend(recording.runs.iter().flat_map(run_warning_lines));
    lines
}

/// Lines of the warnings of a log.
pub fn log_warning_lines(warnings: &[LogWarning]) -> Vec<WarningLine<'_>> {
    merged(warnings.iter().map(|warning| WarningLine {
        run: None,
        message: &warning.message,
        first_ns: warning.stamp_ns,
        last_ns: warning.stamp_ns,
        count: 1,
        varies: false,
    }))
}

/// Lines of the warnings of a run's steps.
pub(super) fn run_warning_lines(run: &RunRecord) -> Vec<WarningLine<'_>> {
    merged(run.warnings.iter().map(|warning| WarningLine {
        run: Some(&run.spec.label),
        message: &warning.message,
        first_ns: warning.first_ns,
        last_ns: warning.last_ns,
        count: warning.steps,
        varies: false,
    }))
}

fn merged<'a>(warnings: impl Iterator<Item = WarningLine<'a>>) -> Vec<WarningLine<'a>> {
    let mut lines: Vec<WarningLine<'a>> = Vec::new();
    for next in warnings {
        match lines.iter_mut().find(|line| is_repeated(line.message, next.message)) {
            Some(line) => line.add(&next),
            None => lines.push(next),
        }
    }
    lines
}

/// True if two messages are equal except for their numbers.
fn is_repeated(message: &str, other: &str) -> bool {
    let of_number = |byte: &u8| byte.is_ascii_digit() || b".+-".contains(byte);
    message.bytes().filter(|byte| !of_number(byte)).eq(other.bytes().filter(|byte| !of_number(byte)))
}

/// Numbers of a message in their order, without times and other places.
fn values(message: &str) -> Vec<f64> {
    let words: Vec<&str> = message.split_whitespace().collect();
    let is_place = |index: usize| index > 0 && PLACE_WORDS.contains(&words[index - 1]);
    let number = |index: usize| words[index].trim_matches([',', ';', '(', ')']).parse::<f64>().ok();
    (0..words.len()).filter(|index| !is_place(*index)).filter_map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_of_warning_is_one_line_with_count_time_span_and_worst_value() {
        let warning = |stamp_ns, message: &str| LogWarning { stamp_ns, message: message.to_owned() };
        let warnings = [
            warning(1_000_000_000, "no IMU sample for 0.034 s from 1.000 s on"),
            warning(2_000_000_000, "image left out"),
            warning(3_500_000_000, "no IMU sample for 0.2 s from 3.500 s on"),
            warning(4_500_000_000, "no IMU sample for 0.04 s from 4.500 s on"),
            warning(5_000_000_000, "image 7 at 5.000 s skipped: it has 580×360 pixels"),
            warning(6_000_000_000, "image 8 at 6.000 s skipped: it has 580×360 pixels"),
        ];
        let lines = log_warning_lines(&warnings);
        let texts: Vec<String> = lines.iter().map(WarningLine::with_time).collect();
        assert_eq!(
            texts,
            [
                "1.000 s: no IMU sample for 0.2 s from 3.500 s on (3 warnings, 1.000–4.500 s; the worst is shown)",
                "2.000 s: image left out",
                "5.000 s: image 7 at 5.000 s skipped: it has 580×360 pixels (2 warnings, 5.000–6.000 s)",
            ]
        );
    }
}
