//! Requests of the window to the application.

use std::path::PathBuf;

use crate::gui::desktop::{FigureExport, PanelExport};
use crate::gui::laboratory::MotionRequest;

/// Request of the window to the application, in addition to the commands of a session.
#[derive(Clone, Debug, PartialEq)]
pub enum WindowRequest {
    /// Open a log, or the files of one log together.
    OpenLog(Vec<PathBuf>),
    /// Stop opening a log.
    CancelOpening,
    /// Store the saved layouts, given as text.
    KeepLayouts(String),
    SaveSession,
    /// Close the log and go back to the welcome view.
    CloseLog,
    Quit,
    /// Leave the session after the question about unsaved work.
    Leave {
        /// True if the session is saved first.
        save: bool,
    },
    WritePanel(Box<PanelExport>),
    WriteFigure(Box<FigureExport>),
    /// Write or read the file of a planned motion.
    Motion(MotionRequest),
    /// Write a report on the runs of the open log and open it.
    WriteReport,
}
