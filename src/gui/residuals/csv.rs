//! Residuals over time; one row per step of a run.

use super::image_plane::{ImageGeometry, ImageMeans};
use super::{ResidualView, ResidualsPanel, rms_px};
use crate::estimator::{FactorKind, ResidualSummary};
use crate::gui::{CsvTable, PanelContext};
use crate::session::{ImageResiduals, ResidualSum, RunRecord, StepRecord};
use crate::table::{Column, Stamp, csv, distinct};
use crate::text::Named as _;

type StepColumn<'a> = Column<'a, (&'a RunRecord, &'a StepRecord)>;

impl CsvTable for ResidualsPanel {
    /// Reprojection RMS and χ² by kind of factor, for every step of every run.
    /// Of the view of the image plane: mean residual by cell, in the window at the cursor and in the whole flight.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        if self.view == ResidualView::ImagePlane {
            return image_plane_table(ctx);
        }
        let mut columns = vec![
            StepColumn::new("t_s", |(_, step)| Stamp(step.report.stamp_ns)),
            StepColumn::new("run", |(run, _)| run.spec.label.as_str()),
            StepColumn::new("rms_before_px", |(_, step)| step.report.reprojection_rms_before_px),
            StepColumn::new("rms_after_px", |(_, step)| rms_px(&step.report)),
        ];
        let steps = || ctx.recording.runs.iter().flat_map(|run| run.steps.iter().map(move |step| (run, &**step)));
        let factors = distinct(steps().flat_map(|(_, step)| &step.report.residuals).map(|summary| summary.factor));
        columns.extend(factors.into_iter().flat_map(|factor| {
            let name = |part: &str| format!("{}_{part}", factor.name());
            [
                StepColumn::new(name("count"), move |(_, step)| Some(summary_of(step, factor)?.count)),
                StepColumn::new(name("chi2_before"), move |(_, step)| Some(summary_of(step, factor)?.chi2_before)),
                StepColumn::new(name("chi2_after"), move |(_, step)| Some(summary_of(step, factor)?.chi2_after)),
            ]
        }));
        csv(&columns, steps().filter(|(_, step)| !step.report.window.is_empty()))
    }
}

fn summary_of(step: &StepRecord, factor: FactorKind) -> Option<&ResidualSummary> {
    step.report.residuals.iter().find(|summary| summary.factor == factor)
}

fn image_plane_table(ctx: &PanelContext<'_>) -> String {
    /// Run, part of the run, edges in u and in v, and the residuals of a cell.
    type CellColumn<'a> = Column<'a, (&'a str, &'static str, [[f64; 2]; 2], ResidualSum)>;
    let columns = [
        CellColumn::new("run", |(run, ..)| *run),
        CellColumn::new("part", |(_, part, ..)| *part),
        CellColumn::new("u_from_px", |(_, _, [u, _], _)| u[0]),
        CellColumn::new("u_to_px", |(_, _, [u, _], _)| u[1]),
        CellColumn::new("v_from_px", |(_, _, [_, v], _)| v[0]),
        CellColumn::new("v_to_px", |(_, _, [_, v], _)| v[1]),
        CellColumn::new("count", |(.., cell)| cell.count),
        CellColumn::new("mean_u_px", |(.., cell)| cell.mean_px().map(|mean_px| mean_px.x)),
        CellColumn::new("mean_v_px", |(.., cell)| cell.mean_px().map(|mean_px| mean_px.y)),
        CellColumn::new("error_px", |(.., cell)| cell.mean_px().map(|_| cell.error_px())),
    ];
    let run = ctx.selected_run();
    let shown = run.and_then(|run| Some((run, run.step_at(ctx.cursor_ns)?, ImageGeometry::of(ctx, run)?)));
    let Some((run, step, frame)) = shown else { return String::new() };
    let window = ImageResiduals::of_window(&step.report);
    let rows = [("window", &window), ("flight", &run.image_residuals)].into_iter().flat_map(|(part, residuals)| {
        let cells = ImageMeans::of(residuals, &frame).cells;
        let (frame, label) = (&frame, run.spec.label.as_str());
        cells.into_iter().enumerate().map(move |(index, cell)| (label, part, frame.cell_px(index), cell))
    });
    csv(&columns, rows)
}
