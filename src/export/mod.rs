//! Tables, trajectories and pictures without a window.

mod error;
mod evaluation;
#[cfg(feature = "gui")]
mod picture;
pub mod trajectory;

pub use error::ExportError;
pub use evaluation::{EvaluationOptions, EvaluationReport, evaluate};
#[cfg(feature = "gui")]
pub use picture::{PANEL_NAMES, PictureError, PictureOptions, draw_panel, panel_names, png_bytes, write_png};
