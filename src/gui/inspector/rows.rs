//! Rows of values with their meaning as a tooltip.

use egui::{Grid, RichText, Ui, vec2};

use crate::gui::help::terms::Term;
use crate::gui::theme::Theme;

/// Minimum height of a row in points.
pub(super) const ROW_HEIGHT: f32 = 15.0;

/// A row: the quantity and its values.
pub(super) type Row = (Term, Vec<String>);

/// Aligned rows of a name and its values; hovering either explains the quantity.
pub(super) fn rows_ui(ui: &mut Ui, theme: &Theme, salt: &str, rows: &[Row]) {
    Grid::new(salt).spacing(vec2(8.0, 1.0)).min_row_height(ROW_HEIGHT).show(ui, |ui| {
        for (term, values) in rows {
            ui.label(RichText::new(term.name).color(theme.text_weak)).on_hover_text(term.meaning);
            for value in values {
                ui.label(RichText::new(value).monospace().color(theme.text_strong)).on_hover_text(term.meaning);
            }
            ui.end_row();
        }
    });
}
