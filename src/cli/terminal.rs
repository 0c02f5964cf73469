//! Terminal output: results on standard output, notices and progress on standard error.

use std::fmt::Display;
use std::io::{self, Write as _};
use std::time::Duration;

use anyhow::{Context as _, Result};
use dcvins::text::{printable, printable_lines};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

/// Number of steps of a progress bar.
const PROGRESS_STEPS: u64 = 1000;
/// Period of the animation for work of unknown length.
const SPINNER_PERIOD: Duration = Duration::from_millis(100);

/// Writes text for users to standard output, without control characters that names in it may contain; a closed pipe is
/// not an error.
pub(crate) fn print(text: &str) -> Result<()> {
    write(&printable_lines(text))
}

fn write(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

/// Writes a value as JSON to standard output; characters that control a terminal are written as JSON escapes.
pub(crate) fn print_json<T: Serialize + ?Sized>(value: &T) -> Result<()> {
    write(&format!("{}\n", escaped_json(&serde_json::to_string_pretty(value)?)))
}

/// JSON text in which every unprintable character is escaped as `\uXXXX`: they occur only inside strings, and the
/// serializer has already escaped those below U+0020.
fn escaped_json(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    let mut units = [0; 2];
    for letter in json.chars() {
        if letter == '\n' || printable(letter.encode_utf8(&mut [0; 4])).len() == letter.len_utf8() {
            text.push(letter);
        } else {
            text.extend(letter.encode_utf16(&mut units).iter().map(|unit| format!("\\u{unit:04x}")));
        }
    }
    text
}

/// Writes a report to standard output: as JSON for programs, else as text.
pub(crate) fn print_report<T: Serialize + Display>(report: &T, json: bool) -> Result<()> {
    if json { print_json(report) } else { print(&report.to_string()) }
}

/// Writes a line to standard error.
pub(crate) fn notify(text: &str) {
    // With a closed standard error only the notice is lost.
    drop(writeln!(io::stderr(), "{}", printable_lines(text)));
}

/// A progress display on standard error, removed when it is dropped; nothing is shown if standard error is not a
/// terminal.
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// A bar for work with known progress.
    pub(crate) fn new() -> Self {
        let style = ProgressStyle::with_template("{bar:32} {percent:>3} % {msg}").expect("the template is valid");
        Self(ProgressBar::new(PROGRESS_STEPS).with_style(style.progress_chars("█░")))
    }

    /// An animation for work of unknown length.
    pub(crate) fn spinner(text: &'static str) -> Self {
        let spinner = ProgressBar::new_spinner().with_message(text);
        spinner.enable_steady_tick(SPINNER_PERIOD);
        Self(spinner)
    }

    /// Shows a ratio from 0 to 1 and a text.
    pub(crate) fn show(&self, ratio: f64, text: impl FnOnce() -> String) {
        if !self.0.is_hidden() {
            self.0.set_message(text());
            self.0.set_position((ratio.clamp(0.0, 1.0) * PROGRESS_STEPS as f64) as u64);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_stays_json_without_control_characters() {
        let name = "/a\u{1b}[2J\u{9b}\u{202e}é";
        let json = escaped_json(&serde_json::to_string_pretty(&[name]).unwrap());
        assert_eq!(json, "[\n  \"/a\\u001b[2J\\u009b\\u202eé\"\n]");
        assert_eq!(serde_json::from_str::<Vec<String>>(&json).unwrap(), [name]);
    }
}
