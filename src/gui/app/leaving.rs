//! Leaving a session (quitting, closing the log, opening another one), and the unsaved work that would be lost.

use std::path::PathBuf;
use std::sync::Arc;

use egui::{Ui, ViewportCommand};
use serde_json::Value;

use super::welcome::Welcome;
use super::{App, PlayingLog};
use crate::gui::Selection;
use crate::gui::units::counted;

/// Destination when leaving the open session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Leaving {
    Quit,
    /// Close the log and go back to the welcome view.
    CloseLog,
    Open(PathBuf),
}

/// Keys of a saved session whose entries are stored nowhere else, each with the noun for one entry.
const WORK: [(&str, &str); 3] = [("forks", "fork"), ("breakpoints", "breakpoint"), ("markers_ns", "marker")];

/// Forks, breakpoints and markers of a session in saved form. Runs, layout and cursor are not included: they are easily
/// restored when the log is opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Work([Vec<Value>; 3]);

impl Work {
    /// Current work of a session.
    pub(super) fn of(log: &dyn PlayingLog) -> Self {
        log.saved(None).map(|text| Self::of_text(&text)).unwrap_or_default()
    }

    fn of_text(text: &str) -> Self {
        let value: Value = serde_json::from_str(text).unwrap_or_default();
        Self(WORK.map(|(key, _)| value.get(key).and_then(Value::as_array).cloned().unwrap_or_default()))
    }

    /// Entries that are not in the work `saved`, as text: "1 fork, 2 markers"; `None` if there are none.
    fn missing_in(&self, saved: &Self) -> Option<String> {
        let counts = self.0.iter().zip(&saved.0).zip(WORK).filter_map(|((now, saved), (_, word))| {
            let count = now.iter().filter(|entry| !saved.contains(entry)).count();
            (count > 0).then(|| counted(count, word))
        });
        let text = counts.collect::<Vec<_>>().join(", ");
        (!text.is_empty()).then_some(text)
    }
}

#[derive(Debug, Default)]
pub(super) struct Departure {
    /// Work stored in the log or in the session's file.
    pub(super) saved: Work,
    /// Destination after the answer of the dialog.
    asked: Option<Leaving>,
    /// True if the window may close without a question.
    pub(super) quits: bool,
}

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
            Leaving::Open(path) => self.open(path),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_new_entries_would_be_lost() {
        let work = |forks: &str, breakpoints: &str, markers: &str| {
            Work::of_text(&format!(
                "{{\"forks\": [{forks}], \"breakpoints\": [{breakpoints}], \"markers_ns\": [{markers}], \"cursor_ns\": 7}}"
            ))
        };
        let saved = work("", "{\"condition\": \"frame == 3\"}", "5, 9");
        assert_eq!(saved.missing_in(&saved), None);
        assert_eq!(work("", "", "5").missing_in(&saved), None, "what was removed is still in the file");
        let more = work("{\"name\": \"a\"}", "{\"condition\": \"frame == 3\"}", "5, 6, 7, 9");
        assert_eq!(more.missing_in(&saved).as_deref(), Some("1 fork, 2 markers"));
        assert_eq!(more.missing_in(&Work::default()).as_deref(), Some("1 fork, 1 breakpoint, 4 markers"));
        assert_eq!(Work::of_text("no session").missing_in(&Work::default()), None);
    }
}
