//! The panels of the study view by name, and what a panel gets and gives in a frame.

use egui::Ui;

use super::model::StudyModel;
use crate::gui::Presentation;
use crate::gui::theme::Theme;
use crate::study::view::{Metric, Study};
use crate::text::Named;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum StudyPanel {
    /// One line per run.
    Runs,
    /// A metric by group, with every run as a point.
    Distributions,
    /// Differences to a reference group on equal inputs.
    Differences,
    /// Success rate by group.
    Success,
    /// Runs as lines over parallel axes.
    Parallel,
    /// Errors of calibration parameters against σ.
    Parameters,
}

/// Names on the command line.
impl Named for StudyPanel {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Runs, "runs"),
        (Self::Distributions, "distributions"),
        (Self::Differences, "differences"),
        (Self::Success, "success"),
        (Self::Parallel, "parallel"),
        (Self::Parameters, "parameters"),
    ];
}

impl StudyPanel {
    /// Title in the window.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Runs => "Runs",
            Self::Distributions => "Distributions",
            Self::Differences => "Paired differences",
            Self::Success => "Success rate",
            Self::Parallel => "Parallel coordinates",
            Self::Parameters => "Parameter errors",
        }
    }
}

/// A request of the study view to the application.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StudyRequest {
    /// Open the run of this row in the debugger, together with the comparable runs of the same log.
    OpenRun(usize),
    /// Put a text into the clipboard; the second text is its description.
    Copy(String, String),
    Close,
}

/// Inputs and outputs of a panel of the study in one frame.
pub(crate) struct StudyContext<'a> {
    pub(crate) study: &'a Study,
    pub(crate) model: &'a mut StudyModel,
    pub(crate) theme: &'a Theme,
    pub(crate) presentation: Presentation,
    /// Run under the pointer in any panel, in the last frame.
    pub(crate) pointed: Option<usize>,
    /// Run under the pointer in this frame.
    pub(crate) now_pointed: &'a mut Option<usize>,
    pub(crate) requests: &'a mut Vec<StudyRequest>,
}

impl StudyContext<'_> {
    /// Marks the run under the pointer in all panels, and shows its name and the effect of a click next to the pointer.
    pub(crate) fn point_at(&mut self, ui: &Ui, response: &egui::Response, row: usize, value: &str) {
        *self.now_pointed = Some(row);
        let title = self.study.title_of(row);
        let worst = self.study.runs.number(row, crate::study::view::columns::WORST_FRAME_S);
        let opens = match worst {
            Some(worst_s) => format!("Click: open at its worst frame, {worst_s:.2} s"),
            None => "Click: open this run".to_owned(),
        };
        let text = if value.is_empty() { format!("{title}\n{opens}") } else { format!("{title}\n{value}\n{opens}") };
        response.clone().on_hover_text_at_pointer(text);
        ui.ctx().set_cursor_icon(egui::CursorIcon::PointingHand);
        if response.clicked() {
            self.requests.push(StudyRequest::OpenRun(row));
        }
    }

    pub(crate) fn metric(&self) -> Option<Metric> {
        self.model.metric().cloned()
    }
}
