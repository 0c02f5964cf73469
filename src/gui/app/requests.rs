//! The window's requests to the application.

use egui::Ui;

use super::App;
use super::departure::{Leaving, Work};
use super::open_request::OpenRequest;
use crate::gui::desktop::{FigureExport, PanelExport};
use crate::gui::laboratory::MotionRequest;
use crate::gui::window::{NoticeLevel, WindowRequest};

impl App {
    /// Executes the requests of a frame.
    pub(super) fn take_requests(&mut self, ui: &Ui) {
        for request in std::mem::take(&mut self.state.requests) {
            // The next frame shows the result.
            ui.ctx().request_repaint();
            match request {
                WindowRequest::OpenLog(sources) => {
                    self.leave(ui, Leaving::Open(OpenRequest { sources, rig: None }));
                }
                WindowRequest::CancelOpening => self.opening = None,
                WindowRequest::CloseLog => self.leave(ui, Leaving::CloseLog),
                WindowRequest::Quit => self.leave(ui, Leaving::Quit),
                WindowRequest::Leave { save } => self.leave_as_asked(ui, save),
                WindowRequest::KeepLayouts(text) => {
                    if let Err(problem) = self.desktop.keep_layouts(&text) {
                        self.state.notices.show_message(NoticeLevel::Error, problem);
                    }
                }
                WindowRequest::SaveSession => {
                    self.save_session();
                }
                WindowRequest::WritePanel(export) => self.write_panel(&export),
                WindowRequest::WriteFigure(export) => self.write_figure(&export),
                WindowRequest::Motion(request) => self.exchange_motion(&request),
                WindowRequest::WriteReport => self.start_report(),
            }
        }
    }

    /// Writes the session to its file; returns true on success.
    pub(super) fn save_session(&mut self) -> bool {
        let layout = self.state.tiles.layout_value();
        let Some(log) = &self.log else { return false };
        let Some(text) = log.saved(layout) else { return false };
        match self.desktop.write_session(&log.recording().log_stem(), &text) {
            Ok(path) => {
                self.departure.saved = Work::of(log.as_ref());
                self.desktop.remember_log(&path);
                self.state.status.recent_logs = self.desktop.recent_logs();
                self.state.notices.inform(format!("Session saved (opens like a log):\n{}", path.display()));
                true
            }
            Err(problem) => {
                self.state.notices.show_message(NoticeLevel::Error, problem);
                false
            }
        }
    }

    /// Writes or reads the file of a planned motion.
    fn exchange_motion(&mut self, request: &MotionRequest) {
        let done = match request {
            MotionRequest::Write { path, motion, joint_names } => {
                let written = self.desktop.write_motion(path, motion, joint_names);
                written.map(|path| format!("Motion saved:\n{}", path.display()))
            }
            MotionRequest::Read { path } => self.desktop.read_motion(path).map(|motion| {
                self.state.panels.laboratory.open_motion(motion);
                format!("Motion opened:\n{}", path.display())
            }),
        };
        self.state.notices.report(done);
    }

    fn write_figure(&mut self, export: &FigureExport) {
        let written = self.desktop.write_figure(export);
        self.state.notices.report(written.map(|path| format!("Figure saved:\n{}", path.display())));
    }

    fn write_panel(&mut self, export: &PanelExport) {
        let written = self.desktop.write_panel(export).map(|paths| {
            let paths: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
            format!("Exported:\n{}", paths.join("\n"))
        });
        self.state.notices.report(written);
    }
}
