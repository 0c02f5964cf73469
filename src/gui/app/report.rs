//! Reports on the runs of the open log, written by another process.

use std::sync::mpsc::TryRecvError;
use std::time::Duration;

use egui::Ui;

use super::App;

/// Period at which the window looks for the finished report.
const POLL_PERIOD: Duration = Duration::from_millis(250);

impl App {
    /// Starts a report on the runs; forks have no run specification and are left out.
    pub(super) fn start_report(&mut self) {
        let Some(log) = &self.log else { return };
        let recording = log.recording();
        let mut arguments = vec![recording.log_path.display().to_string()];
        let (forks, runs): (Vec<_>, Vec<_>) = recording.runs.iter().partition(|run| run.origin.is_some());
        for run in runs {
            arguments.extend(["--run".to_owned(), run.spec.to_string()]);
        }
        let without = match forks.len() {
            0 => String::new(),
            1 => " without the fork".to_owned(),
            count => format!(" without the {count} forks"),
        };
        let text = format!("Writing the report{without}; it opens when it is complete");
        let started = self.desktop.start_report(&recording.log_stem(), &arguments);
        self.state.notices.report(started.map(|report| {
            self.report = Some(report);
            text
        }));
    }

    /// Reports the result of a report that is being written.
    pub(super) fn receive_report(&mut self, ui: &Ui) {
        let Some(report) = &self.report else { return };
        let result = match report.try_recv() {
            Ok(result) => result,
            Err(TryRecvError::Empty) => {
                ui.ctx().request_repaint_after(POLL_PERIOD);
                return;
            }
            Err(TryRecvError::Disconnected) => Err("dcvins report stopped".to_owned()),
        };
        self.report = None;
        let written = result.map(|path| format!("Report written:\n{}", path.display()));
        self.state.notices.report(written.map_err(|problem| format!("No report: {problem}")));
    }
}
