//! Calibration over time; one step per row.

use super::ConvergencePanel;
use crate::files::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::gimbal::ParameterId;
use crate::gui::derived::chain_values::true_values;
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for ConvergencePanel {
    /// The calibration of the shown run over the whole recording, with the ground truth in the parameterization at the
    /// cursor.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let ground_truth = true_values(ctx.recording, run, ctx.cursor_ns).unwrap_or_default();
        let mut parameters: Vec<ParameterId> = Vec::new();
        for calibration in run.steps.iter().map(|step| &step.report.calibration) {
            for parameter in &calibration.parameters {
                if !parameters.contains(parameter) {
                    parameters.push(*parameter);
                }
            }
        }
        let names = ctx.names();
        let mut columns = vec!["t_s".to_owned()];
        for parameter in &parameters {
            let (name, unit) = (names.name(*parameter), parameter.dimension().unit());
            columns.extend(["", "_sigma", "_truth"].map(|part| format!("{name}{part}_{unit}")));
        }
        let mut table = CsvWriter::new(columns);
        for step in run.steps.iter().filter(|step| step.report.newest().is_some()) {
            let calibration = &step.report.calibration;
            let cells = parameters.iter().flat_map(|parameter| {
                let index = calibration.parameters.iter().position(|known| known == parameter);
                let entry = |values: &[f64]| index.and_then(|index| values.get(index)).copied().unwrap_or(f64::NAN);
                let ground_truth = ground_truth.get(parameter).copied().unwrap_or(f64::NAN);
                [entry(&calibration.values), entry(&calibration.sigmas), ground_truth].map(number_cell)
            });
            table.row(std::iter::once(seconds_cell(step.report.stamp_ns)).chain(cells));
        }
        table.into_text()
    }
}
