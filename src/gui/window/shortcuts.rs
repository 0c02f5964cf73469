//! List of shortcuts: the actions of the table by menu, and keys and gestures without an action.

use egui::{Align, Align2, Label, Layout, RichText, ScrollArea, Ui, vec2};

use super::menu::Menu;
use crate::gui::theme::Theme;
use crate::text::Named as _;

const POINTER: [(&str, &str); 12] = [
    ("Click a tab", "focus the panel; double-click: maximize it, or restore the others"),
    ("Hover", "values of all curves at the pointer's time, in all plots"),
    ("Alt+scroll", "zoom the values (also scroll over a value axis; drag it: move, double-click: automatic)"),
    ("Scroll, pinch", "zoom about the pointer (Ctrl+scroll where the panel scrolls)"),
    ("Drag", "pan; on the timeline: move the cursor"),
    ("Shift+scroll", "pan in time, as horizontal scrolling and middle drag"),
    ("Right drag", "zoom to a time range, or to a box of the image"),
    ("Double-click", "show the whole log, fit the image"),
    ("Right click", "menu of the parameter, feature, run, marker, time, value or panel there; also on tabs and runs"),
    ("Shift+drag", "on the timeline: set the loop range"),
    ("Drag on rows", "of the timeline's parameters: σ before and after"),
    ("Click", "a plot: move the cursor; a parameter or feature: select it"),
];

/// Keys that work everywhere.
const EVERYWHERE: [(&str, &str); 3] = [
    ("Tab, Shift+Tab", "focus the next or previous control; Enter or Space activates it"),
    ("Ctrl and +, − or 0", "zoom in, zoom out, reset zoom"),
    ("Ctrl+P, then a number", "go to a time or frame, select a feature"),
];

/// Width in points of a column, and of the keys in it.
const COLUMN_WIDTH: f32 = 372.0;
const KEYS_WIDTH: f32 = 116.0;
/// Distance of two columns in points.
const GAP: f32 = 18.0;
/// Distance in points between the list and the edges of the window.
const MARGIN: f32 = 60.0;
const HEADING_ROWS: usize = 2;

/// A group of rows under a heading.
struct Section {
    title: &'static str,
    /// Keys or gesture, and the effect.
    rows: Vec<(&'static str, &'static str)>,
}

impl Section {
    fn height(&self) -> usize {
        self.rows.len() + HEADING_ROWS
    }
}

/// All sections: one per menu, then those without actions.
fn sections() -> Vec<Section> {
    let of_menu = |menu: Menu| {
        let rows = menu.groups().into_iter().flatten().map(|entry| (entry.keys, entry.name)).collect();
        Section { title: menu.name(), rows }
    };
    let others = [("Everywhere", &EVERYWHERE[..]), ("Pointer on a plot or the timeline", &POINTER[..])];
    let others = others.map(|(title, rows)| Section { title, rows: rows.to_vec() });
    Menu::all().map(of_menu).chain(others).collect()
}

/// Distributes sections over at most `count` columns of about equal height, in their order.
fn columns(sections: Vec<Section>, count: usize) -> Vec<Vec<Section>> {
    let fits = |limit: usize| {
        let (mut used, mut height) = (1, 0);
        for section in &sections {
            if height > 0 && height + section.height() > limit {
                (used, height) = (used + 1, 0);
            }
            height += section.height();
        }
        used <= count.max(1)
    };
    let highest = sections.iter().map(Section::height).max().unwrap_or(0);
    let total: usize = sections.iter().map(Section::height).sum();
    let limit = (highest..=total).find(|limit| fits(*limit)).unwrap_or(total);
    let mut columns: Vec<Vec<Section>> = vec![Vec::new()];
    let mut height = 0;
    for section in sections {
        if height > 0 && height + section.height() > limit {
            columns.push(Vec::new());
            height = 0;
        }
        height += section.height();
        if let Some(column) = columns.last_mut() {
            column.push(section);
        }
    }
    columns
}

/// Draws the list while it is open, in as many columns as fit; it scrolls if the window is too low.
pub(super) fn ui(ui: &Ui, theme: &Theme, open: &mut bool) {
    let room = ui.ctx().content_rect().size() - vec2(MARGIN, MARGIN + 40.0);
    let count = (((room.x + GAP) / (COLUMN_WIDTH + GAP)) as usize).clamp(1, 3);
    let width = (room.x / count as f32 - GAP).clamp(160.0, COLUMN_WIDTH);
    let window = egui::Window::new("Shortcuts").open(open).collapsible(false).resizable(false);
    window.anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).show(ui.ctx(), |ui| {
        let height = room.y.max(80.0);
        let area = ScrollArea::vertical().max_height(height).min_scrolled_height(height).auto_shrink(true);
        area.show(ui, |ui| {
            ui.horizontal_top(|ui| {
                ui.spacing_mut().item_spacing.x = GAP;
                for column in columns(sections(), count) {
                    ui.vertical(|ui| {
                        ui.set_width(width);
                        ui.spacing_mut().item_spacing = vec2(6.0, 2.0);
                        for section in column {
                            section_ui(ui, theme, &section);
                        }
                    });
                }
            });
        });
    });
}

fn section_ui(ui: &mut Ui, theme: &Theme, section: &Section) {
    ui.add_space(4.0);
    ui.label(RichText::new(section.title).strong().color(theme.text_strong));
    for (keys, name) in &section.rows {
        ui.horizontal_top(|ui| {
            let keys_width = KEYS_WIDTH.min(0.45 * ui.available_width());
            ui.allocate_ui_with_layout(vec2(keys_width, 16.0), Layout::top_down(Align::Min), |ui| {
                ui.set_width(keys_width);
                ui.add(Label::new(RichText::new(*keys).monospace().color(theme.text_strong)).wrap());
            });
            ui.add(Label::new(RichText::new(*name).color(theme.text)).wrap());
        });
    }
    ui.add_space(4.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_hold_every_row_once_in_order() {
        let rows = |columns: &[Vec<Section>]| -> Vec<&'static str> {
            columns.iter().flatten().flat_map(|section| section.rows.iter().map(|(_, name)| *name)).collect()
        };
        let expected = rows(&[sections()]);
        for count in 1..=4 {
            let columns = columns(sections(), count);
            assert!(columns.len() <= count && columns.iter().all(|column| !column.is_empty()));
            assert_eq!(rows(&columns), expected);
        }
        let heights: Vec<usize> =
            columns(sections(), 3).iter().map(|column| column.iter().map(Section::height).sum()).collect();
        let highest = heights.iter().max().unwrap();
        assert!(*highest * 3 < 2 * heights.iter().sum::<usize>(), "{heights:?}");
    }
}
