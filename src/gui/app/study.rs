//! A study in the window: its view, and the runs opened from it.

use std::path::PathBuf;
use std::sync::Arc;

use egui::Ui;

use super::App;
use super::open_request::{OpenFailure, OpenRequest};
use super::opening::Opened;
use super::shown_study::{OpenStudy, ShownStudy, StudySource};
use crate::gui::study::{StudyOptions, StudyRequest, StudyState, study_ui};
use crate::gui::theme::MAX_RUNS;
use crate::gui::window::NoticeLevel;
use crate::study::view::comparable_rows;

impl App {
    /// Adds the ability to open studies.
    #[must_use]
    pub fn with_studies(mut self, open_study: OpenStudy) -> Self {
        self.open_study = Some(open_study);
        self
    }

    /// Shows a study that has been opened from `path`; an open session is closed.
    pub(super) fn show_study(&mut self, source: Arc<dyn StudySource>, path: PathBuf) {
        match StudyState::new(source.study(), &StudyOptions::default()) {
            Ok(state) => {
                self.close_session();
                self.desktop.remember_log(&path);
                self.state.status.recent_logs = self.desktop.recent_logs();
                self.welcome.stop();
                self.study = Some(ShownStudy { source, state, path });
            }
            Err(problem) => {
                let text = format!("{problem}: {}", path.display());
                self.state.notices.show_message(NoticeLevel::Error, text);
            }
        }
    }

    /// True if a study is open, with or without a session in front of it.
    pub fn has_study(&self) -> bool {
        self.study.is_some()
    }

    /// Draws the study and executes its requests.
    pub(super) fn study_ui(&mut self, ui: &mut Ui) {
        let Some(study) = &mut self.study else { return };
        study_ui(ui, &mut study.state, &self.theme);
        let requests = std::mem::take(&mut study.state.requests);
        self.state.help.welcome_ui(ui, &self.theme);
        self.state.ring.ui(ui, &self.theme);
        self.state.notices.toasts_ui(ui, &self.theme);
        for request in requests {
            ui.ctx().request_repaint();
            match request {
                StudyRequest::OpenRun(row) => self.open_run(row),
                StudyRequest::Copy(text, what) => {
                    ui.copy_text(text);
                    self.state.notices.inform(format!("Copied the table of {what} (CSV)"));
                }
                StudyRequest::Close => self.study = None,
            }
        }
    }

    /// Starts to open a run with the comparable runs on another thread; while one is being opened, further clicks have
    /// no effect.
    fn open_run(&mut self, row: usize) {
        let Some(study) = self.study.as_ref().filter(|_| self.opening.is_none()) else { return };
        let table = study.state.study();
        let rows = comparable_rows(&table.runs, row, MAX_RUNS);
        let title = table.title_of(row);
        let source = Arc::clone(&study.source);
        self.state.notices.inform(format!("Opening {title}"));
        let request = OpenRequest::of(PathBuf::from(title));
        self.open_on_thread(request, move |_| {
            source.open_runs(&rows).map(Opened::RunOfStudy).map_err(OpenFailure::Problem)
        });
    }
}
