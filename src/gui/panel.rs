//! The panels of the window by name, what each of them does, and what it gets and gives in a frame.

use std::ops::Range;
use std::sync::Arc;

use egui::{Role, Sense, Ui};
use serde::{Deserialize, Serialize};

use super::derived::answers::Answers;
use super::derived::flight::{FlightReport, FlightTables, NeededMotion};
use super::derived::reading::Reading;
use super::derived::slide::MovedChain;
use super::theme::Theme;
use crate::frontend::FeatureId;
use crate::gimbal::{ParameterId, ParameterNames};
use crate::observability::{ChainSlide, SlidePosition};
use crate::session::breakpoints::Breakpoints;
use crate::session::{
    Answer, Command, DiagnosisProgress, FrameImage, Markers, Recording, RunRecord, SolverPosition, StepRecord,
};
use crate::simulation::PrescribedMotion;
use crate::text::Named;

/// One of the panels: it draws itself, and gives its values.
pub trait Panel: CsvTable {
    /// Draws the panel into the available room of `ui`.
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>);

    /// Panel with the same view and no texture of a window, for a figure; the default where there is no view to choose.
    #[must_use]
    fn view_copy(&self) -> Self
    where
        Self: Sized + Default,
    {
        Self::default()
    }
}

/// Source of camera images, by camera key and index in the stream.
pub trait ImageSource {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage;
}

/// Cameras of a run whose images are shown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ShownCameras {
    #[default]
    Main,
    /// The camera with a key; in a run without it, the main one.
    Key(String),
    /// All side by side.
    All,
}

impl ShownCameras {
    /// `all`, or a key.
    pub fn of_name(name: &str) -> Self {
        if name == "all" { Self::All } else { Self::Key(name.to_owned()) }
    }

    /// The name that [`Self::of_name`] reads; `None` for the main camera.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Main => None,
            Self::Key(key) => Some(key),
            Self::All => Some("all"),
        }
    }

    /// Indices of the shown cameras in the run with cameras of these keys.
    pub(crate) fn indices(&self, keys: &[&str]) -> Range<usize> {
        match self {
            Self::Main => 0..1,
            Self::Key(shown) => {
                let index = keys.iter().position(|key| key == shown).unwrap_or(0);
                index..index + 1
            }
            Self::All => 0..keys.len(),
        }
    }
}

/// The selection, common to all panels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    pub feature: Option<FeatureId>,
    pub parameter: Option<ParameterId>,
    /// Index of the run in panels that show one run.
    pub run: usize,
    /// Cameras of runs with several.
    pub cameras: ShownCameras,
    /// Time range of all plots, in nanoseconds since the log began; `None` for the whole log.
    pub visible_ns: Option<(i64, i64)>,
    /// Direction and distance by which the selected run's chain is moved.
    pub slide: Option<SlidePosition>,
    /// The moved chain at the cursor.
    pub(crate) moved: MovedChain,
    /// Times and value ranges at which plots are read.
    pub reading: Reading,
    /// Calibration tables of the runs.
    pub(crate) flight: FlightTables,
    /// Trust, cause and required accuracy of the runs.
    pub(crate) answers: Answers,
    /// Panel that the window shows from the next frame on.
    pub(crate) wanted_panel: Option<PanelName>,
    /// Motion that the laboratory shows as the planned one from its next frame on.
    pub(crate) planned: Option<PrescribedMotion>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    /// True if the cursor moves.
    pub playing: bool,
    /// Speed in log seconds per second.
    pub speed: f64,
    /// The loop range, in nanoseconds since the log began.
    pub loop_range_ns: Option<(i64, i64)>,
    pub markers: Markers,
    /// The solver iteration at which the step is shown, `None` for the converged step.
    pub solver: Option<SolverPosition>,
    /// True if steps at the cursor are being recomputed.
    pub recomputing: bool,
    /// Breakpoints with their hits so far.
    pub breakpoints: Arc<Breakpoints>,
    /// True while the cursor runs to a hit that the estimators have not reached yet.
    pub running_to_breakpoint: bool,
    /// Progress of the diagnosis of a run, `None` while there is none.
    pub diagnosis: Option<DiagnosisProgress>,
}

