//! What the program prints: results on standard output, notices and progress on standard error.

use std::fmt::Display;
use std::io::{self, Write as _};
use std::time::Duration;

use anyhow::{Context as _, Result};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

/// Steps from the begin to the end of a progress bar.
const PROGRESS_STEPS: u64 = 1000;
/// Time between two frames of the animation of work whose length is unknown.
const SPINNER_PERIOD: Duration = Duration::from_millis(100);

/// Writes to standard output; a closed pipe is no failure.
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
    // A closed standard error loses the notice and nothing else.
    drop(writeln!(io::stderr(), "{text}"));
}

/// Progress on standard error while it lives; nothing where standard error is not a terminal.
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// A bar for work that reports how much of it is done.
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

    /// Draws the bar at a ratio from 0 to 1, with a text behind it.
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
