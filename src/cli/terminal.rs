//! Terminal output: results on standard output, notices and progress on standard error.

use std::fmt::Display;
use std::io::{self, Write as _};
use std::time::Duration;

use anyhow::{Context as _, Result};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

/// Number of steps of a progress bar.
const PROGRESS_STEPS: u64 = 1000;
/// Period of the animation for work of unknown length.
const SPINNER_PERIOD: Duration = Duration::from_millis(100);

/// Writes to standard output; a closed pipe is no error.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

/// Writes a value as JSON to standard output.
pub(crate) fn print_json<T: Serialize + ?Sized>(value: &T) -> Result<()> {
    print(&format!("{}\n", serde_json::to_string_pretty(value)?))
}

/// Writes a report to standard output: as JSON for programs, else as text.
pub(crate) fn print_report<T: Serialize + Display>(report: &T, json: bool) -> Result<()> {
    if json { print_json(report) } else { print(&report.to_string()) }
}

/// Writes a line to standard error.
#[cfg(feature = "gui")]
pub(crate) fn notify(text: &str) {
    // A closed standard error loses only the notice.
    drop(writeln!(io::stderr(), "{text}"));
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
