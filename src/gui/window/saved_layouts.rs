//! Layouts that a person has made and named.

use std::collections::BTreeMap;

use egui::{Button, RichText, TextEdit, Ui};
use egui_tiles::Tree;

use super::tiles::{Layout, Pane};
use crate::gui::theme::Theme;

/// Most layouts that are kept.
const MOST_KEPT: usize = 12;

/// The layouts by name, and the name that is being typed.
#[derive(Debug, Default)]
pub struct SavedLayouts {
    layouts: BTreeMap<String, Tree<Pane>>,
    typed: String,
}

impl SavedLayouts {
    /// Reads what [`SavedLayouts::to_text`] wrote; layouts that miss a panel (of another version) are left out.
    pub fn from_text(text: &str) -> Self {
        let mut layouts: BTreeMap<String, Tree<Pane>> = serde_json::from_str(text).unwrap_or_default();
        layouts.retain(|_, tree| Pane::ALL.iter().all(|pane| tree.tiles.find_pane(pane).is_some()));
        Self { layouts, typed: String::new() }
    }

    /// The layouts as JSON.
    pub fn to_text(&self) -> String {
        serde_json::to_string(&self.layouts).unwrap_or_default()
    }

    /// Lists the layouts, to be taken or forgotten, and saves the present one; whether the list changed.
    pub(super) fn ui(&mut self, ui: &mut Ui, theme: &Theme, layout: &mut Layout) -> bool {
        let mut forgotten = None;
        for (name, tree) in &self.layouts {
            ui.horizontal(|ui| {
                let take = ui.add(Button::new(name.as_str()).min_size(egui::vec2(120.0, 20.0)));
                take.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Layout {name}")));
                if take.clicked() {
                    layout.take(tree.clone());
                }
                let forget = ui.add(Button::new("x").small()).on_hover_text("Forget this layout");
                forget.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Forget {name}")));
                if forget.clicked() {
                    forgotten = Some(name.clone());
                }
            });
        }
        let mut changed = forgotten.is_some_and(|name| self.layouts.remove(&name).is_some());
        ui.horizontal(|ui| {
            let edit = TextEdit::singleline(&mut self.typed).hint_text("Name").desired_width(114.0);
            let edit = ui.add(edit);
            edit.widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Name of the layout"));
            let name = self.typed.trim().to_owned();
            let room = self.layouts.len() < MOST_KEPT || self.layouts.contains_key(&name);
            let save = ui.add_enabled(!name.is_empty() && room, Button::new("Save layout"));
            if save.clicked() {
                self.layouts.insert(name, layout.tree().clone());
                self.typed.clear();
                changed = true;
            }
        });
        if self.layouts.len() >= MOST_KEPT {
            ui.label(RichText::new(format!("{MOST_KEPT} layouts are kept at most")).small().color(theme.text_weak));
        }
        changed
    }
}

/// The present layout, for a saved session.
pub(super) fn layout_value(layout: &Layout) -> Option<serde_json::Value> {
    serde_json::to_value(layout.tree()).ok()
}

/// Takes over the layout of a saved session; one of another version, which misses a panel, is left out.
pub(super) fn take_layout(layout: &mut Layout, value: &serde_json::Value) {
    let tree: Option<Tree<Pane>> = serde_json::from_value(value.clone()).ok();
    if let Some(tree) = tree.filter(|tree| Pane::ALL.iter().all(|pane| tree.tiles.find_pane(pane).is_some())) {
        layout.take(tree);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tiles::Preset;
    use super::*;

    #[test]
    fn layouts_survive_writing_and_foreign_ones_are_left_out() {
        let mut layout = Layout::default();
        layout.arrange(Preset::Scene);
        layout.set_visible(Pane::Rank, false);
        let mut saved = SavedLayouts::default();
        saved.layouts.insert("mine".to_owned(), layout.tree().clone());
        let back = SavedLayouts::from_text(&saved.to_text());
        assert!(back.layouts["mine"] == *layout.tree());
        assert!(SavedLayouts::from_text("no json").layouts.is_empty());
        let mut lacking = layout.tree().clone();
        let rank = lacking.tiles.find_pane(&Pane::Rank).unwrap();
        lacking.remove_recursively(rank);
        saved.layouts.insert("lacking".to_owned(), lacking);
        let names: Vec<String> = SavedLayouts::from_text(&saved.to_text()).layouts.into_keys().collect();
        assert_eq!(names, ["mine"]);
    }
}
