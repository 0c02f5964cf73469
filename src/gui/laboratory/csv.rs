//! Spectra of the compared parameterizations; one row per singular value or weight of a direction.

use super::{LaboratoryPanel, LaboratoryView};
use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::gui::{CsvTable, PanelContext};

impl CsvTable for LaboratoryPanel {
    /// Singular values and directions of each parameterization, or σ after the planned motion.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        if self.view == LaboratoryView::Plan {
            return self.plan.csv_table(ctx);
        }
        let mut table = CsvWriter::new(["form", "kind", "number", "singular_value", "parameter", "weight"]);
        let names = ctx.names();
        for (parameterization, rank) in self.ranks(ctx) {
            for (index, value) in rank.singular_values.iter().enumerate() {
                let place = (index + 1).to_string();
                let cells = [parameterization.clone(), "singular value".to_owned(), place, number_cell(*value)];
                table.row(cells.into_iter().chain([String::new(), String::new()]));
            }
            for (index, direction) in rank.directions.iter().enumerate() {
                let weights = rank.parameters.iter().zip(&direction.weights);
                for (parameter, weight) in weights.filter(|(_, weight)| **weight != 0.0) {
                    table.row([
                        parameterization.clone(),
                        direction.kind().to_owned(),
                        (index + 1).to_string(),
                        number_cell(direction.singular_value),
                        names.name(*parameter),
                        number_cell(*weight),
                    ]);
                }
            }
        }
        table.into_text()
    }
}
