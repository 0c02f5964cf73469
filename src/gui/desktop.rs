//! The interface through which the window accesses files and memory of the machine; the GUI itself does not touch the
//! file system.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use image::RgbaImage;

use crate::simulation::{MotionSplines, PrescribedMotion};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PathEntry {
    /// Whole path, as typed.
    pub path: String,
    pub folder: bool,
}

/// A panel to be written to files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PanelExport {
    /// Folder and name of the files without extension: `garden/scene-5.953s`.
    pub name: String,
    /// The panel as an image at twice the size.
    pub screenshot: RgbaImage,
    /// The panel as an SVG drawing.
    pub drawing: String,
    /// The values of the panel, comma separated.
    pub table: String,
}

/// A figure in its format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DrawnFigure {
    Pixels(RgbaImage),
    /// The bytes of a PDF or SVG file.
    File(Vec<u8>),
}

/// A figure to be written to a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FigureExport {
    /// Path relative to the working folder, with its extension.
    pub path: String,
    pub figure: DrawnFigure,
}

/// Progress of the simulation of the sample flight.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SampleProgress {
    Images {
        /// Images rendered and written.
        done: usize,
        total: usize,
    },
    /// Path of the log, or the reason of the failure.
    Done(Result<PathBuf, String>),
}

pub trait Desktop: Send + Sync {
    /// Folders and logs whose paths start with the typed text, in order.
    fn complete(&self, typed: &str) -> Vec<PathEntry>;
    /// Opens the desktop's file dialog for logs, recordings and saved sessions without waiting for it; `None` if there is
    /// no such dialog.
    ///
    /// The receiver gets no path if nothing is chosen, and immediately if the desktop has no such dialog.
    fn pick_log(&self) -> Option<Receiver<Vec<PathBuf>>>;
    /// Recently opened logs that still exist, newest first.
    fn recent_logs(&self) -> Vec<PathBuf>;
    /// Moves a log to the head of the recent ones.
    fn remember_log(&self, path: &Path);
    /// Sample logs that come with the program.
    fn sample_logs(&self) -> Vec<PathBuf>;
    /// The folder into which [`Desktop::make_sample`] writes.
    fn sample_folder(&self) -> &Path;
    /// Starts to simulate a sample flight; dropping the receiver cancels it.
    fn make_sample(&self) -> Result<Receiver<SampleProgress>, String>;
    /// The text of the last [`Desktop::keep_layouts`].
    fn kept_layouts(&self) -> Option<String>;
    /// Stores the saved layouts for the next start.
    fn keep_layouts(&self, text: &str) -> Result<(), String>;
    /// The text of the last [`Desktop::keep_settings`].
    fn kept_settings(&self) -> Option<String>;
    /// Stores the settings for the next start.
    fn keep_settings(&self, text: &str) -> Result<(), String>;
    /// The text of the last [`Desktop::keep_window`].
    fn kept_window(&self) -> Option<String>;
    /// Stores size, place and layout of the window for the next start.
    fn keep_window(&self, text: &str) -> Result<(), String>;
    /// Writes a panel as images and as a table, and returns the paths.
    fn write_panel(&self, export: &PanelExport) -> Result<Vec<PathBuf>, String>;
    /// Writes a figure and returns its path.
    fn write_figure(&self, export: &FigureExport) -> Result<PathBuf, String>;
    /// Starts to write a report with the arguments of `dcvins report` into a folder for a log with this name, and to
    /// open it; the receiver gets its path.
    fn start_report(&self, name: &str, arguments: &[String]) -> Result<Receiver<Result<PathBuf, String>>, String>;
    /// Writes a session of a log with this name, and returns the path.
    fn write_session(&self, name: &str, text: &str) -> Result<PathBuf, String>;
    /// Writes the text of a new rig after reading it as a rig, and returns its path; an existing file is not replaced.
    fn write_rig(&self, path: &Path, text: &str) -> Result<PathBuf, String>;
    /// Writes a motion with the names of its joints, and returns its path; an existing file is not replaced.
    fn write_motion(&self, path: &Path, motion: &MotionSplines, joint_names: &[String]) -> Result<PathBuf, String>;
    /// Reads the file of a motion.
    fn read_motion(&self, path: &Path) -> Result<PrescribedMotion, String>;
    /// Resident memory of this process in bytes.
    fn resident_bytes(&self) -> Option<u64>;
}
