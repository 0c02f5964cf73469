//! Rows of values with their meaning as a tooltip.

use egui::{Grid, RichText, Ui, vec2};

use crate::gui::help::terms::Term;
use crate::gui::table::{align_columns, number_ui};
use crate::gui::theme::Theme;

/// Minimum height of a row in points.
pub(super) const ROW_HEIGHT: f32 = 15.0;

/// A row: the quantity and its values.
pub(super) type Row = (Term, Vec<String>);

/// Rows of a name and its values; the numbers of rows with several values are aligned. Hovering either explains the
/// quantity of the row.
pub(super) fn rows_ui(ui: &mut Ui, theme: &Theme, salt: &str, mut rows: Vec<Row>) {
    align_columns(rows.iter_mut().map(|(_, values)| values).filter(|values| values.len() > 1));
    Grid::new(salt).spacing(vec2(8.0, 1.0)).min_row_height(ROW_HEIGHT).show(ui, |ui| {
        for (term, values) in &rows {
            ui.label(RichText::new(term.name).color(theme.text_weak)).on_hover_text(term.meaning);
            for value in values {
                number_ui(ui, value, theme.text_strong).on_hover_text(term.meaning);
            }
            ui.end_row();
        }
    });
}
