//! Tables, trajectories and pictures without a window.

mod calibration_files;
mod calibration_report;
mod csv_table;
#[cfg(feature = "gui")]
mod desktop;
mod error;
mod evaluation;
#[cfg(feature = "gui")]
mod picture;
mod recent_files;
mod report;
mod results;
mod run_files;
mod session_file;
mod structure;
mod summary;
mod tables;
pub mod trajectory;

pub use calibration_files::write_calibration;
pub use calibration_report::{CalibrationReport, report_calibration};
#[cfg(feature = "gui")]
pub use desktop::Machine;
pub use error::ExportError;
pub use evaluation::{EvaluationOptions, EvaluationReport, evaluate};
#[cfg(feature = "gui")]
pub use picture::{
    PANEL_NAMES, PictureError, PictureOptions, Renderer, draw_panel, draw_panel_svg, panel_csv, panel_names, png_bytes,
    write_csv, write_png, write_svg,
};
pub use recent_files::RecentFiles;
pub use report::{ReportDrawing, ReportOptions, ReportPicture, write_report};
pub use results::write_results;
pub use run_files::{RunFileOptions, write_run};
pub use session_file::{is_session, read_session};
pub use structure::KnownLossSummary;
pub use summary::{CalibrationSummary, RunSummary, StageSummary, TimingSummary, log_name, summarize};
