//! Rows of values with their meaning as a tooltip.

use egui::{Grid, RichText, Ui, vec2};

use crate::gui::help::terms::Term;
use crate::gui::table::number_ui;
use crate::gui::theme::Theme;
use crate::table::align_numbers;

/// Minimum height of a row in points.
pub(super) const ROW_HEIGHT: f32 = 15.0;

/// A row: the quantity and its values.
pub(super) type Row = (Term, Vec<String>);

/// Rows of a name and its values, whose numbers are aligned among the rows of several values; hovering either explains
/// the quantity.
pub(super) fn rows_ui(ui: &mut Ui, theme: &Theme, salt: &str, mut rows: Vec<Row>) {
    let columns = rows.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    for column in 0..columns {
        let vectors = rows.iter_mut().filter(|(_, values)| values.len() > 1);
        align_numbers(vectors.filter_map(|(_, values)| values.get_mut(column)));
    }
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
