//! Copying values and tables to the clipboard.

use egui::epaint::TextShape;
use egui::{LayerId, Pos2, Shape, Ui};

use super::notices::Notices;
use crate::gui::PanelName;
use crate::gui::under_pointer::offered;
use crate::gui::units::counted;

/// Number of letters of a copied value that its notice shows.
const SHOWN_LETTERS: usize = 60;

/// Text of the value under the pointer: the value that a panel offers, or the text that is painted there; `None` without
/// either.
pub(super) fn value_under_pointer(ui: &Ui) -> Option<String> {
    let pointer = ui.input(|input| input.pointer.hover_pos())?;
    let free = ui.ctx().layer_id_at(pointer) == Some(ui.layer_id());
    free.then(|| offered(ui.ctx()).or_else(|| text_at(ui, ui.layer_id(), pointer))).flatten()
}

fn text_at(ui: &Ui, layer: LayerId, position: Pos2) -> Option<String> {
    fn text_in(shape: &Shape, position: Pos2) -> Option<&TextShape> {
        match shape {
            Shape::Text(text) => text.visual_bounding_rect().expand(1.0).contains(position).then_some(text),
            Shape::Vec(shapes) => shapes.iter().rev().find_map(|shape| text_in(shape, position)),
            _ => None,
        }
    }
    ui.ctx().graphics(|graphics| {
        let shapes: Vec<_> = graphics.get(layer)?.all_entries().collect();
        let here = shapes.into_iter().rev().filter(|clipped| clipped.clip_rect.contains(position));
        let texts = here.filter_map(|clipped| text_in(&clipped.shape, position));
        texts.map(|text| text.galley.text().trim().to_owned()).find(|text| !text.is_empty())
    })
}

pub(super) fn copy_value(ui: &Ui, notices: &mut Notices, value: String) {
    let mut shown: String =
        value.chars().take(SHOWN_LETTERS).map(|letter| if letter == '\n' { ' ' } else { letter }).collect();
    if value.chars().count() > SHOWN_LETTERS {
        shown.push('…');
    }
    notices.inform(format!("Copied: {shown}"));
    ui.copy_text(value);
}

/// Copies the values of a panel, given as comma-separated values.
pub(super) fn copy_table(ui: &Ui, notices: &mut Notices, panel: PanelName, table: String) {
    let rows = table.lines().count().saturating_sub(1);
    if rows == 0 {
        notices.inform(format!("{}: no values to copy at the cursor", panel.title()));
        return;
    }
    notices.inform(format!("Copied the table of {}: {} (CSV)", panel.title(), counted(rows, "row")));
    ui.copy_text(table);
}
