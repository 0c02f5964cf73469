//! A log that plays: what the window needs of a session.

use std::path::Path;
use std::sync::Arc;

use crate::gui::{ImageSource, Playback};
use crate::sensors::GrayImage;
use crate::session::{Command, Recording};

/// A log that plays: what the window needs of a session.
pub trait PlayingLog: Send {
    /// What has been computed so far; cheap.
    fn recording(&self) -> Arc<Recording>;
    /// Changes whenever something new has been computed.
    fn generation(&self) -> u64;
    /// Where the cursor stands, since the log began.
    fn cursor_ns(&self) -> i64;
    /// How the cursor moves.
    fn playback(&self) -> Playback;
    /// Does what a person asked for.
    fn apply(&mut self, command: Command);
    /// Lets the cursor run for so many seconds of the wall.
    fn advance(&mut self, elapsed_s: f64);
    /// An image of the log.
    fn image(&mut self, camera_key: &str, frame_index: usize) -> Option<Arc<GrayImage>>;
    /// What could not be done as asked, since the last call.
    fn take_notices(&mut self) -> Vec<String>;
    /// The session as text, with where the panels are; `None` for a log that no session plays.
    fn saved(&self, layout: Option<serde_json::Value>) -> Option<String>;
    /// Where the panels were when the session was saved.
    fn layout(&self) -> Option<&serde_json::Value>;
}

/// Opens a log; the message of an error says what was wrong and what to do.
pub type OpenLog = Arc<dyn Fn(&Path) -> Result<Box<dyn PlayingLog>, String> + Send + Sync>;

/// Moves a cursor that stands before the first frame there, so that a log just opened shows something; whether there is
/// a frame yet.
pub(super) fn go_to_first_frame(log: &mut dyn PlayingLog) -> bool {
    let recording = log.recording();
    let first = recording.runs.iter().filter_map(|run| run.steps.first()).map(|step| step.report.stamp_ns).min();
    if first.is_some_and(|first_ns| log.cursor_ns() < first_ns) {
        log.apply(Command::GoToStart);
    }
    first.is_some()
}

/// The session's images, for the panels.
pub(super) struct Images<'a>(pub(super) &'a mut dyn PlayingLog);

impl ImageSource for Images<'_> {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> Option<Arc<GrayImage>> {
        self.0.image(camera_key, frame_index)
    }
}
