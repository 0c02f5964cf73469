//! Copying values and tables to the clipboard: by key, and by the context menu.

use egui::epaint::TextShape;
use egui::{Id, LayerId, Popup, PopupAnchor, PopupCloseBehavior, Pos2, Shape, Ui};

use super::actions::{Action, keys_of};
use super::notices::NoticeLevel;
use super::state::{MainWindow, PanelMenu};
use crate::gui::copied_value::offered;
use crate::gui::plot::{PlotOnScreen, plot_under_pointer};
use crate::gui::units::counted;
use crate::gui::{PanelContext, PanelName, ReadingCursor};

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

fn copy_value(value: String, state: &mut MainWindow) {
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

/// Draws the entries of a plot over time.
fn reading_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, plot: &PlotOnScreen, stamp_ns: i64, actions: &mut Vec<Action>) {
    let stamp_ns = stamp_ns.clamp(0, ctx.recording.duration_ns.max(0));
    let reading = &mut ctx.selection.reading;
    ui.separator();
    let item = |ui: &mut Ui, text: &str, action: Action| {
        ui.add(egui::Button::new(text).shortcut_text(keys_of(action))).clicked()
    };
    for cursor in ReadingCursor::ALL {
        if item(ui, &format!("Set reading cursor {} here", cursor.letter()), Action::SetReading(cursor)) {
            reading.set_cursor(cursor, stamp_ns);
        }
    }
    if ReadingCursor::ALL.iter().any(|cursor| reading.cursor_ns(*cursor).is_some())
        && item(ui, "Clear the reading cursors", Action::ClearReading)
    {
        reading.clear_cursors();
    }
    if !plot.key.is_empty() {
        let fixed = reading.fixed_values.contains_key(&plot.key);
        let text = if fixed { "Free the value axis" } else { "Fix the value axis" };
        if item(ui, text, Action::LockValues) {
            reading.toggle_fixed(&plot.key, [plot.area.low, plot.area.high]);
        }
    }
    if item(ui, "Events and rank losses in all plots", Action::EventLines) {
        actions.push(Action::EventLines);
    }
    if item(ui, "Zoom out to the whole log", Action::WholeLog) {
        actions.push(Action::WholeLog);
    }
}

fn menu_id() -> Id {
    Id::unique("panel menu")
}

/// Opens the menu of the panel that is clicked with the secondary button, and draws it.
pub(super) fn menu_ui(ui: &Ui, state: &mut MainWindow, ctx: &mut PanelContext<'_>, actions: &mut Vec<Action>) {
    let clicked = ui.input(|input| input.pointer.secondary_clicked().then(|| input.pointer.interact_pos()).flatten());
    let clicked = clicked.filter(|at| ui.ctx().layer_id_at(*at) == Some(ui.layer_id()));
    let panel = clicked.and_then(|at| state.places.iter().find(|(_, place)| place.contains(at)).map(|it| (it.0, at)));
    if let Some((panel, at)) = panel {
        state.menu = Some(PanelMenu { panel, at, value: value_under_pointer(ui), plot: plot_under_pointer(ui) });
        Popup::open_id(ui.ctx(), menu_id());
    }
    let Some(menu) = state.menu.take() else { return };
    let popup = Popup::new(menu_id(), ui.ctx().clone(), PopupAnchor::Position(menu.at), ui.layer_id())
        .open_memory(None)
        .close_behavior(PopupCloseBehavior::CloseOnClick);
    let mut chosen = None;
    let shown = popup.show(|ui| {
        ui.set_min_width(150.0);
        let value = ui.add_enabled(menu.value.is_some(), egui::Button::new("Copy value"));
        let value = match &menu.value {
            Some(text) => value.on_hover_text(text),
            None => value,
        };
        if value.clicked() {
            chosen = Some(true);
        }
        if ui.button("Copy table (CSV)").clicked() {
            chosen = Some(false);
        }
        if let Some((plot, stamp_ns)) = &menu.plot {
            reading_ui(ui, ctx, plot, *stamp_ns, actions);
        }
    });
    if shown.is_none() {
        return;
    }
    match (chosen, menu.value.clone()) {
        (Some(true), Some(value)) => copy_value(value, state),
        (Some(false), _) => copy_table(menu.panel, state, ctx),
        _ => state.menu = Some(menu),
    }
}
