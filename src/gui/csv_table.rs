//! The values of a panel as a table of comma-separated values.

use super::PanelContext;

pub trait CsvTable {
    /// The table with its header line, in seconds, radians, metres and pixels; empty where there are no values.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String;
}
