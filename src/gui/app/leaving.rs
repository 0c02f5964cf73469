//! Leaving a session: quitting, closing the log or opening another one.

use std::sync::Arc;

use egui::{Ui, ViewportCommand};

use super::App;
use super::departure::{Departure, Leaving, Work};
use super::welcome::Welcome;
use crate::gui::Selection;

impl App {
    /// Leaves the session; asks first if work would be lost.
    pub(super) fn leave(&mut self, ui: &Ui, to: Leaving) {
        let lost = self.log.as_deref().and_then(|log| Work::of(log).missing_in(&self.departure.saved));
        match lost {
            Some(lost) => {
                self.state.dialogs.ask_to_save(lost);
                self.departure.asked = Some(to);
                ui.request_repaint();
            }
            None => self.go(ui, to),
        }
    }

    /// Executes the answer of the dialog.
    pub(super) fn leave_as_asked(&mut self, ui: &Ui, save: bool) {
        if (!save || self.save_session())
            && let Some(to) = self.departure.asked.take()
        {
            self.go(ui, to);
        }
    }

    /// Asks before closing when the window is closed by the button of its frame, too.
    pub(super) fn guard_closing(&mut self, ui: &Ui) {
        if self.departure.quits || !ui.input(|input| input.viewport().close_requested()) {
            return;
        }
        self.leave(ui, Leaving::Quit);
        if !self.departure.quits {
            ui.send_viewport_cmd(ViewportCommand::CancelClose);
        }
    }

    fn go(&mut self, ui: &Ui, to: Leaving) {
        match to {
            Leaving::Quit => {
                self.departure.quits = true;
                ui.send_viewport_cmd(ViewportCommand::Close);
            }
            Leaving::CloseLog => self.close_log(),
            Leaving::Open(request) => self.open(request),
        }
    }

    /// Ends the session and shows the study from which it was opened, or else the welcome view.
    fn close_log(&mut self) {
        self.close_session();
        self.welcome = Welcome::new(Arc::clone(&self.desktop));
    }

    /// Ends the session with its threads.
    pub(super) fn close_session(&mut self) {
        self.log = None;
        self.opening = None;
        self.selection = Selection::default();
        self.departure = Departure::default();
        self.state.close_everything();
    }
}
