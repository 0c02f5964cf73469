//! The convergence panel: one small plot per calibration parameter, along the chain and in groups.

mod groups;
mod layout;
mod model;
mod paint;
mod range;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use egui::{Label, Rect, RichText, ScrollArea, Ui, vec2};

use self::groups::{ConvergenceView, groups_of};
use self::model::{CalibrationHistory, ConvertedHistory};
use self::paint::ParameterCurves;
use super::derived::chain_values::{ParameterValues, true_values};
use super::parameter_names::part_of;
use super::plot::Wheel;
use super::widgets::empty_ui;
use super::{CsvTable, Panel, PanelContext};
use crate::gimbal::{ParameterGroup, ParameterId};
use crate::session::{StepColumn, StepRecord};
use crate::table::csv;

/// State of the convergence panel: the calibration of each run over time, and its curves.
#[derive(Debug, Default)]
pub struct ConvergencePanel {
    histories: Vec<CalibrationHistory>,
    /// The other runs in the parameterization of the shown run.
    converted: Vec<ConvertedHistory>,
    curves: BTreeMap<(usize, ParameterId), ParameterCurves>,
    /// View of a calibration with more than one group.
    view: ConvergenceView,
    folded: Vec<ParameterGroup>,
}

impl CsvTable for ConvergencePanel {
    /// The calibration of the shown run over the whole recording, with the ground truth in the parameterization at the
    /// cursor.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let (rig, names) = (&ctx.recording.rig, ctx.names());
        let ground_truth = true_values(ctx.recording, run, ctx.cursor_ns).unwrap_or_default();
        let mut columns = vec![StepRecord::stamp_column()];
        for (parameter, estimate) in run.parameter_columns(rig) {
            let (name, ground_truth) = (names.name(parameter), ground_truth.get(&parameter).copied());
            columns.extend(estimate);
            columns
                .push(StepColumn::new(format!("{name}_truth_{}", parameter.dimension().unit()), move |_| ground_truth));
            columns.push(StepColumn::new(format!("{name}_error_in_sigmas"), move |step: &StepRecord| {
                let calibration = &step.report.calibration;
                let sigma = calibration.sigma_of(parameter).filter(|sigma| *sigma > 0.0)?;
                Some(parameter.dimension().difference(calibration.value_of(parameter)?, ground_truth?) / sigma)
            }));
        }
        let estimated = run.steps.iter().filter(|step| step.report.newest().is_some());
        csv(&columns, estimated.map(std::sync::Arc::as_ref))
    }
}

impl Panel for ConvergencePanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        self.histories.resize_with(ctx.recording.runs.len(), CalibrationHistory::default);
        for (history, run) in self.histories.iter_mut().zip(&ctx.recording.runs) {
            history.read(run);
        }
        let runs = self.histories.len();
        self.curves.retain(|(run, _), _| *run < runs);

        let shown = ctx.run_number();
        let Some(history) = self.histories.get(shown) else {
            empty_ui(ui, "No runs");
            return;
        };
        if history.stamps_ns.is_empty() {
            empty_ui(ui, "No steps yet");
            return;
        }
        // Only the parameters of the parameterization at the cursor; after a switch the previous ones are no longer
        // estimated.
        let row = history.row_at(ctx.cursor_ns).unwrap_or(0);
        let mut parameters: Vec<ParameterId> = history
            .parameters
            .iter()
            .filter(|(_, parameter)| parameter.values[row].is_finite())
            .map(|(parameter, _)| *parameter)
            .collect();
        if parameters.is_empty() {
            let label = &ctx.recording.runs[shown].spec.label;
            empty_ui(ui, &format!("Calibration fixed in run {label}"));
            return;
        }
        parameters.sort_by_key(|parameter| part_of(*parameter));
        self.read_converted(ctx, shown);
        let ground_truth = true_values(ctx.recording, &ctx.recording.runs[shown], ctx.cursor_ns).unwrap_or_default();

        let mut available = ui.available_rect_before_wrap();
        if ctx.presentation.is_figure() {
            let height = paint::legend_rows(ui, ctx, available);
            let (rows, below) = available.split_top_bottom_at_y(available.top() + height);
            ui.advance_cursor_after_rect(rows);
            available = below.with_min_y(ui.cursor().top());
        }
        if prior_ui(ui, ctx) {
            available = available.with_min_y(ui.cursor().top());
        }
        let groups = groups_of(&parameters);
        if groups.len() > 1 && !ctx.presentation.is_figure() {
            groups::choice_ui(ui, &mut self.view, &groups);
            available = available.with_min_y(ui.cursor().top());
        }
        let chosen = match self.view {
            ConvergenceView::Group(chosen) => groups.iter().any(|(group, _)| *group == chosen).then_some(chosen),
            ConvergenceView::All => None,
        };
        if let Some(chosen) = chosen {
            parameters.retain(|parameter| parameter.group() == chosen);
        }
        let by_group = chosen.is_none() && groups.len() > 1;
        if by_group {
            parameters.retain(|parameter| !self.folded.contains(&parameter.group()));
        }
        let open = groups.iter().map(|(group, count)| (*group, if self.folded.contains(group) { 0 } else { *count }));
        let open: Vec<_> = open.collect();
        let lay_out = |parameters: &[ParameterId], available: Rect| {
            if by_group { layout::by_group(&open, available) } else { layout::lay_out(parameters, available) }
        };
        let layout = lay_out(&parameters, available);
        if layout.height > available.height() + 1.0 {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                let top = ui.available_rect_before_wrap().min;
                let narrow = Rect::from_min_size(top, vec2(available.width() - 10.0, available.height()));
                let layout = lay_out(&parameters, narrow);
                ui.allocate_space(vec2(1.0, layout.height));
                self.headings_ui(ui, ctx, &groups, &layout);
                self.cells_ui(ui, ctx, (shown, Wheel::Scrolls), &parameters, &ground_truth, &layout);
            });
        } else {
            self.headings_ui(ui, ctx, &groups, &layout);
            self.cells_ui(ui, ctx, (shown, Wheel::Zooms), &parameters, &ground_truth, &layout);
        }
    }
}

