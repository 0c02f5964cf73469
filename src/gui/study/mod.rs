//! View of a study: many runs in a table, as distributions, paired differences, success rates, parallel coordinates and
//! errors against σ.
//!
//! Like the panels of a session it reads plain data and pushes requests; the application executes them.

mod csv;
mod model;
mod parallel;
mod parameters;
mod plots;
mod points;
mod runs_table;
mod strips;
#[cfg(test)]
mod tests;
mod toolbar;

use std::sync::Arc;

use egui::{Align, Button, CentralPanel, Frame, Label, Layout, Panel, Rect, RichText, Ui, UiBuilder, WidgetInfo, pos2};

use self::model::StudyModel;
pub use self::model::StudyOptions;
use self::parallel::ParallelPanel;
use self::parameters::ParametersPanel;
use self::plots::{DistributionPanel, PairedPanel, SuccessPanel};
use self::runs_table::RunsTablePanel;
use super::Presentation;
use super::theme::{PANEL_MARGIN, Theme};
use super::units::counted;
use crate::study::view::{GroupSummary, Metric, ParameterErrors, Study, parameter_errors, summarize_groups};

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

impl StudyPanel {
    pub const ALL: [Self; 6] =
        [Self::Runs, Self::Distributions, Self::Differences, Self::Success, Self::Parallel, Self::Parameters];

    /// Name on the command line, and title.
    const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Runs => ("runs", "Runs"),
            Self::Distributions => ("distributions", "Distributions"),
            Self::Differences => ("differences", "Paired differences"),
            Self::Success => ("success", "Success rate"),
            Self::Parallel => ("parallel", "Parallel coordinates"),
            Self::Parameters => ("parameters", "Parameter errors"),
        }
    }

    /// Name on the command line.
    pub const fn as_str(self) -> &'static str {
        self.names().0
    }

    /// Title in the window.
    pub const fn title(self) -> &'static str {
        self.names().1
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

    /// The metric of all plots.
    pub(crate) fn metric(&self) -> Option<Metric> {
        self.model.metric().cloned()
    }
}

pub struct StudyState {
    study: Arc<Study>,
    model: StudyModel,
    runs: RunsTablePanel,
    distributions: DistributionPanel,
    differences: PairedPanel,
    success: SuccessPanel,
    parallel: ParallelPanel,
    parameters: ParametersPanel,
    pointed: Option<usize>,
    /// Panel that fills the window.
    maximized: Option<StudyPanel>,
    /// Front panel of the two lower right ones.
    lower_right: StudyPanel,
    /// Requests to the application, which takes them after each frame.
    pub requests: Vec<StudyRequest>,
}

impl StudyState {
    /// Creates the view of a study with filter, groups and metric.
    ///
    /// # Errors
    /// When the options name a column that the study does not have, or a condition cannot be parsed.
    pub fn new(study: Arc<Study>, options: &StudyOptions) -> Result<Self, String> {
        let model = StudyModel::new(&study, options)?;
        Ok(Self {
            runs: RunsTablePanel::new(&study),
            parallel: ParallelPanel::new(&study),
            parameters: ParametersPanel::new(&study),
            distributions: DistributionPanel::default(),
            differences: PairedPanel::default(),
            success: SuccessPanel::default(),
            study,
            model,
            pointed: None,
            maximized: None,
            lower_right: StudyPanel::Parallel,
            requests: Vec::new(),
        })
    }

    pub fn study(&self) -> &Arc<Study> {
        &self.study
    }

    /// Draws one panel into the available space of `ui`.
    fn panel_ui(
        &mut self,
        panel: StudyPanel,
        ui: &mut Ui,
        theme: &Theme,
        presentation: Presentation,
        now_pointed: &mut Option<usize>,
    ) {
        let ctx = &mut StudyContext {
            study: &self.study,
            model: &mut self.model,
            theme,
            presentation,
            pointed: self.pointed,
            now_pointed,
            requests: &mut self.requests,
        };
        match panel {
            StudyPanel::Runs => self.runs.ui(ui, ctx),
            StudyPanel::Distributions => self.distributions.ui(ui, ctx),
            StudyPanel::Differences => self.differences.ui(ui, ctx),
            StudyPanel::Success => self.success.ui(ui, ctx),
            StudyPanel::Parallel => self.parallel.ui(ui, ctx),
            StudyPanel::Parameters => self.parameters.ui(ui, ctx),
        }
    }

    /// Summary values of the groups.
    pub fn group_summaries(&mut self) -> Vec<GroupSummary> {
        self.model.update(&self.study);
        let (model, study) = (&self.model, &self.study);
        let reference = model.reference().unwrap_or_default();
        let (arranged, success) = (&model.arranged, &model.success.filter);
        summarize_groups(study, arranged, model.group(), reference, model.metric(), success)
    }

    /// Errors of the calibration parameters of the shown runs.
    pub fn parameter_errors(&mut self) -> Vec<ParameterErrors> {
        self.model.update(&self.study);
        parameter_errors(&self.study, &self.study.run_of_parameter_rows(), &self.model.arranged.rows)
    }

    pub fn shown_runs(&mut self) -> usize {
        self.model.update(&self.study);
        self.model.arranged.rows.len()
    }

