//! Residuals over time; one row per step of a run.

use super::image_plane::{ImageGeometry, ImageMeans};
use super::{ResidualView, ResidualsPanel, rms_px};
use crate::estimator::FactorKind;
use crate::files::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::gui::{CsvTable, PanelContext};
use crate::session::{ImageResiduals, StepRecord};
use crate::text::Named as _;

impl CsvTable for ResidualsPanel {
    /// Reprojection RMS and χ² by kind of factor, for every step of every run.
    /// Of the view of the image plane: mean residual by cell, in the window at the cursor and in the whole flight.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        if self.view == ResidualView::ImagePlane {
            return image_plane_table(ctx);
        }
        let solved = |step: &&std::sync::Arc<StepRecord>| !step.report.window.is_empty();
        let mut factors: Vec<FactorKind> = Vec::new();
        for summary in ctx.recording.runs.iter().flat_map(|run| &run.steps).flat_map(|step| &step.report.residuals) {
            if !factors.contains(&summary.factor) {
                factors.push(summary.factor);
            }
        }
        let mut columns = ["t_s", "run", "rms_before_px", "rms_after_px"].map(str::to_owned).to_vec();
        for factor in &factors {
            let factor = factor.name();
            columns.extend(["count", "chi2_before", "chi2_after"].map(|part| format!("{factor}_{part}")));
        }
        let mut table = CsvWriter::new(columns);
        for run in &ctx.recording.runs {
            for step in run.steps.iter().filter(solved) {
                let report = &step.report;
                let heads = [
                    seconds_cell(report.stamp_ns),
                    run.spec.label.clone(),
                    number_cell(report.reprojection_rms_before_px),
                    number_cell(rms_px(report)),
                ];
                let cells = factors.iter().flat_map(|factor| {
                    let summary = report.residuals.iter().find(|summary| summary.factor == *factor);
                    summary.map_or_else(Default::default, |summary| {
                        [summary.count.to_string(), number_cell(summary.chi2_before), number_cell(summary.chi2_after)]
                    })
                });
                table.row(heads.into_iter().chain(cells));
            }
        }
        table.into_text()
    }
}

fn image_plane_table(ctx: &PanelContext<'_>) -> String {
    let columns =
        ["run", "part", "u_from_px", "u_to_px", "v_from_px", "v_to_px", "count", "mean_u_px", "mean_v_px", "error_px"];
    let mut table = CsvWriter::new(columns.map(str::to_owned).to_vec());
    let run = ctx.selected_run();
    let shown = run.and_then(|run| Some((run, run.step_at(ctx.cursor_ns)?, ImageGeometry::of(ctx, run)?)));
    let Some((run, step, frame)) = shown else { return String::new() };
    let window = ImageResiduals::of_window(&step.report);
    for (part, residuals) in [("window", &window), ("flight", &run.image_residuals)] {
        for (index, cell) in ImageMeans::of(residuals, &frame).cells.iter().enumerate() {
            let [u, v] = frame.cell_px(index);
            let mean_px = cell.mean_px();
            let mean = |value: Option<f64>| value.map_or_else(String::new, number_cell);
            let edges = [u[0], u[1], v[0], v[1]].map(number_cell);
            let cells = [run.spec.label.clone(), part.to_owned()].into_iter().chain(edges).chain([
                cell.count.to_string(),
                mean(mean_px.map(|mean_px| mean_px.x)),
                mean(mean_px.map(|mean_px| mean_px.y)),
                mean(mean_px.map(|_| cell.error_px())),
            ]);
            table.row(cells);
        }
    }
    table.into_text()
}
