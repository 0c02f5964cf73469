//! Tables, trajectories and pictures without a window.

mod error;
mod evaluation;
#[cfg(feature = "gui")]
mod home;
#[cfg(feature = "gui")]
mod picture;
mod run_files;
mod summary;
mod tables;
pub mod trajectory;

pub use error::ExportError;
pub use evaluation::{EvaluationOptions, EvaluationReport, evaluate};
#[cfg(feature = "gui")]
pub use home::Home;
#[cfg(feature = "gui")]
pub use picture::{PANEL_NAMES, PictureError, PictureOptions, draw_panel, panel_names, png_bytes, write_png};
pub use run_files::{RunFileOptions, write_run};
pub use summary::{RunSummary, StageSummary, log_name, summarize};
