//! Warnings of the log and its runs, with one line for repeated ones.

use crate::gui::units::{counted, seconds};
use crate::session::Recording;

/// Warnings of one source that differ only in their numbers.
#[derive(Debug)]
pub(super) struct WarningLine<'a> {
    /// Label of the run; `None` for the log.
    run: Option<&'a str>,
    message: &'a str,
    pub(super) first_ns: i64,
    last_ns: i64,
    /// Number of warnings of the log, or of steps of the run with the warning.
    count: usize,
}

impl WarningLine<'_> {
    /// Message with its run, the count and the time span.
    pub(super) fn text(&self) -> String {
        let Self { run, message, first_ns, last_ns, count } = self;
        let run = run.map_or_else(String::new, |run| format!("{run}: "));
        if *count == 1 {
            return format!("{run}{message}");
        }
        let count = counted(*count, if run.is_empty() { "warning" } else { "step" });
        format!("{run}{message} ({count}, {}–{} s)", seconds(*first_ns), seconds(*last_ns))
    }
}

/// Lines of all warnings, those of the log first, each source in the order of the first stamps.
pub(super) fn warning_lines(recording: &Recording) -> Vec<WarningLine<'_>> {
    let of_log = recording.warnings.iter().map(|warning| WarningLine {
        run: None,
        message: &warning.message,
        first_ns: warning.stamp_ns,
        last_ns: warning.stamp_ns,
        count: 1,
    });
    let of_runs = recording.runs.iter().flat_map(|run| {
        run.warnings.iter().map(|warning| WarningLine {
            run: Some(&run.spec.label),
            message: &warning.message,
            first_ns: warning.first_ns,
            last_ns: warning.last_ns,
            count: warning.steps,
        })
    });
    let mut lines: Vec<WarningLine<'_>> = Vec::new();
    for next in of_log.chain(of_runs) {
        let same = |line: &&mut WarningLine<'_>| line.run == next.run && is_repeated(line.message, next.message);
        match lines.iter_mut().find(same) {
            Some(line) => {
                line.first_ns = line.first_ns.min(next.first_ns);
                line.last_ns = line.last_ns.max(next.last_ns);
                line.count += next.count;
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_log::LogWarning;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn repeated_warnings_are_one_line_with_count_and_time_span() {
        let mut recording = sample_recording_of(2, &["auto"]);
        let warning = |stamp_ns, message: &str| LogWarning { stamp_ns, message: message.to_owned() };
        recording.warnings = vec![
            warning(1_000_000_000, "no IMU sample for 0.034 s"),
            warning(2_000_000_000, "image left out"),
            warning(3_500_000_000, "no IMU sample for 0.2 s"),
        ];
        let lines = warning_lines(&recording);
        let texts: Vec<String> = lines.iter().map(WarningLine::text).collect();
        assert_eq!(texts, ["no IMU sample for 0.034 s (2 warnings, 1.000–3.500 s)", "image left out"]);
        assert_eq!(lines[0].first_ns, 1_000_000_000);
    }
}
