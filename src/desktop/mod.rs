//! The machine behind the window: recent files, settings, file dialogs, written panels, and the sample flight.

mod machine;
mod recent_files;
mod report;
mod sample_flight;

pub use machine::Machine;
pub use recent_files::RecentFiles;
