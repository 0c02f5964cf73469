//! What the window needs of the machine; files are other people's business, so it asks for them here.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use image::RgbaImage;

/// A path that could be meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PathEntry {
    /// The whole path, as it would be typed.
    pub path: String,
    /// Whether it is a folder.
    pub folder: bool,
}

/// A panel to be written to files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PanelExport {
    /// Folder and name of the files without extension: `garden/scene-5.953s`.
    pub name: String,
    /// What the panel shows, drawn anew at twice the size.
    pub picture: RgbaImage,
    /// The same as a drawing of lines and texts (SVG).
    pub drawing: String,
    /// The numbers behind it, comma separated.
    pub table: String,
}

/// Files and figures of the machine.
pub trait Desktop: Send + Sync {
    /// Folders and logs whose paths begin as typed, in order.
    fn complete(&self, typed: &str) -> Vec<PathEntry>;
    /// Asks for a log or a saved session with the desktop's own file dialog, without waiting for it; `None` where there is none.
    ///
    /// `None` comes of it when nothing is chosen, and at once where the desktop turns out to have no such dialog.
    fn pick_log(&self) -> Option<Receiver<Option<PathBuf>>>;
    /// Logs opened lately that still exist, the newest first.
    fn recent_logs(&self) -> Vec<PathBuf>;
    /// Puts a log at the head of the recent ones.
    fn remember_log(&self, path: &Path);
    /// Logs that come with the program.
    fn sample_logs(&self) -> Vec<PathBuf>;
    /// What [`Desktop::keep_layouts`] kept last.
    fn kept_layouts(&self) -> Option<String>;
    /// Keeps the saved layouts for the next start.
    fn keep_layouts(&self, text: &str) -> Result<(), String>;
    /// What [`Desktop::keep_settings`] kept last.
    fn kept_settings(&self) -> Option<String>;
    /// Keeps the settings for the next start.
    fn keep_settings(&self, text: &str) -> Result<(), String>;
    /// Writes a panel as a picture and as a table, and says where.
    fn write_panel(&self, export: &PanelExport) -> Result<Vec<PathBuf>, String>;
    /// Writes a session of a log of this name, and says where.
    fn write_session(&self, name: &str, text: &str) -> Result<PathBuf, String>;
    /// Memory of this process in bytes.
    fn resident_bytes(&self) -> Option<u64>;
}
