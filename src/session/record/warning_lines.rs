//! Warnings of the log and its runs, with one line for each kind.

use super::recording::Recording;
use super::run::RunRecord;
use crate::estimator::FactorKind;
use crate::flight_log::{LogWarning, Magnitude, WarningKind};
use crate::geometry::seconds_from_ns;

/// Warnings of one kind, which are shown as one line.
#[derive(Debug)]
pub struct WarningLine<'a> {
    /// Label of the run; `None` for the log.
    run: Option<&'a str>,
    key: WarningKey<'a>,
    /// Text of the worst warning, the first of equally bad ones.
    message: String,
    magnitude: Option<LineMagnitude>,
    pub first_ns: i64,
    last_ns: i64,
    warnings: usize,
    /// Number of messages, images, …, or of steps of the run with the warning.
    count: usize,
    /// True if the warnings are not equally bad.
    varies: bool,
}

/// Properties that the warnings of one line share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WarningKey<'a> {
    /// Kind of a warning of the log, and its topic.
    Log(WarningKind, &'a str),
    /// Factor of an inconsistency in a run, and its cause.
    Run(FactorKind, &'a str),
}

/// Size of a problem of the log, or χ²/dof of a run's residuals.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum LineMagnitude {
    Log(Magnitude),
    MeanSquare(f64),
}

impl WarningLine<'_> {
    /// Message with the count, the time span, and a remark if it is the worst of several.
    fn without_run(&self) -> String {
        let Self { message, first_ns, last_ns, count, .. } = self;
        let noun = match self.key {
            // A message about consecutive messages has their number and times.
            WarningKey::Log(..) if self.warnings == 1 => return message.clone(),
            WarningKey::Run(..) if self.count == 1 => return message.clone(),
            WarningKey::Log(kind, _) => kind.counted(),
            WarningKey::Run(..) => "steps",
        };
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

    fn add(&mut self, next: Self) {
        self.varies |= next.varies || self.magnitude != next.magnitude;
        if next.magnitude.partial_cmp(&self.magnitude) == Some(std::cmp::Ordering::Greater) {
            (self.message, self.magnitude) = (next.message, next.magnitude);
        }
        self.first_ns = self.first_ns.min(next.first_ns);
        self.last_ns = self.last_ns.max(next.last_ns);
        self.warnings += next.warnings;
        self.count += next.count;
    }
}

/// Lines of all warnings, the log's warnings first, each source in the order of the first stamps.
pub fn warning_lines(recording: &Recording) -> Vec<WarningLine<'_>> {
    let mut lines = log_warning_lines(&recording.warnings);
    lines.extend(recording.runs.iter().flat_map(run_warning_lines));
    lines
}

/// Lines of the warnings of a log.
pub fn log_warning_lines(warnings: &[LogWarning]) -> Vec<WarningLine<'_>> {
    merged(warnings.iter().map(|warning| WarningLine {
        run: None,
        key: WarningKey::Log(warning.kind, &warning.subject),
        message: warning.message.clone(),
        magnitude: warning.magnitude.map(LineMagnitude::Log),
        first_ns: warning.stamp_ns,
        last_ns: warning.last_ns,
        warnings: 1,
        count: warning.count,
        varies: false,
    }))
}

/// Lines of the warnings of a run's steps.
pub fn run_warning_lines(run: &RunRecord) -> Vec<WarningLine<'_>> {
    merged(run.warnings.iter().map(|warning| WarningLine {
        run: Some(&run.spec.label),
        key: WarningKey::Run(warning.warning.factor, &warning.warning.cause),
        message: warning.warning.to_string(),
        magnitude: Some(LineMagnitude::MeanSquare(warning.warning.mean_square)),
        first_ns: warning.first_ns,
        last_ns: warning.last_ns,
        warnings: 1,
        count: warning.steps,
        varies: false,
    }))
}

fn merged<'a>(warnings: impl Iterator<Item = WarningLine<'a>>) -> Vec<WarningLine<'a>> {
    let mut lines: Vec<WarningLine<'a>> = Vec::new();
    for next in warnings {
        match lines.iter_mut().find(|line| line.key == next.key) {
            Some(line) => line.add(next),
            None => lines.push(next),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_of_warning_is_one_line_with_count_time_span_and_worst_value() {
        let gap = |from_s: f64, length_s: f64| {
            let from_ns = (1e9 * from_s) as i64;
            let message = format!("no IMU sample for {length_s} s from {from_s:.3} s on");
            LogWarning::new(WarningKind::ImuGap, "/imu", from_ns, message).with_magnitude(Magnitude::Seconds(length_s))
        };
        let size = |stamp_ns, number: usize| {
            let message = format!("image {number} skipped: it has 580×360 pixels");
            LogWarning::new(WarningKind::ImageSize, "/camera", stamp_ns, message)
        };
        let dropped = |stamp_ns, count: usize, topic: &str| {
            let message = format!("{topic}: {count} messages dropped");
            LogWarning::new(WarningKind::Dropped("zero"), topic, stamp_ns, message)
                .with_count(count, stamp_ns + 500_000_000)
        };
        let warnings = [
            gap(1.0, 0.034),
            LogWarning::new(WarningKind::ImageUnreadable, "/camera", 2_000_000_000, "image left out".to_owned()),
            gap(3.5, 0.2),
            gap(4.5, 0.1234),
            size(5_000_000_000, 7),
            dropped(5_500_000_000, 1, "/imu"),
            size(6_000_000_000, 8),
            dropped(6_500_000_000, 4, "/imu"),
            dropped(7_000_000_000, 2, "/other"),
        ];
        let lines = log_warning_lines(&warnings);
        let texts: Vec<String> = lines.iter().map(WarningLine::with_time).collect();
        assert_eq!(
            texts,
            [
                "1.000 s: no IMU sample for 0.2 s from 3.500 s on (3 gaps, 1.000–4.500 s; the worst is shown)",
                "2.000 s: image left out",
                "5.000 s: image 7 skipped: it has 580×360 pixels (2 images, 5.000–6.000 s)",
                "5.500 s: /imu: 4 messages dropped (5 messages, 5.500–7.000 s; the worst is shown)",
                "7.000 s: /other: 2 messages dropped",
            ]
        );
    }
}