impl ConvergencePanel {
    fn headings_ui(
        &mut self,
        ui: &Ui,
        ctx: &PanelContext<'_>,
        groups: &[(ParameterGroup, usize)],
        layout: &layout::PlotGrid,
    ) {
        for (group, (_, rect)) in groups.iter().zip(&layout.groups) {
            groups::heading_ui(ui, ctx, &mut self.folded, *group, *rect);
        }
    }

    /// Converts the other runs to the parameterization of the shown run at the cursor.
    fn read_converted(&mut self, ctx: &PanelContext<'_>, shown: usize) {
        let runs = &ctx.recording.runs;
        let parameterization_of = |run: usize| {
            let step = runs[run].step_at(ctx.cursor_ns).or_else(|| runs[run].steps.first())?;
            Some(step.report.calibration.parameterization)
        };
        let target = parameterization_of(shown);
        self.converted.resize_with(runs.len(), ConvertedHistory::default);
        for (run, converted) in self.converted.iter_mut().enumerate() {
            match target {
                Some(target) if run != shown && parameterization_of(run) != parameterization_of(shown) => {
                    converted.read(&runs[run], &ctx.recording.rig, target);
                }
                _ => *converted = ConvertedHistory::default(),
            }
        }
    }

    fn cells_ui(
        &mut self,
        ui: &Ui,
        ctx: &mut PanelContext<'_>,
        (shown, wheel): (usize, Wheel),
        parameters: &[ParameterId],
        ground_truth: &ParameterValues,
        layout: &layout::PlotGrid,
    ) {
        for (part, rect) in &layout.headings {
            paint::heading(ui, ctx, *part, *rect);
        }
        if let Some(rect) = layout.legend.filter(|_| !ctx.presentation.is_figure()) {
            paint::legend(ui, ctx, rect);
        }
        let gutters = layout.time_gutters();
        let verdicts = ctx.flight(ui, &ctx.recording.runs[shown]).history;
        for ((parameter, rect), below) in parameters.iter().zip(&layout.cells).zip(gutters) {
            if ui.is_rect_visible(*rect) {
                let data = paint::PlotData {
                    histories: &self.histories,
                    converted: &self.converted,
                    ground_truth,
                    shown,
                    verdicts: &verdicts,
                    wheel,
                };
                paint::cell_ui(ui, ctx, &data, &mut self.curves, *parameter, (*rect, below));
            }
        }
    }
}

/// Names the earlier flights from whose calibration the runs start; false without any.
fn prior_ui(ui: &mut Ui, ctx: &PanelContext<'_>) -> bool {
    let Some(prior) = ctx.recording.prior.as_deref() else { return false };
    // The first entry is the prior of the rig.
    let flights: Vec<&str> = prior.history.iter().skip(1).map(|flight| flight.source.as_str()).collect();
    let growth = if prior.growth == 1.0 { String::new() } else { format!(", σ × {}", prior.growth) };
    let text = format!("Prior: calibration after {}{growth}", flights.join(", then "));
    let label = Label::new(RichText::new(text).color(ctx.theme.text_weak)).truncate();
    ui.add(label).on_hover_text(format!(
        "All runs start from values and covariance of these flights instead of the rig's:\n{}",
        prior.folder.display()
    ));
    true
}
