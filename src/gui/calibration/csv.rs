//! The calibration table; one parameter per row.

use super::CalibrationPanel;
use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::gui::{CsvTable, PanelContext};
use crate::session::flight_table;
use crate::text::Named as _;

impl CsvTable for CalibrationPanel {
    /// Verdict of the whole flight on each parameter of the shown run, in the order of `summary.json`.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let mut table = CsvWriter::new([
            "parameter",
            "group",
            "unit",
            "value",
            "sigma",
            "prior_sigma",
            "ratio",
            "verdict",
            "since_s",
            "cause",
            "reason",
            "remedy",
        ]);
        for row in flight_table(ctx.recording, run) {
            let number = |value: Option<f64>| number_cell(value.unwrap_or(f64::NAN));
            let since_s = number(row.since_s());
            table.row([
                row.name,
                row.group.to_owned(),
                row.dimension.unit().to_owned(),
                number_cell(row.value),
                number(row.sigma),
                number(row.prior_sigma),
                number(row.ratio),
                row.verdict.name().to_owned(),
                since_s,
                row.cause.map_or("", |cause| cause.name()).to_owned(),
                row.reason,
                row.remedy,
            ]);
        }
        table.into_text()
    }
}
