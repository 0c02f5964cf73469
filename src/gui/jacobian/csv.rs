//! Norms of the Jacobian's blocks; one factor per row.

use super::JacobianPanel;
use super::{cameras, column_name, name_of};
use crate::files::csv_writer::CsvWriter;
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for JacobianPanel {
    /// Norms of the Jacobian's blocks as in the panel; zeros are empty.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let Some(step) = run.step_at(ctx.cursor_ns) else { return String::new() };
        let cameras = cameras(&ctx.recording.rig, run, step);
        let Some(jacobian) = step.report.jacobian(&cameras) else { return String::new() };
        let names = ctx.names();
        let heads = ["residuals", "rows"].map(str::to_owned).into_iter();
        let mut table = CsvWriter::new(heads.chain(jacobian.columns.iter().map(|block| column_name(block.id, &names))));
        for row in &jacobian.rows {
            let norm = |column: usize| row.norms.iter().find(|(known, _)| usize::from(*known) == column);
            let cells =
                (0..jacobian.columns.len()).map(|column| norm(column).map_or_else(String::new, |it| it.1.to_string()));
            let heads = [name_of(&row.factor), row.height.to_string()];
            table.row(heads.into_iter().chain(cells));
        }
        table.into_text()
    }
}
