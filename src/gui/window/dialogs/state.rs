//! State of all dialogs.

use std::sync::Arc;

use super::add_run::AddRunDialog;
use super::figure::FigureDialog;
use super::fork::ForkDialog;
use super::markers::MarkersDialog;
use super::open_log::OpenLogDialog;
use super::palette::CommandPalette;
use crate::gui::Dialog;
use crate::gui::desktop::Desktop;

/// State of all dialogs, open or not.
#[derive(Default)]
pub struct Dialogs {
    pub(super) open: Option<Dialog>,
    /// True if the list of shortcuts is open.
    pub shortcuts_open: bool,
    /// True if the window of the diagnosis is open, which is not modal.
    pub(super) diagnosis_open: bool,
    /// True while the window of the sources is open.
    pub(super) sources_open: bool,
    pub(super) open_log: OpenLogDialog,
    pub(super) add_run: AddRunDialog,
    pub(super) fork: ForkDialog,
    pub(super) markers: MarkersDialog,
    pub(in crate::gui::window) figure: FigureDialog,
    pub(super) palette: CommandPalette,
    /// Index of the run that is to be removed.
    pub(super) removed_run: usize,
    /// The work that is not saved, as text.
    pub(super) unsaved: String,
}

impl Dialogs {
    /// Gives the dialogs access to the machine, for completing paths.
    pub fn set_desktop(&mut self, desktop: Arc<dyn Desktop>) {
        self.open_log = OpenLogDialog::new(desktop);
    }

    /// Opens a dialog and closes the open one, except that the diagnosis and the sources are windows beside it; the palette opens with an empty input.
    pub fn show(&mut self, dialog: Dialog) {
        match dialog {
            Dialog::Diagnosis => {
                self.diagnosis_open = true;
                return;
            }
            Dialog::Sources => {
                self.sources_open = true;
                return;
            }
            Dialog::OpenLog => self.open_log.show_picker(),
            Dialog::Markers => self.markers = MarkersDialog::default(),
            Dialog::Palette => self.palette = CommandPalette::default(),
            _ => {}
        }
        self.open = Some(dialog);
    }

    /// Asks whether to save the session before leaving it; `lost` is the unsaved work as text.
    pub fn ask_to_save(&mut self, lost: String) {
        self.unsaved = lost;
        self.open = Some(Dialog::Unsaved);
    }

    /// Asks whether to remove a run.
    pub(in crate::gui::window) fn ask_to_remove(&mut self, run: usize) {
        self.removed_run = run;
        self.open = Some(Dialog::RemoveRun);
    }

    /// Lists the markers, with the keyboard focus on the name of one of them.
    pub(in crate::gui::window) fn edit_marker(&mut self, stamp_ns: i64) {
        self.markers = MarkersDialog::with_focus(stamp_ns);
        self.open = Some(Dialog::Markers);
    }

    /// Opens the fork dialog with the value of one key.
    pub(in crate::gui::window) fn fork_with(&mut self, key: &'static str, value: String) {
        self.fork = ForkDialog::with_text(key, value);
        self.open = Some(Dialog::Fork);
    }

    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Closes the open dialog, the list of shortcuts and the diagnosis.
    pub fn close(&mut self) {
        self.open = None;
        (self.shortcuts_open, self.diagnosis_open) = (false, false);
    }
}
