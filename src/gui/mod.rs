//! Panels, the 3D scene and the window: they read a recording at a cursor and push commands.

#[cfg(test)]
mod sample_calibration;
#[cfg(test)]
mod sample_images;
#[cfg(test)]
pub(crate) mod sample_recording;
#[cfg(test)]
mod tests;
pub mod theme;

use std::sync::Arc;

use self::theme::Theme;
use crate::flight_log::GrayImage;
use crate::frontend::FeatureId;
use crate::session::{Command, Recording};

/// Gives the images of the log's cameras, by camera key and number in the stream.
pub trait ImageSource {
    /// The image, `None` when it is missing or not decodable.
    fn image(&mut self, camera_key: &str, frame_index: usize) -> Option<Arc<GrayImage>>;
}

/// What is selected, linked across all panels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// A feature.
    pub feature: Option<FeatureId>,
    /// A calibration parameter by name.
    pub parameter: Option<String>,
    /// The run that single-run panels show.
    pub run: usize,
}

/// What every panel is given to draw.
pub struct PanelContext<'a> {
    /// What has been computed.
    pub recording: &'a Recording,
    /// Where the cursor stands, since the log began; panels show the last value at or before it.
    pub cursor_ns: i64,
    /// Images.
    pub images: &'a mut dyn ImageSource,
    /// The linked selection, which a panel may change.
    pub selection: &'a mut Selection,
    /// Colours and sizes.
    pub theme: &'a Theme,
    /// Commands that the panel wants applied after this picture.
    pub commands: &'a mut Vec<Command>,
}
