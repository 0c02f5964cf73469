//! Copying values and tables to the clipboard.

use egui::epaint::TextShape;
use egui::{LayerId, Pos2, Shape, Ui};

use super::notices::NoticeLevel;
use super::state::MainWindow;
use crate::gui::under_pointer::offered;
use crate::gui::units::counted;
use crate::gui::{PanelContext, PanelName};

/// Number of letters of a copied value that its notice shows.
const SHOWN_LETTERS: usize = 60;

/// Value under the pointer: the one that a panel offers, or the text that is painted there.
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

/// Copies the value under the pointer, or else the table of the panel with the focus.
pub(super) fn copy(value: Option<String>, state: &mut MainWindow, ctx: &PanelContext<'_>) {
    match value {
        Some(value) => copy_value(value, state),
        None => copy_table(state.focused().0, state, ctx),
    }
}

pub(super) fn copy_value(value: String, state: &mut MainWindow) {
    let mut shown: String =
        value.chars().take(SHOWN_LETTERS).map(|letter| if letter == '\n' { ' ' } else { letter }).collect();
    if value.chars().count() > SHOWN_LETTERS {
        shown.push('…');
    }
    state.notices.show_message(NoticeLevel::Info, format!("Copied: {shown}"));
    state.copied = Some(value);
}

/// Copies the values of a panel as comma-separated values.
pub(super) fn copy_table(panel: PanelName, state: &mut MainWindow, ctx: &PanelContext<'_>) {
    let table = state.panels.csv_table(panel, ctx);
    let rows = table.lines().count().saturating_sub(1);
    if rows == 0 {
        let text = format!("{}: no values to copy at the cursor", panel.title());
        state.notices.show_message(NoticeLevel::Info, text);
        return;
    }
    let text = format!("Copied the table of {}: {} (CSV)", panel.title(), counted(rows, "row"));
    state.notices.show_message(NoticeLevel::Info, text);
    state.copied = Some(table);
}
