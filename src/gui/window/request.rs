//! Requests of the window to the application.

use std::path::PathBuf;

use crate::gui::desktop::PanelExport;

/// A request of the window to the application, beyond the commands of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WindowRequest {
    /// Open a log.
    OpenLog(PathBuf),
    /// Store the saved layouts, given as text.
    KeepLayouts(String),
    /// Write the session to a file.
    SaveSession,
    /// Close the log and go back to the welcome view.
    CloseLog,
    /// Quit the program.
    Quit,
    /// Leave the session after the question about unsaved work, with or without saving it.
    Leave {
        /// Whether the session is saved before.
        save: bool,
    },
    /// Write a panel to files.
    WritePanel(Box<PanelExport>),
}
