//! A cursor over the record, and the commands that move it.

mod command;
mod saved;
mod session;
mod stopping;

pub use command::{Command, PlaybackSpeed};
pub use saved::{SavedBreakpoint, SavedFork, SavedLog, SavedSession, SavedSessionError};
pub use session::Session;
