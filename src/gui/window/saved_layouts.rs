//! The user's named layouts.

use std::collections::BTreeMap;

use egui::{Button, RichText, TextEdit, Ui};
use egui_tiles::Tree;

use super::tiles::PanelLayout;
use crate::gui::PanelName;
use crate::gui::theme::Theme;

const MAX_LAYOUTS: usize = 12;

/// Layouts by name, and the name that is being typed.
#[derive(Debug, Default)]
pub struct SavedLayouts {
    layouts: BTreeMap<String, Tree<PanelName>>,
    typed: String,
}

impl SavedLayouts {
    /// Reads the text of [`SavedLayouts::to_text`]; layouts with unknown panels (of a later version) are skipped.
    pub fn from_text(text: &str) -> Self {
        let values: BTreeMap<String, serde_json::Value> = serde_json::from_str(text).unwrap_or_default();
        let layouts = values.into_iter().filter_map(|(name, value)| Some((name, tree_of_value(value)?))).collect();
        Self { layouts, typed: String::new() }
    }

    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.layouts.keys().map(String::as_str)
    }

    /// Applies the layout with an index in the order of the names; returns whether it exists.
    pub(super) fn take(&self, number: usize, layout: &mut PanelLayout) -> bool {
        let tree = self.layouts.values().nth(number);
        if let Some(tree) = tree {
            layout.take(tree.clone());
        }
        tree.is_some()
    }

    pub fn to_text(&self) -> String {
        serde_json::to_string(&self.layouts).unwrap_or_default()
    }

    /// Lists the layouts with buttons to apply and delete them, and saves the current one. Returns true if the list
    /// changed.
    pub(super) fn ui(&mut self, ui: &mut Ui, theme: &Theme, layout: &mut PanelLayout) -> bool {
        let mut forgotten = None;
        for (name, tree) in &self.layouts {
            ui.horizontal(|ui| {
                let take = ui.add(Button::new(name.as_str()).min_size(egui::vec2(120.0, 20.0)));
                take.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Layout {name}")));
                if take.clicked() {
                    layout.take(tree.clone());
                }
                let forget = ui.add(Button::new("x").small()).on_hover_text("Delete this layout");
                forget.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Delete layout {name}"))
                });
                if forget.clicked() {
                    forgotten = Some(name.clone());
                }
            });
        }
        let mut changed = forgotten.is_some_and(|name| self.layouts.remove(&name).is_some());
        ui.horizontal(|ui| {
            let edit = TextEdit::singleline(&mut self.typed).hint_text("Name").desired_width(114.0);
            let edit = ui.add(edit);
            edit.widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Layout name"));
            let name = self.typed.trim().to_owned();
            let room = self.layouts.len() < MAX_LAYOUTS || self.layouts.contains_key(&name);
            let save = ui.add_enabled(!name.is_empty() && room, Button::new("Save layout"));
            if save.clicked() {
                self.layouts.insert(name, layout.tree().clone());
                self.typed.clear();
                changed = true;
            }
        });
        if self.layouts.len() >= MAX_LAYOUTS {
            ui.label(RichText::new(format!("At most {MAX_LAYOUTS} saved layouts")).small().color(theme.text_weak));
        }
        changed
    }
}

/// A layout with at least one panel. Panels that are missing in it can be added.
pub(super) fn tree_of_value(value: serde_json::Value) -> Option<Tree<PanelName>> {
    let tree: Tree<PanelName> = serde_json::from_value(value).ok()?;
    let shows = tree.root().is_some() && PanelName::movable().any(|panel| tree.tiles.find_pane(&panel).is_some());
    shows.then_some(tree)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::window::tiles::Preset;

    #[test]
    fn layouts_survive_writing_and_unknown_ones_are_skipped() {
        let mut layout = PanelLayout::default();
        layout.arrange(Preset::Scene);
        layout.set_visible(PanelName::Rank, false);
        let mut saved = SavedLayouts::default();
        saved.layouts.insert("mine".to_owned(), layout.tree().clone());
        let back = SavedLayouts::from_text(&saved.to_text());
        assert!(back.layouts["mine"] == *layout.tree());
        assert!(SavedLayouts::from_text("no json").layouts.is_empty());
        // An older layout has fewer panels; the missing ones can be added. A layout of a later version may have unknown
        // ones.
        let mut older = layout.tree().clone();
        let rank = older.tiles.find_pane(&PanelName::Rank).unwrap();
        older.remove_recursively(rank);
        saved.layouts.insert("older".to_owned(), older);
        let later = saved.to_text().replace("\"Scene\"", "\"Hologram\"");
        assert!(SavedLayouts::from_text(&later).layouts.is_empty());
        let back = SavedLayouts::from_text(&saved.to_text());
        assert_eq!(back.names().collect::<Vec<_>>(), ["mine", "older"]);
        assert!(back.take(1, &mut layout) && !layout.is_visible(PanelName::Rank));
        layout.set_visible(PanelName::Rank, true);
        assert!(layout.is_visible(PanelName::Rank) && !back.take(2, &mut layout));
    }
}
