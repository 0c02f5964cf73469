//! Tables, trajectories, summaries and screenshots without a window.

pub(crate) mod calibration_files;
pub(crate) mod calibration_report;
mod check_cache;
#[cfg(test)]
mod documented_tests;
mod error;
mod euroc;
mod evaluation;
mod excerpt_files;
pub(crate) mod existing;
pub(crate) mod file_hash;
mod flight_noise;
pub(crate) mod folder_files;
mod history_folders;
mod history_report;
pub(crate) mod masks;
mod mission;
mod motion_csv;
mod noise_files;
mod plan_files;
mod posterior;
pub(crate) mod result_cache;
mod results;
pub(crate) mod run_files;
#[cfg(feature = "gui")]
pub(crate) mod screenshot;
mod session_file;
mod sources;
mod stills_files;
mod stills_report;
mod stills_rig;
#[cfg(feature = "gui")]
mod study_screenshot;
mod tables;
pub mod trajectory;
mod video_alignment;

#[cfg(feature = "gui")]
pub use self::screenshot::figure_bytes;
pub use calibration_files::write_calibration;
pub use calibration_report::{CalibrationReport, report_calibration};
pub use check_cache::check_log;
pub use error::ExportError;
pub use euroc::{EurocCamera, EurocReport, check_euroc_folder, write_euroc};
pub use evaluation::{EvaluationOptions, EvaluationReport, evaluate};
pub use excerpt_files::{
    ExcerptParameter, ExcerptStretch, ExcerptSummary, check_excerpt_folder, write_excerpt_index, write_stretches,
};
pub use existing::{
    check_calibration_folder, check_converted_log, check_report_folder, check_run_folders, check_screenshot,
    check_simulated_log, check_stills_folder, other_runs, write_new_rig,
};
pub use flight_noise::{DensityReport, FlightNoiseReport};
pub use history_folders::LeftOut;
pub use history_report::{
    HistoryChange, HistoryFlight, HistoryInterval, HistoryParameter, HistoryReport, calibration_history, write_history,
};
pub use masks::write_masks;
pub use mission::MissionStart;
pub use motion_csv::{read_motion, write_motion};
pub use noise_files::{write_allan, write_flight_noise};
pub use plan_files::{PlanReport, PlannedFlight, check_plan_folder, write_plan};
pub use posterior::{SigmaTable, prior_of_calibration, prior_of_run, read_prior};
pub use result_cache::{CachedFile, ResultCache, ResultKey, ResultKeyBuilder};
pub use run_files::{RunFileOptions, write_run};
#[cfg(feature = "gui")]
pub use screenshot::{
    PANEL_NAMES, Renderer, STUDY_PANEL_NAMES, ScreenshotError, ScreenshotOptions, draw_panel, draw_panel_svg,
    panel_csv, png_bytes, write_csv, write_png, write_screenshot, write_svg,
};
pub use session_file::{open_session, prepare_session, read_session};
pub use sources::{ConversionStage, ConvertedLogs, LogSources, PreparedLog, SourceError, is_session, prepare_log};
pub use stills_files::write_stills;
pub use stills_report::StillsReport;
#[cfg(feature = "gui")]
pub use study_screenshot::{draw_study_panel, draw_study_panel_svg, study_panel_csv};
pub use video_alignment::{AlignmentEvidence, VideoAlignment, VideoAlignmentError, align_video, write_alignment_plot};
