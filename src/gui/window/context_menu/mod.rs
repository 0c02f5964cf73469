//! Context menu: what can be done with the item, the time, the value and the panel under the pointer.

mod sections;
#[cfg(test)]
mod tests;

use egui::{Id, Popup, PopupAnchor, PopupCloseBehavior, Pos2, Ui};

use self::sections::Sections;
use super::actions::Action;
use super::copying::value_under_pointer;
use super::dialogs::state::Dialogs;
use super::notices::Notices;
use super::panel_tiles::PanelTiles;
use crate::gui::help::Help;
use crate::gui::plot::{PlotOnScreen, plot_under_pointer};
use crate::gui::under_pointer::{Item, offered_item};
use crate::gui::{PanelContext, PanelName};

/// Minimum width of the menu in points.
const MIN_WIDTH: f32 = 190.0;

/// Position of the pointer when the menu was opened, with the objects under it.
#[derive(Debug)]
pub(super) struct MenuPlace {
    at: Pos2,
    panel: Option<PanelName>,
    item: Option<Item>,
    value: Option<String>,
    /// Plot over time, with the time there in nanoseconds since the log began.
    plot: Option<(PlotOnScreen, i64)>,
}

/// Parts of the window on which the entries act.
pub(super) struct MenuParts<'a> {
    pub(super) tiles: &'a PanelTiles,
    pub(super) notices: &'a mut Notices,
    pub(super) dialogs: &'a mut Dialogs,
    pub(super) help: &'a mut Help,
    pub(super) actions: &'a mut Vec<Action>,
}

/// Opens the menu at a click with the secondary button, `tab` being the panel whose tab was clicked, and draws it.
pub(super) fn ui(
    ui: &Ui,
    place: &mut Option<MenuPlace>,
    ctx: &mut PanelContext<'_>,
    tab: Option<PanelName>,
    parts: MenuParts<'_>,
) {
    let id = Id::unique("context menu");
    let MenuParts { tiles, notices, dialogs, help, actions } = parts;
    if let Some(menu) = opened(ui, &tiles.places, tab) {
        *place = Some(menu);
        Popup::open_id(ui.ctx(), id);
    }
    let Some(menu) = place.take() else { return };
    let popup = Popup::new(id, ui.ctx().clone(), PopupAnchor::Position(menu.at), ui.layer_id())
        .open_memory(None)
        .close_behavior(PopupCloseBehavior::CloseOnClick);
    let maximized = tiles.layout.maximized();
    let shown = popup.show(|ui| {
        ui.set_min_width(MIN_WIDTH);
        let mut sections = Sections { ui, ctx, notices, dialogs, help, actions };
        if let Some(item) = menu.item {
            sections.item_ui(item);
        }
        if let Some((plot, stamp_ns)) = &menu.plot {
            sections.time_ui(plot, *stamp_ns);
        }
        if let Some(panel) = menu.panel {
            sections.panel_ui(panel, maximized == Some(panel), menu.value.as_deref());
        }
    });
    if shown.is_some() {
        *place = Some(menu);
    }
}

/// The menu that a click of this frame opens.
fn opened(ui: &Ui, places: &[(PanelName, egui::Rect)], tab: Option<PanelName>) -> Option<MenuPlace> {
    let at = ui.input(|input| input.pointer.secondary_clicked().then(|| input.pointer.interact_pos()).flatten())?;
    if ui.ctx().layer_id_at(at) != Some(ui.layer_id()) {
        return None;
    }
    if tab.is_some() {
        return Some(MenuPlace { at, panel: tab, item: None, value: None, plot: None });
    }
    let panel = places.iter().find(|(_, place)| place.contains(at)).map(|(panel, _)| *panel);
    let item = offered_item(ui.ctx());
    let (value, plot) = (value_under_pointer(ui), plot_under_pointer(ui));
    (panel.is_some() || item.is_some()).then_some(MenuPlace { at, panel, item, value, plot })
}
