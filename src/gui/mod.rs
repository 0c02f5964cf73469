//! Panels, the 3D scene and the window: they read a recording at a cursor and push commands.

pub mod app;
pub mod breakpoints;
mod chain_values;
pub mod comparison;
pub mod convergence;
pub mod csv_table;
pub mod desktop;
mod events;
mod follow;
pub mod image_panel;
pub mod inspector;
pub mod jacobian;
pub mod laboratory;
#[cfg(test)]
mod panel_tests;
mod path_field;
mod plot;
pub mod rank;
pub mod rendering;
pub mod residuals;
#[cfg(test)]
pub(crate) mod samples;
pub mod scene;
mod slide;
mod step_work;
#[cfg(test)]
pub(crate) mod tests;
pub mod theme;
pub mod timeline;
mod units;
pub mod window;

use std::sync::Arc;

use self::theme::Theme;
use crate::frontend::FeatureId;
use crate::gimbal::{ParameterId, ParameterNames};
use crate::observability::SlidePosition;
use crate::sensors::GrayImage;
use crate::session::breakpoints::Breakpoints;
use crate::session::{Command, Recording, RunRecord, SolverPosition};

/// Gives the images of the log's cameras, by camera key and number in the stream.
pub trait ImageSource {
    /// The image, `None` when it is missing or not decodable.
    fn image(&mut self, camera_key: &str, frame_index: usize) -> Option<Arc<GrayImage>>;
}

/// What is selected, linked across all panels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// A feature.
    pub feature: Option<FeatureId>,
    /// A calibration parameter.
    pub parameter: Option<ParameterId>,
    /// The run that single-run panels show.
    pub run: usize,
    /// The stretch of time that plots show, begin and end since the log began; `None` for the whole log.
    pub visible_ns: Option<(i64, i64)>,
    /// Along which direction the selected run's chain is moved, and how far.
    pub slide: Option<SlidePosition>,
    /// What comes of it at the cursor.
    pub(crate) moved: slide::MovedChain,
}

/// How the cursor moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// Whether it runs.
    pub playing: bool,
    /// How fast, in log seconds per second.
    pub speed: f64,
    /// The range that is played over and over, since the log began.
    pub loop_range_ns: Option<(i64, i64)>,
    /// Marked instants, in time order.
    pub markers_ns: Vec<i64>,
    /// Where in the solver's work the step at the cursor is shown, `None` at its end.
    pub solver: Option<SolverPosition>,
    /// Whether steps at the cursor are being recomputed.
    pub recomputing: bool,
    /// The breakpoints with their hits so far.
    pub breakpoints: Arc<Breakpoints>,
    /// Whether the cursor is on its way to a hit that the estimators have not reached yet.
    pub running_to_breakpoint: bool,
}

impl Default for Playback {
    fn default() -> Self {
        Self {
            playing: false,
            speed: 1.0,
            loop_range_ns: None,
            markers_ns: Vec::new(),
            solver: None,
            recomputing: false,
            breakpoints: Arc::default(),
            running_to_breakpoint: false,
        }
    }
}

/// What every panel is given to draw.
pub struct PanelContext<'a> {
    /// What has been computed.
    pub recording: &'a Recording,
    /// Where the cursor stands, since the log began; panels show the last value at or before it.
    pub cursor_ns: i64,
    /// How the cursor moves.
    pub playback: &'a Playback,
    /// Images.
    pub images: &'a mut dyn ImageSource,
    /// The linked selection, which a panel may change.
    pub selection: &'a mut Selection,
    /// Colours and sizes.
    pub theme: &'a Theme,
    /// Commands that the panel wants applied after this picture.
    pub commands: &'a mut Vec<Command>,
}

impl<'a> PanelContext<'a> {
    /// The run that single-run panels show, `None` before the first run has started.
    pub fn selected_run(&self) -> Option<&'a RunRecord> {
        self.recording.runs.get(self.selection.run)
    }

    /// What calibration parameters are called.
    pub(crate) fn names(&self) -> ParameterNames {
        self.recording.rig.parameter_names()
    }
}