impl Default for Playback {
    fn default() -> Self {
        Self {
            playing: false,
            speed: 1.0,
            loop_range_ns: None,
            markers: Markers::default(),
            solver: None,
            recomputing: false,
            breakpoints: Arc::default(),
            running_to_breakpoint: false,
            diagnosis: None,
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
    /// The same of a time range: without the line of the cursor.
    FigureOfRange,
    /// A figure in a report, whose text has the verdicts: plots without the sentences about them.
    FigureOfReport,
}

impl Presentation {
    /// True if buttons, selectors and hints are omitted.
    pub fn is_figure(self) -> bool {
        self != Self::Interactive
    }

    /// True if plots show the cursor as a line.
    pub(crate) fn shows_cursor(self) -> bool {
        self != Self::FigureOfRange
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
    /// Index of the selected run; of the last run where the selection is beyond it.
    pub(crate) fn run_number(&self) -> usize {
        self.selection.run.min(self.recording.runs.len().saturating_sub(1))
    }

    /// The selected run, or the last one if the selection lies beyond it; `None` before the first run has started.
    pub fn selected_run(&self) -> Option<&'a RunRecord> {
        self.recording.runs.get(self.run_number())
    }

    /// The selected run with its step at the cursor.
    pub(crate) fn selected_step(&self) -> Option<(&'a RunRecord, &'a Arc<StepRecord>)> {
        let run = self.selected_run()?;
        Some((run, run.step_at(self.cursor_ns)?))
    }

    /// Names of calibration parameters and joints.
    pub(crate) fn names(&self) -> ParameterNames {
        self.recording.rig.parameter_names()
    }

    /// Calibration table of a run over the whole flight.
    pub(crate) fn flight(&self, ui: &Ui, run: &RunRecord) -> FlightReport {
        self.selection.flight.report(ui.ctx(), self.recording, run, &self.answer(run))
    }

    /// Motion that brings the parameters of a run to the required accuracy; `None` as long as none is needed or known.
    pub(crate) fn motion(&self, ui: &Ui, run: &RunRecord) -> Option<NeededMotion> {
        self.selection.flight.motion(ui.ctx(), self.recording, run, &self.answer(run))
    }

    /// Answer of a run: trust, cause and required accuracy.
    pub(crate) fn answer(&self, run: &RunRecord) -> Arc<Answer> {
        self.selection.answers.of(self.recording, run)
    }

    /// Computes the moved chain of the selected run when position, run or step has changed.
    pub(crate) fn move_chain(&mut self) {
        let run = self.recording.runs.get(self.selection.run);
        let step = run.and_then(|run| Some((run, run.step_at(self.cursor_ns)?)));
        let Selection { slide, moved, .. } = &mut *self.selection;
        moved.update(self.recording, step, slide.as_ref());
    }

    /// The moved chain if it belongs to the selected run's step at the cursor.
    pub(crate) fn moved_chain(&self, stamp_ns: i64) -> Option<&Arc<ChainSlide>> {
        self.selection.moved.at(self.selected_run()?, stamp_ns)
    }
}

/// A panel by its name on the command line, in file names and in saved layouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
pub enum PanelName {
    Image,
    Scene,
    /// Verdicts of the whole flight on every calibration parameter.
    Calibration,
    /// Calibration parameters over time.
    Convergence,
    /// Rank and null directions.
    Rank,
    /// The linearization by blocks.
    Jacobian,
    /// Residuals as a histogram, over time and by factor.
    Residuals,
    /// Values of the selection.
    Inspector,
    /// Observability of a mechanism and a motion without a log.
    Laboratory,
    Comparison,
    /// Breakpoints and their hits.
    Breakpoints,
    /// The timeline at the bottom of the window.
    Timeline,
}

/// Names on the command line, which are also the anchors of the panels' sections in the manual.
impl Named for PanelName {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Image, "image"),
        (Self::Scene, "scene"),
        (Self::Calibration, "calibration"),
        (Self::Convergence, "convergence"),
        (Self::Rank, "rank"),
        (Self::Jacobian, "jacobian"),
        (Self::Residuals, "residuals"),
        (Self::Inspector, "inspector"),
        (Self::Laboratory, "laboratory"),
        (Self::Comparison, "comparison"),
        (Self::Breakpoints, "breakpoints"),
        (Self::Timeline, "timeline"),
    ];
}

impl PanelName {
    /// The panels that can be moved and hidden: all but the timeline.
    pub fn movable() -> impl Iterator<Item = Self> {
        Self::all().filter(|panel| *panel != Self::Timeline)
    }

    /// Title in the window.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Image => "Image",
            Self::Scene => "Scene",
            Self::Calibration => "Calibration",
            Self::Convergence => "Convergence",
            Self::Rank => "Rank",
            Self::Jacobian => "Jacobian",
            Self::Residuals => "Residuals",
            Self::Inspector => "Inspector",
            Self::Laboratory => "Laboratory",
            Self::Comparison => "Comparison",
            Self::Breakpoints => "Breakpoints",
            Self::Timeline => "Timeline",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialog {
    /// Opens a log or a saved session.
    OpenLog,
    /// Adds a run on the same log.
    AddRun,
    /// Forks the selected run at the cursor.
    Fork,
    /// Finds the cause of residuals of the selected run that disagree with their noise.
    Diagnosis,
    /// Shows which sources of measurements agree, by the check of the log.
    Sources,
    /// Lists the markers with their names.
    Markers,
    Palette,
    Settings,
    /// Composes a figure of a panel for a paper.
    Figure,
    /// Question asked before a run is removed.
    RemoveRun,
    /// Question asked before unsaved work is discarded.
    Unsaved,
}

pub trait CsvTable {
    /// The table with its header line, in seconds, radians, metres and pixels; empty where there are no values.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String;
}
