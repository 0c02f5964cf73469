//! A text field for the path of a log, with completion.

use std::path::PathBuf;
use std::sync::Arc;

use egui::{Button, Id, Key, Modifiers, RichText, ScrollArea, TextEdit, Ui, vec2};

use crate::gui::desktop::{Desktop, PathEntry};
use crate::gui::theme::Theme;

/// Maximum number of completions.
const MAX_ENTRIES: usize = 200;
/// Width of the button beside the field in points.
const OPEN_WIDTH: f32 = 54.0;

/// The text field with its completions.
#[derive(Default)]
pub(in crate::gui) struct PathField {
    desktop: Option<Arc<dyn Desktop>>,
    typed: String,
    chosen: Option<usize>,
    /// True from the first focus on: a list that hid again would move what is below it during a click.
    lists: bool,
    completed: Option<(String, Vec<PathEntry>)>,
}

impl PathField {
    pub(in crate::gui) fn new(desktop: Arc<dyn Desktop>) -> Self {
        Self { desktop: Some(desktop), ..Self::default() }
    }

    pub(in crate::gui) fn is_empty(&self) -> bool {
        self.typed.trim().is_empty()
    }

    /// Draws the text field; returns the chosen path.
    pub(in crate::gui) fn ui(&mut self, ui: &mut Ui, theme: &Theme, focus: bool, height: f32) -> Option<PathBuf> {
        let id = ui.unique_id().with("path");
        let focused = ui.memory(|memory| memory.has_focus(id));
        self.lists |= focused || focus || !self.typed.is_empty();
        if self.lists && self.completed.as_ref().is_none_or(|(typed, _)| *typed != self.typed) {
            let mut entries = self.desktop.as_ref().map_or_else(Vec::new, |desktop| desktop.complete(&self.typed));
            // After a completed folder, its content is listed.
            for entry in entries.iter_mut().filter(|entry| entry.folder && !entry.path.ends_with('/')) {
                entry.path.push('/');
            }
            self.completed = Some((self.typed.clone(), entries));
            self.chosen = None;
        }
        let entries = self.completed.as_ref().map_or(&[][..], |(_, entries)| entries);
        let shown = &entries[..entries.len().min(MAX_ENTRIES)];
        let (up, down, tab, enter) = ui.input_mut(|input| {
            let mut key = |key| focused && input.consume_key(Modifiers::NONE, key);
            (key(Key::ArrowUp), key(Key::ArrowDown), key(Key::Tab), key(Key::Enter))
        });
        if down && !shown.is_empty() {
            self.chosen = Some(self.chosen.map_or(0, |chosen| (chosen + 1).min(shown.len() - 1)));
        }
        if up {
            self.chosen = self.chosen.and_then(|chosen| chosen.checked_sub(1));
        }
        let mut filled = None;
        let mut opened = None;
        let marked = self.chosen.and_then(|chosen| shown.get(chosen));
        if tab {
            let common = || common_prefix(shown.iter().map(|entry| entry.path.as_str()));
            filled = marked.map_or_else(common, |entry| Some(entry.path.clone()));
        }
        if enter {
            match marked {
                Some(entry) if entry.folder => filled = Some(entry.path.clone()),
                Some(entry) => opened = Some(entry.path.clone()),
                None if !self.typed.trim().is_empty() => opened = Some(self.typed.trim().to_owned()),
                None => {}
            }
        }

        ui.horizontal(|ui| {
            let width = ui.available_width() - OPEN_WIDTH - ui.spacing().item_spacing.x;
            let edit = TextEdit::singleline(&mut self.typed).id(id).hint_text("/path/to/log.mcap").desired_width(width);
            let edit = ui.add(edit.lock_focus(true));
            edit.widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Path of the log"));
            if focus && !edit.has_focus() {
                edit.request_focus();
                // Typing replaces the path of the last time.
                select(ui, id, [0, self.typed.chars().count()]);
            }
            let ready = !self.typed.trim().is_empty();
            if ui.add_enabled(ready, Button::new("Open").min_size(vec2(OPEN_WIDTH, 0.0))).clicked() {
                opened = Some(self.typed.trim().to_owned());
            }
        });
        ScrollArea::vertical().max_height(height).auto_shrink([false, true]).show(ui, |ui| {
            for (number, entry) in shown.iter().enumerate() {
                let text = if entry.folder { format!("📁 {}", entry.path) } else { entry.path.clone() };
                let color = if entry.folder { theme.text_weak } else { theme.text };
                let row = ui.selectable_label(self.chosen == Some(number), RichText::new(text).color(color));
                if row.clicked() {
                    if entry.folder {
                        filled = Some(entry.path.clone());
                    } else {
                        opened = Some(entry.path.clone());
                    }
                }
            }
            if entries.len() > shown.len() {
                let text = format!("{} more", entries.len() - shown.len());
                ui.label(RichText::new(text).small().color(theme.text_weak));
            }
        });
        if let Some(path) = filled {
            self.typed = path;
            let end = self.typed.chars().count();
            select(ui, id, [end, end]);
        }
        opened.map(PathBuf::from)
    }
}

/// Selects a range of letters; an empty one moves the caret.
fn select(ui: &Ui, id: Id, range: [usize; 2]) {
    if let Some(mut state) = TextEdit::load_state(ui.ctx(), id) {
        let [from, to] = range.map(egui::text::CCursor::new);
        state.cursor.set_char_range(Some(egui::text::CCursorRange::two(from, to)));
        state.store(ui.ctx(), id);
    }
}

/// The longest common prefix of all paths, `None` without paths.
fn common_prefix<'a>(mut paths: impl Iterator<Item = &'a str>) -> Option<String> {
    let mut common = paths.next()?.to_owned();
    for path in paths {
        let same = common.char_indices().zip(path.chars()).find(|((_, a), b)| a != b).map(|((at, _), _)| at);
        common.truncate(same.unwrap_or_else(|| common.len().min(path.len())));
    }
    Some(common)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_common_prefix_ends_between_letters() {
        let common = |paths: &[&str]| common_prefix(paths.iter().copied());
        assert_eq!(common(&["/a/yard.mcap", "/a/yärd.mcap"]).as_deref(), Some("/a/y"));
        assert_eq!(common(&["/a/b", "/a/bcd"]).as_deref(), Some("/a/b"));
        assert_eq!(common(&["/a/bcd", "/a/b"]).as_deref(), Some("/a/b"));
        assert_eq!(common(&[]), None);
    }
}
