//! Context menu: what can be done with the item, the time, the value and the panel under the pointer.

mod items;
mod panel;
pub(super) mod place;
#[cfg(test)]
mod tests;
mod time;
mod widgets;

use egui::{Id, Popup, PopupAnchor, PopupCloseBehavior, Ui};

use self::place::MenuPlace;
use super::actions::Action;
use super::copying::value_under_pointer;
use super::state::MainWindow;
use crate::gui::plot::plot_under_pointer;
use crate::gui::under_pointer::offered_item;
use crate::gui::{PanelContext, PanelName};

/// Minimum width of the menu in points.
const MIN_WIDTH: f32 = 190.0;

fn menu_id() -> Id {
    Id::unique("context menu")
}

/// Opens the menu at a click with the secondary button, `tab` being the panel whose tab was clicked, and draws it.
pub(super) fn ui(
    ui: &Ui,
    state: &mut MainWindow,
    ctx: &mut PanelContext<'_>,
    tab: Option<PanelName>,
    actions: &mut Vec<Action>,
) {
    if let Some(menu) = opened(ui, state, tab) {
        state.menu = Some(menu);
        Popup::open_id(ui.ctx(), menu_id());
    }
    let Some(menu) = state.menu.take() else { return };
    let popup = Popup::new(menu_id(), ui.ctx().clone(), PopupAnchor::Position(menu.at), ui.layer_id())
        .open_memory(None)
        .close_behavior(PopupCloseBehavior::CloseOnClick);
    let shown = popup.show(|ui| {
        ui.set_min_width(MIN_WIDTH);
        if let Some(item) = menu.item {
            items::ui(ui, state, ctx, item, actions);
        }
        if let Some((plot, stamp_ns)) = &menu.plot {
            time::ui(ui, state, ctx, plot, *stamp_ns, actions);
        }
        if let Some(panel) = menu.panel {
            panel::ui(ui, state, ctx, panel, menu.value.as_deref(), actions);
        }
    });
    if shown.is_some() {
        state.menu = Some(menu);
    }
}

/// The menu that a click of this frame opens.
fn opened(ui: &Ui, state: &MainWindow, tab: Option<PanelName>) -> Option<MenuPlace> {
    let at = ui.input(|input| input.pointer.secondary_clicked().then(|| input.pointer.interact_pos()).flatten())?;
    if ui.ctx().layer_id_at(at) != Some(ui.layer_id()) {
        return None;
    }
    if tab.is_some() {
        return Some(MenuPlace { at, panel: tab, item: None, value: None, plot: None });
    }
    let panel = state.places.iter().find(|(_, place)| place.contains(at)).map(|(panel, _)| *panel);
    let item = offered_item(ui.ctx());
    let (value, plot) = (value_under_pointer(ui), plot_under_pointer(ui));
    (panel.is_some() || item.is_some()).then_some(MenuPlace { at, panel, item, value, plot })
}
