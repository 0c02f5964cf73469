//! A session as the [`PlayingLog`] of the window.

use std::sync::Arc;

use crate::flight_log::ImageReader;
use crate::gui::app::PlayingLog;
use crate::gui::{ImageSource, Playback};
use crate::session::{Command, FrameImage, Recording, Session, Wake};

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
