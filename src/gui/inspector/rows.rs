//! Rows and tables of values with their meaning as a tooltip.

use egui::{Grid, RichText, Ui, vec2};

use crate::gui::help::terms::Term;
use crate::gui::theme::Theme;

/// A row: the quantity and its values.
pub(super) type Row = (Term, Vec<String>);

/// Aligned rows of a name and its values; hovering either explains the quantity.
pub(super) fn rows_ui(ui: &mut Ui, theme: &Theme, salt: &str, rows: &[Row]) {
    Grid::new(salt).spacing(vec2(8.0, 1.0)).min_row_height(15.0).show(ui, |ui| {
        for (term, values) in rows {
            ui.label(RichText::new(term.name).color(theme.text_weak)).on_hover_text(term.meaning);
            for value in values {
                ui.label(RichText::new(value).monospace().color(theme.text_strong)).on_hover_text(term.meaning);
            }
            ui.end_row();
        }
    });
}

/// A table with column headings; hovering a cell explains its column.
pub(super) fn table_ui(
    ui: &mut Ui,
    theme: &Theme,
    salt: &str,
    columns: &[Term],
    rows: impl Iterator<Item = Vec<String>>,
) {
    let headings: Vec<(String, Term)> = columns.iter().map(|term| (term.name.to_owned(), *term)).collect();
    headed_table_ui(ui, theme, salt, &headings, rows);
}

/// The same with headings that differ from the names of the quantities.
pub(super) fn headed_table_ui(
    ui: &mut Ui,
    theme: &Theme,
    salt: &str,
    headings: &[(String, Term)],
    rows: impl Iterator<Item = Vec<String>>,
) {
    Grid::new(salt).striped(true).spacing(vec2(9.0, 1.0)).min_row_height(15.0).show(ui, |ui| {
        for (heading, term) in headings {
            ui.label(RichText::new(heading).small().color(theme.text_weak)).on_hover_text(term.meaning);
        }
        ui.end_row();
        for row in rows {
            for (cell, (_, term)) in row.into_iter().zip(headings) {
                ui.label(RichText::new(cell).monospace().color(theme.text_strong)).on_hover_text(term.meaning);
            }
            ui.end_row();
        }
    });
}