    /// Filter, column of groups, metric, reference and condition of success in effect.
    pub fn options(&self) -> StudyOptions {
        self.model.options()
    }

    /// Title of the metric with its unit; empty in a study without numbers.
    pub fn metric_title(&self) -> String {
        self.model.metric().map(Metric::title).unwrap_or_default()
    }

    /// Values of a panel as comma-separated values, in the stored units.
    pub fn csv_table(&mut self, panel: StudyPanel) -> String {
        self.model.update(&self.study);
        csv::table(panel, &self.study, &mut self.model)
    }
}

/// Draws one panel into all of `ui`.
pub fn study_panel_ui(
    panel: StudyPanel,
    ui: &mut Ui,
    state: &mut StudyState,
    theme: &Theme,
    presentation: Presentation,
) {
    state.model.update(&state.study);
    let frame = Frame::new().fill(theme.surface).inner_margin(PANEL_MARGIN);
    let mut pointed = None;
    CentralPanel::no_frame().frame(frame).show(ui, |ui| state.panel_ui(panel, ui, theme, presentation, &mut pointed));
    state.pointed = pointed;
}

pub fn study_ui(ui: &mut Ui, state: &mut StudyState, theme: &Theme) {
    let bar = Frame::new().fill(theme.surface).inner_margin(egui::Margin::symmetric(8, 4));
    Panel::top("study bar").frame(bar).show(ui, |ui| {
        toolbar::ui(ui, &state.study, &mut state.model, theme, &mut state.requests);
    });
    state.model.update(&state.study);
    let ground = Frame::new().fill(theme.background).inner_margin(3);
    let mut pointed = None;
    CentralPanel::no_frame().frame(ground).show(ui, |ui| {
        let room = ui.available_rect_before_wrap();
        for (panel, place) in places(room, state.maximized, state.lower_right) {
            framed_ui(ui, state, panel, place, theme, &mut pointed);
        }
    });
    if state.pointed != pointed {
        state.pointed = pointed;
        ui.ctx().request_repaint();
    }
}

/// Rectangle of every visible panel.
fn places(room: Rect, maximized: Option<StudyPanel>, lower_right: StudyPanel) -> Vec<(StudyPanel, Rect)> {
    use StudyPanel::{Differences, Distributions, Runs, Success};
    if let Some(panel) = maximized {
        return vec![(panel, room)];
    }
    const GAP: f32 = 1.5;
    let part = |from: [f32; 2], to: [f32; 2]| {
        let at = |[x, y]: [f32; 2]| pos2(room.left() + x * room.width(), room.top() + y * room.height());
        Rect::from_min_max(at(from).round(), at(to).round()).shrink(GAP)
    };
    vec![
        (Distributions, part([0.0, 0.0], [0.39, 0.5])),
        (Differences, part([0.39, 0.0], [0.73, 0.5])),
        (Success, part([0.73, 0.0], [1.0, 0.5])),
        (Runs, part([0.0, 0.5], [0.55, 1.0])),
        (lower_right, part([0.55, 0.5], [1.0, 1.0])),
    ]
}

/// Draws a panel with its title and buttons.
fn framed_ui(
    ui: &mut Ui,
    state: &mut StudyState,
    panel: StudyPanel,
    place: Rect,
    theme: &Theme,
    pointed: &mut Option<usize>,
) {
    ui.painter().rect_filled(place, 0.0, theme.surface);
    let inner = place.shrink(f32::from(PANEL_MARGIN));
    ui.scope_builder(UiBuilder::new().max_rect(inner).id_salt(panel.as_str()), |ui| {
        ui.set_clip_rect(place.intersect(ui.clip_rect()));
        ui.spacing_mut().item_spacing.y = 3.0;
        ui.horizontal(|ui| {
            if matches!(panel, StudyPanel::Parallel | StudyPanel::Parameters) && state.maximized.is_none() {
                for tab in [StudyPanel::Parallel, StudyPanel::Parameters] {
                    if ui.selectable_label(tab == panel, tab.title()).clicked() {
                        state.lower_right = tab;
                    }
                }
            } else {
                ui.add(Label::new(RichText::new(panel.title()).color(theme.text_strong)).truncate());
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let (sign, name) = match state.maximized {
                    Some(_) => ("🗗", "Show all panels"),
                    None => ("🗖", "Maximize"),
                };
                if small_button(ui, sign, &format!("{name}: {}", panel.title())) {
                    state.maximized = if state.maximized.is_some() { None } else { Some(panel) };
                }
                if small_button(ui, "📋", &format!("Copy table (CSV): {}", panel.title())) {
                    let table = csv::table(panel, &state.study, &mut state.model);
                    let what =
                        format!("{}: {}", panel.title(), counted(table.lines().count().saturating_sub(1), "row"));
                    state.requests.push(StudyRequest::Copy(table, what));
                }
            });
        });
        state.panel_ui(panel, ui, theme, Presentation::Interactive, pointed);
    });
}

fn small_button(ui: &mut Ui, sign: &str, name: &str) -> bool {
    let button = ui.add(Button::new(RichText::new(sign).small()).small());
    button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, name));
    button.on_hover_text(name).clicked()
}
