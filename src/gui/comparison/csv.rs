//! Comparison of all runs as a long table; one value per row.

use super::ComparisonPanel;
use super::columns::label_of;
use crate::gui::{CsvTable, PanelContext};
use crate::session::ComparedQuantity;
use crate::table::{Column, Stamp, csv};
use crate::text::Named as _;

/// A value of a run, or at a stamp its difference from the reference.
struct ValueRow<'a> {
    kind: &'static str,
    run: &'a str,
    quantity: String,
    unit: &'static str,
    at: Option<Stamp>,
    value: f64,
}

type ValueColumn<'a> = Column<'a, ValueRow<'a>>;

impl CsvTable for ComparisonPanel {
    /// Accuracy of all runs, their first divergences from the reference, and the differences of every common frame.
    /// Differences are in stored units (radians, metres), accuracy in the units of the panel.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        self.read(ctx);
        let label = |index: usize| label_of(ctx.recording, index);
        let reference = label(self.reference);
        let columns = [
            ValueColumn::new("kind", |row| row.kind),
            ValueColumn::new("run", |row| row.run),
            ValueColumn::new("reference", |row| row.at.map(|_| reference)),
            ValueColumn::new("quantity", |row| row.quantity.clone()),
            ValueColumn::new("unit", |row| row.unit),
            ValueColumn::new("t_s", |row| row.at),
            ValueColumn::new("value", |row| row.value),
        ];
        let mut rows = Vec::new();
        for score in self.scores().rows() {
            for (run, value) in score.values.iter().enumerate() {
                let (quantity, value) = (score.name.clone(), value.unwrap_or(f64::NAN));
                rows.push(ValueRow { kind: "accuracy", run: label(run), quantity, unit: score.unit, at: None, value });
            }
        }
        for (run, comparison) in self.comparisons.iter().enumerate().filter(|(run, _)| *run != self.reference) {
            let mut push = |kind: &'static str, quantity: ComparedQuantity, stamp_ns: i64, value: f64| {
                let (name, unit, at) = (quantity.name().to_owned(), quantity.unit(), Some(Stamp(stamp_ns)));
                rows.push(ValueRow { kind, run: label(run), quantity: name, unit, at, value });
            };
            for (quantity, divergence) in ComparedQuantity::all().zip(&comparison.divergences) {
                for (kind, stamp_ns) in
                    [("first different", divergence.exact_ns), ("first notable", divergence.notable_ns)]
                {
                    if let Some(stamp_ns) = stamp_ns {
                        push(kind, quantity, stamp_ns, comparison.at(quantity, stamp_ns).unwrap_or(f64::NAN));
                    }
                }
                if let Some((largest, stamp_ns)) = divergence.largest {
                    push("largest", quantity, stamp_ns, largest);
                }
            }
            for quantity in ComparedQuantity::all() {
                let known = comparison.stamps_ns.iter().zip(comparison.column(quantity));
                for (stamp_ns, apart) in known.filter(|(_, apart)| apart.is_finite()) {
                    push("difference", quantity, *stamp_ns, *apart);
                }
            }
        }
        csv(&columns, rows)
    }
}
