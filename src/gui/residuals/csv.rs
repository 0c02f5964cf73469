//! Residuals over time; one row per step of a run.

use super::{ResidualsPanel, rms_px};
use crate::estimator::FactorKind;
use crate::flight_log::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::gui::{CsvTable, PanelContext};
use crate::session::StepRecord;
use crate::text::Named as _;

impl CsvTable for ResidualsPanel {
    /// Reprojection RMS and χ² by kind of factor, for every step of every run.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
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
