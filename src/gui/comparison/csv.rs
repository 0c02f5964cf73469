//! Comparison of all runs as a long table; one value per row.

use super::ComparisonPanel;
use super::columns::label_of;
use crate::files::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::gui::{CsvTable, PanelContext};
use crate::session::ComparedQuantity;
use crate::text::Named as _;

impl CsvTable for ComparisonPanel {
    /// Accuracy of all runs, their first divergences from the reference, and the differences of every common frame.
    /// Differences are in stored units (radians, metres), accuracy in the units of the panel.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let mut table = CsvWriter::new(["kind", "run", "reference", "quantity", "unit", "t_s", "value"]);
        let label = |index: usize| label_of(ctx.recording, index).to_owned();
        let comparisons = self.comparisons(ctx).to_vec();
        for row in self.scores().rows() {
            for (run, value) in row.values.iter().enumerate() {
                let value = number_cell(value.unwrap_or(f64::NAN));
                let unit = row.unit.to_owned();
                table.row([
                    "accuracy".to_owned(),
                    label(run),
                    String::new(),
                    row.name.clone(),
                    unit,
                    String::new(),
                    value,
                ]);
            }
        }
        let reference = label(self.reference);
        for (run, comparison) in comparisons.iter().enumerate().filter(|(run, _)| *run != self.reference) {
            let mut push_row = |kind: &str, quantity: ComparedQuantity, stamp_ns: i64, value: f64| {
                table.row([
                    kind.to_owned(),
                    label(run),
                    reference.clone(),
                    quantity.name().to_owned(),
                    quantity.unit().to_owned(),
                    seconds_cell(stamp_ns),
                    number_cell(value),
                ]);
            };
            for (quantity, divergence) in ComparedQuantity::all().zip(&comparison.divergences) {
                let at = |stamp_ns: i64| comparison.at(quantity, stamp_ns).unwrap_or(f64::NAN);
                for (kind, stamp_ns) in
                    [("first different", divergence.exact_ns), ("first notable", divergence.notable_ns)]
                {
                    if let Some(stamp_ns) = stamp_ns {
                        push_row(kind, quantity, stamp_ns, at(stamp_ns));
                    }
                }
                if let Some((largest, stamp_ns)) = divergence.largest {
                    push_row("largest", quantity, stamp_ns, largest);
                }
            }
            for quantity in ComparedQuantity::all() {
                let known = comparison.stamps_ns.iter().zip(comparison.column(quantity));
                for (stamp_ns, apart) in known.filter(|(_, apart)| apart.is_finite()) {
                    push_row("difference", quantity, *stamp_ns, *apart);
                }
            }
        }
        table.into_text()
    }
}
