//! A cursor over the record, the commands that move it, and the session that connects cursor, engine and record.

mod background_check;
mod background_diagnosis;
mod background_images;
mod command;
mod cursor;
mod markers;
mod recomputed_view;
mod restore;
mod runs;
mod saved;
mod saved_path;
mod session;
mod shared;

pub use background_diagnosis::DiagnosisProgress;
pub use background_images::FrameImage;
pub use command::{Command, PlaybackSpeed};
pub use cursor::{Cursor, MoveOutcome, Moved};
pub use markers::{Marker, Markers};
pub use saved::{SavedBreakpoint, SavedFork, SavedLog, SavedPrior, SavedSession, SavedSessionError};
pub use session::Session;
pub use shared::Wake;
