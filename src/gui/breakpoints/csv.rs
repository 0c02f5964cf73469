//! Hits of all breakpoints; one hit per row.

use super::BreakpointsPanel;
use crate::files::csv_writer::{CsvWriter, seconds_cell};
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for BreakpointsPanel {
    /// Every hit of every breakpoint, by breakpoint and run.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let mut table = CsvWriter::new(["condition", "enabled", "run", "t_s"]);
        for breakpoint in ctx.playback.breakpoints.list() {
            for run in &ctx.recording.runs {
                for stamp_ns in breakpoint.hits_ns(run) {
                    let (text, enabled) = (breakpoint.condition.text().to_owned(), breakpoint.enabled.to_string());
                    table.row([text, enabled, run.spec.label.clone(), seconds_cell(stamp_ns)]);
                }
            }
        }
        table.into_text()
    }
}
