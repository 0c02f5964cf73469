//! The table of values of a block.

use egui::{Grid, RichText, Ui, vec2};

use crate::gui::PanelContext;

/// A table of numbers with column headings.
pub(super) fn numbers_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    heads: &[String],
    lines: impl Iterator<Item = Vec<String>>,
) {
    Grid::new("block numbers").striped(true).spacing(vec2(9.0, 1.0)).min_row_height(14.0).show(ui, |ui| {
        for head in heads {
            ui.label(RichText::new(head).small().color(ctx.theme.text_weak));
        }
        ui.end_row();
        for cells in lines {
            for cell in cells {
                ui.label(RichText::new(cell).monospace().color(ctx.theme.text_strong));
            }
            ui.end_row();
        }
    });
}
