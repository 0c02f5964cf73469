//! Opening of logs and studies: on a thread, with progress, and with a question before anything is replaced.

use std::path::PathBuf;
use std::sync::Arc;

use egui::{Button, Key, RichText, Ui};

use super::App;
use super::departure::Leaving;
use super::open_request::{OpenFailure, OpenRequest};
use super::opening::{Opened, Opening, ShowProgress};
use super::rig_question::RigPage;
use super::shown_study::ShownStudy;
use crate::flight_log::is_rig_name;
use crate::gui::window::{Modal, NoticeLevel};

impl App {
    /// Starts to open a log, a session, a study or recordings; the current one stays open until then.
    pub fn open(&mut self, request: OpenRequest) {
        let (open_log, open_study, target) = (Arc::clone(&self.open_log), self.open_study.clone(), request.clone());
        self.open_on_thread(request, move |progress| {
            let alone = if target.sources.len() == 1 { target.sources.first() } else { None };
            match alone.and_then(|path| open_study.and_then(|open_study| open_study(path))) {
                Some(study) => study.map(Opened::Study).map_err(OpenFailure::Problem),
                None => open_log(&target, progress).map(Opened::Log),
            }
        });
    }

    pub(super) fn open_on_thread(
        &mut self,
        request: OpenRequest,
        open: impl FnOnce(&mut ShowProgress<'_>) -> Result<Opened, OpenFailure> + Send + 'static,
    ) {
        match Opening::start(request, open) {
            Ok(opening) => self.opening = Some(opening),
            Err(problem) => self.state.notices.show_message(NoticeLevel::Error, problem),
        }
    }

    /// Takes the result of the thread.
    pub(super) fn take_opened(&mut self) {
        let Some(result) = self.opening.as_mut().and_then(Opening::receive) else { return };
        let path = self.opening.take().map(|opening| opening.path()).unwrap_or_default();
        match result {
            Ok(opened) => {
                self.rig_page = None;
                match opened {
                    Opened::Log(opened) => {
                        self.show(opened.log, Some(&opened.remembered));
                        for notice in opened.notices {
                            self.state.notices.inform(notice);
                        }
                    }
                    Opened::Study(study) => self.show_study(study, path.clone()),
                    Opened::RunOfStudy(log) => self.show_session(log),
                }
                if self.tour_of.take().is_some_and(|of| of == path) {
                    self.state.tour.start();
                }
            }
            // The page of a missing rig stays, for another choice.
            Err(OpenFailure::Problem(message)) => self.state.notices.show_message(NoticeLevel::Error, message),
            Err(OpenFailure::NeedsRig(question)) => self.rig_page = Some(RigPage::new(*question)),
            Err(OpenFailure::Cancelled) => {}
        }
    }

    /// Opens dropped files together; asks first if something is open or being opened.
    pub(super) fn take_dropped(&mut self, ui: &Ui) {
        let dropped: Vec<PathBuf> =
            ui.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_path_buf()).collect());
        let [first, ..] = dropped.as_slice() else { return };
        let rig = (dropped.len() == 1 && is_rig_name(first)).then(|| first.clone());
        if let (Some(rig), Some(page)) = (&rig, &self.rig_page) {
            return self.open(OpenRequest { rig: Some(rig.clone()), ..page.request().clone() });
        }
        let open_log = self.log.as_ref().map(|log| log.recording().log_path.clone());
        let request = match (rig, open_log) {
            (Some(rig), Some(log)) => OpenRequest { sources: vec![log], rig: Some(rig) },
            _ => OpenRequest { sources: dropped, rig: None },
        };
        if self.presents().is_some() {
            self.replacement = Some(request);
        } else {
            self.leave(ui, Leaving::Open(request));
        }
    }

    /// Name of what another log would replace; `None` in the welcome view.
    fn presents(&self) -> Option<String> {
        let opening = self.opening.as_ref().map(Opening::text);
        let asked = || self.rig_page.as_ref().map(|page| page.request().names());
        let log = || self.log.as_ref().map(|log| log.recording().log_name());
        opening.or_else(asked).or_else(log).or_else(|| self.study.as_ref().map(ShownStudy::name))
    }

    /// Draws the question whether dropped files replace what is open, and the page of a missing rig.
    pub(super) fn opening_dialogs_ui(&mut self, ui: &Ui) {
        self.replacement_ui(ui);
        if let Some(page) = &mut self.rig_page {
            let answer = page.ui(ui, &self.theme, &self.desktop);
            if let Some(problem) = answer.problem {
                self.state.notices.show_message(NoticeLevel::Error, problem);
            }
            if let Some(request) = answer.opens {
                self.open(request);
            } else if answer.closed {
                self.rig_page = None;
            }
        }
    }

    fn replacement_ui(&mut self, ui: &Ui) {
        let (Some(request), Some(present)) = (self.replacement.clone(), self.presents()) else {
            self.replacement = None;
            return;
        };
        let title = if request.rig.is_some() { "Open the log again?" } else { "Open other files?" };
        let modal = Modal { name: "replace", title, width: 460.0 };
        let (answer, stays_open) = modal.ui(ui, &self.theme, |ui| {
            ui.add_space(4.0);
            let text = match &request.rig {
                Some(rig) => format!("{} again, with the rig {}", request.names(), rig.display()),
                None => format!("{}, instead of {present}", request.names()),
            };
            ui.label(text);
            let hint = if self.opening.is_some() { "The conversion in progress is stopped" } else { "The runs end" };
            ui.label(RichText::new(hint).color(self.theme.text_weak));
            ui.add_space(6.0);
            let enter = ui.input(|input| input.key_pressed(Key::Enter));
            ui.horizontal(|ui| {
                let open = ui.add(Button::new("Open")).clicked();
                // The safe answer has the focus.
                let cancel = ui.add(Button::new("Keep"));
                if ui.memory(|memory| memory.focused().is_none()) {
                    cancel.request_focus();
                }
                if open || cancel.clicked() || enter && cancel.has_focus() {
                    ui.close();
                }
                open
            })
            .inner
        });
        if answer {
            self.replacement = None;
            self.leave(ui, Leaving::Open(request));
        } else if !stays_open {
            self.replacement = None;
        }
    }
}
