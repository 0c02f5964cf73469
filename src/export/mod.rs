//! Tables, trajectories, reports and screenshots without a window.

mod calibration_files;
mod calibration_report;
mod covariance;
mod csv_table;
#[cfg(feature = "gui")]
mod desktop;
mod error;
mod estimability;
mod evaluation;
mod existing;
mod file_hash;
mod flight_noise;
mod masks;
mod noise_files;
mod other_estimators;
mod recent_files;
mod report;
mod result_cache;
mod results;
mod run_files;
#[cfg(feature = "gui")]
mod sample_flight;
#[cfg(feature = "gui")]
mod screenshot;
mod session_file;
mod structure;
pub mod study;
#[cfg(feature = "gui")]
mod study_screenshot;
mod study_source;
mod summary;
mod tables;
pub mod trajectory;
mod video_alignment;

pub use calibration_files::write_calibration;
pub use calibration_report::{CalibrationReport, report_calibration};
#[cfg(feature = "gui")]
pub use desktop::Machine;
pub use error::ExportError;
pub use estimability::EstimabilitySummary;
pub use evaluation::{EvaluationOptions, EvaluationReport, evaluate};
pub use existing::{
    check_calibration_folder, check_converted_log, check_report_folder, check_run_folders, check_screenshot,
    check_simulated_log, other_runs, write_new_rig,
};
pub use flight_noise::{DensityReport, FlightNoiseReport};
pub use masks::write_masks;
pub use noise_files::{write_allan, write_flight_noise};
pub use other_estimators::{
    AngleOrigin, Configuration, ConfigurationError, FixedJointAngles, OtherEstimator, configure, write_configuration,
};
pub use recent_files::RecentFiles;
pub use report::{
    ReportDrawing, ReportFigure, ReportOptions, StudyReport, check_study_report, write_known_report, write_report,
    write_study_report,
};
pub use result_cache::{CachedFile, ResultCache, ResultKey, ResultKeyBuilder};
pub use results::write_results;
pub use run_files::{RunFileOptions, write_run};
#[cfg(feature = "gui")]
pub use screenshot::{
    PANEL_NAMES, Renderer, STUDY_PANEL_NAMES, ScreenshotError, ScreenshotOptions, draw_panel, draw_panel_svg,
    panel_csv, panel_names, png_bytes, write_csv, write_png, write_screenshot, write_svg,
};
pub use session_file::{is_session, read_session};
pub use structure::KnownLossSummary;
#[cfg(feature = "gui")]
pub use study_screenshot::{draw_study_panel, draw_study_panel_svg, study_panel_csv};
pub use study_source::{OpenedStudy, StudySourceError, is_study};
pub use summary::{
    Accuracy, AntennaSummary, CalibrationSummary, RunSummary, StageSummary, TimingSummary, TrajectorySummary, log_name,
    summarize,
};
pub use video_alignment::{VideoAlignment, VideoAlignmentError, align_video, write_alignment_plot};
