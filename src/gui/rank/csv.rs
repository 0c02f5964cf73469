//! Singular values and directions at the cursor; one singular value per row.

use super::RankPanel;
use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::gui::{CsvTable, PanelContext};
use crate::observability::CalibrationDirection;

impl CsvTable for RankPanel {
    /// Singular values of the step at the cursor, and each null or uninformed direction as weights by parameter name.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let Some(run) = ctx.selected_run() else { return String::new() };
        let Some(rank) = run.step_at(ctx.cursor_ns).and_then(|step| step.rank.as_ref()) else { return String::new() };
        let names = ctx.names();
        let heads = ["number", "singular_value", "singular_value_with_priors", "kind"].map(str::to_owned);
        let mut table =
            CsvWriter::new(heads.into_iter().chain(rank.parameters.iter().map(|parameter| names.name(*parameter))));
        for (index, value) in rank.singular_values.iter().enumerate() {
            // Directions start with the least observable one, singular values with the largest.
            let direction = rank.directions.get(rank.singular_values.len() - 1 - index);
            let kind = direction.map_or("informed", CalibrationDirection::kind);
            let with_priors = rank.singular_values_with_priors.get(index).copied().unwrap_or(f64::NAN);
            let weights = (0..rank.parameters.len()).map(|column| {
                let weight = direction.and_then(|direction| direction.weights.get(column));
                number_cell(weight.copied().unwrap_or(f64::NAN))
            });
            let heads = [(index + 1).to_string(), number_cell(*value), number_cell(with_priors), kind.to_owned()];
            table.row(heads.into_iter().chain(weights));
        }
        table.into_text()
    }
}
