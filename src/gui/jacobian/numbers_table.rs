//! Table of the values of a block.

use egui::{Grid, RichText, Ui, vec2};

use crate::gui::PanelContext;
use crate::gui::help::terms::Term;

/// Draws a table of numbers with column headings; hovering a cell explains its column.
pub(super) fn numbers_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    heads: &[(String, Term)],
    lines: impl Iterator<Item = Vec<String>>,
) {
    Grid::new("block numbers").striped(true).spacing(vec2(9.0, 1.0)).min_row_height(14.0).show(ui, |ui| {
        for (head, term) in heads {
            ui.label(RichText::new(head).small().color(ctx.theme.text_weak)).on_hover_text(term.meaning);
        }
        ui.end_row();
        for cells in lines {
            for (cell, (_, term)) in cells.into_iter().zip(heads) {
                ui.label(RichText::new(cell).monospace().color(ctx.theme.text_strong)).on_hover_text(term.meaning);
            }
            ui.end_row();
        }
    });
}
