//! Laboratory panel: observability of the parameters for a mechanism, its parameterizations and a motion without a log,
//! and a planned motion with the σ that it leaves.
//!
//! `dcvins degeneracy` runs the same experiments, `dcvins plan` the same planned motions.

mod choices;
mod plan;
mod request;
#[cfg(test)]
mod tests;
mod worker;

use egui::{Color32, Label, RichText, ScrollArea, Ui};

pub use self::request::MotionRequest;

use self::choices::Choices;
use self::plan::PlanView;
use self::worker::Worker;
use super::help::terms::window;
use super::rank::columns::{RankColumn, columns_ui};
use super::{CsvTable, Panel, PanelContext};
use crate::gimbal::ParameterId;
use crate::observability::RankReport;
use crate::observability::laboratory::{LaboratoryReport, LaboratoryResult};
use crate::simulation::PrescribedMotion;
use crate::table::{Column, csv};
use crate::text::Named as _;

/// Content of the laboratory panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum LaboratoryView {
    /// A listed motion with several parameterizations.
    #[default]
    Experiment,
    /// A motion that is edited.
    Plan,
}

/// State of the laboratory panel: choices and results.
#[derive(Default)]
pub struct LaboratoryPanel {
    /// True if experiments run on another thread, as in the window; screenshots wait for them.
    pub in_background: bool,
    view: LaboratoryView,
    choices: Choices,
    worker: Worker,
    plan: PlanView,
}

impl CsvTable for LaboratoryPanel {
    /// Singular values and directions of each parameterization, or σ after the planned motion; one row per singular value
    /// or weight of a direction.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        /// Parameterization, kind, number from 1, singular value, and for a direction the weight of a parameter.
        type SpectrumRow<'a> = (&'a str, &'static str, usize, f64, Option<(ParameterId, f64)>);
        type SpectrumColumn<'a> = Column<'a, SpectrumRow<'a>>;
        if self.view == LaboratoryView::Plan {
            return self.plan.csv_table(ctx);
        }
        let (ranks, names) = (self.ranks(ctx), ctx.names());
        let columns = [
            SpectrumColumn::new("form", |(form, ..)| *form),
            SpectrumColumn::new("kind", |(_, kind, ..)| *kind),
            SpectrumColumn::new("number", |(_, _, number, ..)| *number),
            SpectrumColumn::new("singular_value", |(.., value, _)| *value),
            SpectrumColumn::new("parameter", |(.., of)| of.map(|(parameter, _)| names.name(parameter))),
            SpectrumColumn::new("weight", |(.., of)| of.map(|(_, weight)| weight)),
        ];
        let mut rows = Vec::new();
        for (form, rank) in &ranks {
            let values = (1..).zip(&rank.singular_values);
            rows.extend(values.map(|(number, value)| (form.as_str(), "singular value", number, *value, None)));
            for (number, direction) in (1..).zip(&rank.directions) {
                let weights = rank.parameters.iter().zip(&direction.weights).filter(|(_, weight)| **weight != 0.0);
                rows.extend(weights.map(|(parameter, weight)| {
                    (form.as_str(), direction.kind(), number, direction.singular_value, Some((*parameter, *weight)))
                }));
            }
        }
        csv(&columns, rows)
    }
}

impl Panel for LaboratoryPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        if let Some(motion) = ctx.selection.planned.take() {
            self.open_motion(motion);
        }
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 3.0;
            if !ctx.presentation.is_figure() {
                ui.horizontal(|ui| {
                    ui.selectable_value(&mut self.view, LaboratoryView::Experiment, "Listed motion")
                        .on_hover_text("Ranks of several parameterizations with a listed motion");
                    ui.selectable_value(&mut self.view, LaboratoryView::Plan, "Planned motion")
                        .on_hover_text("σ of the selected run's parameters after a motion whose curves are dragged");
                });
            }
            if self.view == LaboratoryView::Plan {
                self.plan.ui(ui, ctx, self.in_background);
                return;
            }
            if ctx.presentation.is_figure() {
                self.choices.summary_ui(ui, ctx);
            } else {
                self.choices.ui(ui, ctx);
            }
            let experiment = match self.choices.experiment(ctx) {
                Ok(experiment) => experiment,
                Err(problem) => {
                    ui.label(RichText::new(problem).color(ctx.theme.warn));
                    return;
                }
            };
            self.worker.request(&experiment, self.in_background);
            let (results, asked) = self.worker.results();
            if results.len() < asked && self.worker.is_busy() {
                let text = format!("Experiment {} of {asked}…", results.len() + 1);
                ui.horizontal(|ui| {
                    ui.spinner();
                    ui.label(RichText::new(text).color(ctx.theme.text_weak));
                });
                ui.ctx().request_repaint();
            }
            if let Some(setup) = self.worker.setup() {
                let text = assumptions(&LaboratoryReport::new(setup, &[]));
                let line = Label::new(RichText::new(text).small().color(ctx.theme.text_weak)).wrap();
                ui.add(line).on_hover_text(window::ASSUMPTIONS.meaning);
            }
            let results: Vec<LaboratoryResult> = results.to_vec();
            let columns: Vec<RankColumn<'_>> = results
                .iter()
                .map(|result| RankColumn {
                    title: result.form.name(),
                    color: color_of(&result.form.name(), ctx),
                    rank: &result.rank,
                })
                .collect();
            columns_ui(ui, ctx, &columns);
        });
    }

    fn view_copy(&self) -> Self {
        Self {
            in_background: false,
            view: self.view,
            choices: self.choices.clone(),
            worker: Worker::default(),
            plan: self.plan.view_copy(),
        }
    }
}

impl LaboratoryPanel {
    /// Shows a motion as the planned one.
    pub fn open_motion(&mut self, motion: PrescribedMotion) {
        self.view = LaboratoryView::Plan;
        self.plan.open(motion);
    }

    /// Request about a file since the last call.
    pub(in crate::gui) fn take_request(&mut self) -> Option<MotionRequest> {
        self.plan.request.take()
    }

    /// The chosen parameterizations with their rank reports; waits for missing results.
    pub(in crate::gui) fn ranks(&mut self, ctx: &PanelContext<'_>) -> Vec<(String, RankReport)> {
        if let Ok(experiment) = self.choices.experiment(ctx) {
            self.worker.request(&experiment, self.in_background);
        }
        self.worker.results().0.iter().map(|result| (result.form.name(), result.rank.clone())).collect()
    }
}

/// Colour of the run with this parameterization; the text colour without one, because the columns are no runs.
fn color_of(form: &str, ctx: &PanelContext<'_>) -> Color32 {
    let run = ctx.recording.runs.iter().position(|run| run.spec.parameterization.name() == form);
    run.map_or(ctx.theme.text, |run| ctx.theme.run(run).color)
}

/// Assumptions of the experiment in one sentence.
fn assumptions(report: &LaboratoryReport) -> String {
    let frozen = if report.frozen_joints.is_empty() {
        String::new()
    } else {
        format!(", {} fixed", report.frozen_joints.join(", "))
    };
    format!(
        "{}: {}{frozen}. Joint angles {}, poses {}; {} frames every {} s, {} landmarks, pixel σ {} px; column scale 10° and 3 cm",
        report.motion,
        report.motion_meaning,
        report.joint_angles,
        report.poses,
        report.frames,
        report.frame_period_s,
        report.landmarks,
        report.pixel_sigma_px
    )
}
