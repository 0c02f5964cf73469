//! View of a study: many runs in a table, as distributions, paired differences, success rates, parallel coordinates and
//! errors against σ.
//!
//! Like the panels of a session it reads plain data and pushes requests; the application executes them.

mod context;
mod csv;
mod model;
mod parallel;
mod parallel_axes;
mod parameters;
mod plots;
mod points;
mod runs_table;
mod strips;
#[cfg(test)]
pub(crate) mod tests;
mod toolbar;

use std::sync::Arc;

use egui::{Align, Button, CentralPanel, Frame, Label, Layout, Panel, Rect, RichText, Ui, UiBuilder, WidgetInfo, pos2};

use self::context::StudyContext;
pub use self::context::{StudyPanel, StudyRequest};
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
use crate::text::Named as _;

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
    ui.scope_builder(UiBuilder::new().max_rect(inner).id_salt(panel.name()), |ui| {
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
