//! Panels in the window: their layout with the saved ones, their places on the screen, and the focus.

use egui::{Rect, Ui, Vec2};
use serde_json::Value;

use super::saved_layouts::{SavedLayouts, tree_of_value};
use super::settings::LAST_LAYOUT;
use super::tiles::{PanelLayout, Preset};
use crate::gui::PanelName;
use crate::text::Named as _;

/// Size in points of a panel that is not on the screen.
const HIDDEN_PANEL_SIZE: Vec2 = Vec2::new(960.0, 540.0);

#[derive(Default)]
pub struct PanelTiles {
    pub saved: SavedLayouts,
    pub(super) layout: PanelLayout,
    /// The layout when its last change was noticed.
    noticed: Option<PanelLayout>,
    /// The panel that was clicked last.
    pub(super) focus: Option<PanelName>,
    /// Height of timeline and status bar in the last frame.
    pub(super) below_height: Option<f32>,
    /// Height that the timeline was given by hand, without and with the rows of the parameters, as a ratio of the room
    /// below the bars; `None` follows its lanes.
    pub(super) timeline_ratios: [Option<f32>; 2],
    /// The rectangles of the panels on the screen, in the order of drawing.
    pub(super) places: Vec<(PanelName, Rect)>,
}

impl PanelTiles {
    /// The focused panel, to which commands about one panel apply, and its size in points.
    pub(super) fn focused(&self) -> (PanelName, Vec2) {
        let panel = self.focus.unwrap_or(PanelName::Image);
        (panel, self.place_of(panel).map_or(HIDDEN_PANEL_SIZE, |rect| rect.size()))
    }

    /// Rectangle of a panel on the screen.
    pub(super) fn place_of(&self, panel: PanelName) -> Option<Rect> {
        self.places.iter().find(|(known, _)| *known == panel).map(|(_, rect)| *rect)
    }

    /// Shows a panel and focuses it.
    pub(super) fn show(&mut self, panel: PanelName) {
        if panel != PanelName::Timeline {
            self.layout.set_visible(panel, true);
        }
        self.focus = Some(panel);
    }

    /// Moves the focus to the next or previous panel on the screen.
    pub(super) fn focus_neighbour(&mut self, forward: bool) {
        let shown = &self.places;
        let count = shown.len();
        let at = shown.iter().position(|(panel, _)| Some(*panel) == self.focus);
        let next = at.map_or(0, |at| if forward { at + 1 } else { at + count - 1 } % count.max(1));
        self.focus = shown.get(next).map(|(panel, _)| *panel).or(self.focus);
    }

    /// The focused panel if it is on the screen, else the first one there.
    pub(super) fn focused_or_first(&self) -> Option<PanelName> {
        let focused = self.focus.filter(|panel| self.place_of(*panel).is_some());
        let first = self.places.iter().map(|(panel, _)| *panel).find(|panel| *panel != PanelName::Timeline);
        focused.or(first)
    }

    /// A click into a panel focuses it.
    pub(super) fn follow_focus(&mut self, ui: &Ui) {
        let pressed = ui.input(|input| input.pointer.any_pressed().then(|| input.pointer.interact_pos()).flatten());
        let Some(pressed) = pressed.filter(|at| ui.ctx().layer_id_at(*at) == Some(ui.layer_id())) else { return };
        let place = self.places.iter().find(|(_, rect)| rect.contains(pressed));
        self.focus = place.map_or(self.focus, |(panel, _)| Some(*panel));
    }

    /// Layout of the panels for a saved session.
    pub fn layout_value(&self) -> Option<Value> {
        serde_json::to_value(self.layout.tree()).ok()
    }

    /// Restores the layout of a saved session if this program has its panels.
    pub fn take_layout(&mut self, value: &Value) {
        if let Some(tree) = tree_of_value(value.clone()) {
            self.layout.take(tree);
        }
    }

    /// Layout of the panels for the next start, with the name of its preset.
    pub(in crate::gui) fn last_layout_value(&self) -> Option<Value> {
        let preset = self.layout.preset.map(Preset::name);
        Some(serde_json::json!({ "preset": preset, "panels": self.layout_value()? }))
    }

    /// Restores the value of [`PanelTiles::last_layout_value`] if this program has its panels.
    fn take_last_layout(&mut self, value: &Value) {
        if let Some(panels) = value.get("panels") {
            self.take_layout(panels);
            let preset = value.get("preset").and_then(Value::as_str).and_then(Preset::from_name);
            self.layout.preset = self.layout.preset.or(preset);
        }
    }

    /// Arranges the panels for the start: as at the end of the last use, or as named in the settings.
    pub(in crate::gui) fn arrange_for_start(&mut self, last: Option<&Value>, name: &str) {
        match last.filter(|_| name == LAST_LAYOUT) {
            Some(last) => self.take_last_layout(last),
            None => self.arrange_by_name(name),
        }
    }

    /// Arranges the panels as in a preset, and the timeline as at the start.
    pub fn arrange(&mut self, preset: Preset) {
        self.timeline_ratios = [None; 2];
        self.layout.arrange(preset);
    }

    /// Arranges the panels as in a preset or a saved layout, by name; no change for an unknown name.
    fn arrange_by_name(&mut self, name: &str) {
        if let Some(preset) = Preset::from_name(name) {
            self.layout.arrange(preset);
        } else if let Some(number) = self.saved.names().position(|known| known == name) {
            self.saved.take(number, &mut self.layout);
        }
    }

    /// True if the layout has changed since the last call.
    pub(in crate::gui) fn take_changed(&mut self) -> bool {
        let changed = self.noticed.as_ref().is_some_and(|noticed| *noticed != self.layout);
        if changed || self.noticed.is_none() {
            self.noticed = Some(self.layout.clone());
        }
        changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_layout_is_restored_with_the_name_of_its_preset() {
        let mut tiles = PanelTiles::default();
        tiles.arrange(Preset::FrontEnd);
        tiles.layout.set_visible(PanelName::Scene, false);
        let value = tiles.last_layout_value().unwrap();
        let mut next = PanelTiles::default();
        next.take_last_layout(&value);
        assert!(next.layout == tiles.layout && next.layout.preset == Some(Preset::FrontEnd));
        next.take_last_layout(&serde_json::json!({ "preset": "Overview", "panels": 7 }));
        assert!(next.layout == tiles.layout, "a value of another format changes nothing");
    }
}
