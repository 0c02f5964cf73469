//! Panels, the 3D scene and the window: they read a recording at a cursor and push commands.

mod accessible;
pub mod allan;
pub mod app;
pub mod breakpoints;
mod chain_values;
pub mod comparison;
pub mod convergence;
mod copied_value;
pub mod csv_table;
pub mod desktop;
mod events;
mod follow;
mod help;
pub mod image_panel;
pub mod inspector;
pub mod jacobian;
pub mod laboratory;
mod pan_zoom;
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
pub mod study;
#[cfg(test)]
pub(crate) mod tests;
pub mod theme;
pub mod timeline;
mod units;
pub mod window;

use std::sync::Arc;

use egui::{Role, Sense};

use self::theme::Theme;
use crate::frontend::FeatureId;
use crate::gimbal::{ParameterId, ParameterNames};
use crate::observability::SlidePosition;
use crate::session::breakpoints::Breakpoints;
use crate::session::{Command, FrameImage, Recording, RunRecord, SolverPosition};

/// Source of camera images, by camera key and index in the stream.
pub trait ImageSource {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage;
}

/// The selection, common to all panels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    pub feature: Option<FeatureId>,
    pub parameter: Option<ParameterId>,
    /// Index of the run in panels that show one run.
    pub run: usize,
    /// Time range of all plots, in nanoseconds since the log began; `None` for the whole log.
    pub visible_ns: Option<(i64, i64)>,
    /// Direction and distance by which the selected run's chain is moved.
    pub slide: Option<SlidePosition>,
    /// Moved chain at the cursor.
    pub(crate) moved: slide::MovedChain,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// True if the cursor moves.
    pub playing: bool,
    /// Speed in log seconds per second.
    pub speed: f64,
    /// The loop range, in nanoseconds since the log began.
    pub loop_range_ns: Option<(i64, i64)>,
    /// Stamps of the markers in ascending order.
    pub markers_ns: Vec<i64>,
    /// The solver iteration at which the step is shown, `None` for the converged step.
    pub solver: Option<SolverPosition>,
    /// True if steps at the cursor are being recomputed.
    pub recomputing: bool,
    /// Breakpoints with their hits so far.
    pub breakpoints: Arc<Breakpoints>,
    /// True while the cursor runs to a hit that the estimators have not reached yet.
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

/// Presentation of a panel: in the window, or as a figure of a report or of an exported file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Presentation {
    /// With toolbars, buttons and selectors.
    #[default]
    Interactive,
    /// Values, plots and legends only.
    Figure,
}

impl Presentation {
    /// True if buttons, selectors and hints are omitted.
    pub fn is_figure(self) -> bool {
        self == Self::Figure
    }

    /// Sense and accessibility role of a painted element that a click selects. In the window it is a button; in a
    /// figure it has the given role and does not react.
    pub(crate) fn clickable(self, role_in_figure: Role) -> (Sense, Role) {
        if self.is_figure() { (Sense::hover(), role_in_figure) } else { (Sense::click(), Role::Button) }
    }
}

/// The inputs and outputs of a panel in one frame.
pub struct PanelContext<'a> {
    pub recording: &'a Recording,
    /// Position of the cursor in nanoseconds since the log began; panels show the last step at or before it.
    pub cursor_ns: i64,
    pub playback: &'a Playback,
    pub images: &'a mut dyn ImageSource,
    /// The common selection, which a panel may change.
    pub selection: &'a mut Selection,
    pub theme: &'a Theme,
    pub presentation: Presentation,
    /// Commands of the panel, applied after this frame.
    pub commands: &'a mut Vec<Command>,
}

impl<'a> PanelContext<'a> {
    /// The selected run, `None` before the first run has started.
    pub fn selected_run(&self) -> Option<&'a RunRecord> {
        self.recording.runs.get(self.selection.run)
    }

    /// Names of calibration parameters and joints.
    pub(crate) fn names(&self) -> ParameterNames {
        self.recording.rig.parameter_names()
    }
}
