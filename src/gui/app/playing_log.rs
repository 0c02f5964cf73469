//! The session of a log with the files and settings that the window needs beside it.

use std::sync::Arc;

use crate::flight_log::ImageReader;
use crate::gui::{ImageSource, Playback};
use crate::session::{Command, FrameImage, Recording, Session, Wake};

pub trait PlayingLog: Send {
    /// Results so far; cheap to clone.
    fn recording(&self) -> Arc<Recording>;
    /// A counter that increases with every change of the results.
    fn generation(&self) -> u64;
    /// Sets the callback that requests a frame when steps at the cursor have been recomputed.
    fn wake_with(&mut self, wake: Wake);
    /// Position of the cursor, in nanoseconds since the log began.
    fn cursor_ns(&self) -> i64;
    fn playback(&self) -> Playback;
    fn apply(&mut self, command: Command);
    /// Moves the cursor by `elapsed_s` seconds of the wall clock.
    fn advance(&mut self, elapsed_s: f64);
    /// Waits a few milliseconds for steps at the cursor that are being recomputed.
    fn settle_shortly(&mut self);
    /// An image of the log by camera and index in its stream.
    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage;
    /// Messages about commands that failed, since the last call.
    fn take_notices(&mut self) -> Vec<String>;
    /// The session as text, with the layout of the panels; `None` for a log without a session.
    fn saved(&self, layout: Option<serde_json::Value>) -> Option<String>;
    /// True if the cursor's position in a saved session is still to be restored.
    fn restores_cursor(&self) -> bool;
    /// Panel layout of the saved session.
    fn layout(&self) -> Option<&serde_json::Value>;
}

/// The images of the session as an [`ImageSource`].
pub(super) struct Images<'a>(pub(super) &'a mut dyn PlayingLog);

impl ImageSource for Images<'_> {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage {
        self.0.image(camera_key, frame_index)
    }
}

impl PlayingLog for Session {
    fn recording(&self) -> Arc<Recording> {
        Self::recording(self)
    }

    fn generation(&self) -> u64 {
        Self::generation(self)
    }

    fn wake_with(&mut self, wake: Wake) {
        Self::wake_with(self, wake);
    }

    fn cursor_ns(&self) -> i64 {
        Self::cursor_ns(self)
    }

    fn playback(&self) -> Playback {
        Playback {
            playing: self.is_playing(),
            speed: self.speed().0,
            loop_range_ns: self.loop_range_ns(),
            markers: self.markers().clone(),
            solver: self.solver_position(),
            recomputing: self.is_recomputing(),
            breakpoints: Arc::clone(self.breakpoints()),
            running_to_breakpoint: self.is_running_to_breakpoint(),
            diagnosis: self.diagnosis(),
        }
    }

    fn apply(&mut self, command: Command) {
        Self::apply(self, command);
    }

    fn advance(&mut self, elapsed_s: f64) {
        Self::advance(self, elapsed_s);
    }

    fn settle_shortly(&mut self) {
        Self::settle_shortly(self);
    }

    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage {
        Self::image(self, camera_key, frame_index)
    }

    fn take_notices(&mut self) -> Vec<String> {
        Self::take_notices(self)
    }

    fn saved(&self, layout: Option<serde_json::Value>) -> Option<String> {
        Some(Self::saved(self, layout).to_text())
    }

    fn restores_cursor(&self) -> bool {
        Self::restores_cursor(self)
    }

    fn layout(&self) -> Option<&serde_json::Value> {
        Self::layout(self)
    }
}

impl ImageSource for Session {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage {
        Self::decoded_image(self, camera_key, frame_index)
    }
}

impl ImageSource for ImageReader {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage {
        Self::image(self, camera_key, frame_index).map_or(FrameImage::Missing, FrameImage::Ready)
    }
}
