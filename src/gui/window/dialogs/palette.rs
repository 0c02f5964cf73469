//! Command palette: search over all actions of the window.

use egui::{Align, Button, Key, Layout, Modifiers, RichText, ScrollArea, TextEdit, Ui, WidgetInfo, vec2};

use super::modal::Modal;
use super::palette_items::{Choice, Item, found};
use crate::gui::PanelContext;
use crate::gui::window::actions::Action;
use crate::gui::window::panel_tiles::PanelTiles;
use crate::session::Command;

/// Width of the palette and height of its list in points.
const WIDTH: f32 = 640.0;
const LIST_HEIGHT: f32 = 360.0;
/// Number of rows that Page up and Page down move.
const PAGE_ROWS: usize = 10;

#[derive(Debug, Default)]
pub(super) struct CommandPalette {
    typed: String,
    chosen: usize,
}

impl CommandPalette {
    /// Draws the palette. A chosen action is pushed to `actions`, another choice is executed immediately. Returns true
    /// if it stays open.
    pub(super) fn ui(
        &mut self,
        ui: &Ui,
        ctx: &mut PanelContext<'_>,
        tiles: &PanelTiles,
        actions: &mut Vec<Action>,
    ) -> bool {
        let theme = *ctx.theme;
        let width = WIDTH.min(ui.ctx().content_rect().width() - 60.0);
        let modal = Modal { name: "command palette", title: "", width };
        let (choice, stays_open) = modal.ui(ui, &theme, |ui| {
            let moved = moves(ui);
            let hint = "Command, time (12.5), frame, feature or parameter";
            // The input gets the focus before it is drawn, so that no typed letter is lost.
            let id = ui.unique_id().with("command");
            ui.memory_mut(|memory| memory.request_focus(id));
            let edit = TextEdit::singleline(&mut self.typed).id(id).hint_text(hint).desired_width(f32::INFINITY);
            let edit = ui.add(edit);
            edit.widget_info(|| WidgetInfo::labeled(egui::Role::TextInput, true, "Command"));
            if edit.changed() {
                self.chosen = 0;
            }
            let items = found(&self.typed, ui, ctx, tiles);
            let last = items.len().saturating_sub(1);
            let before = self.chosen;
            self.chosen = match moved {
                Some(Move::By(rows)) => self.chosen.saturating_add_signed(rows).min(last),
                Some(Move::Enter) | None => self.chosen.min(last),
            };
            let clicked = list_ui(ui, ctx, &items, self.chosen, self.chosen != before || edit.changed());
            let entered = matches!(moved, Some(Move::Enter)).then_some(self.chosen);
            clicked.or(entered).and_then(|number| items.into_iter().nth(number)).map(|item| item.choice)
        });
        let chosen = choice.is_some();
        match choice {
            Some(Choice::Action(action)) => actions.push(action),
            Some(Choice::Parameter(parameter, since_ns)) => {
                ctx.selection.parameter = Some(parameter);
                ctx.commands.extend(since_ns.map(|stamp_ns| Command::Seek { stamp_ns }));
            }
            None => {}
        }
        stays_open && !chosen
    }
}

/// Movement of the selection by a key.
#[derive(Clone, Copy, Debug)]
enum Move {
    By(isize),
    Enter,
}

fn moves(ui: &Ui) -> Option<Move> {
    let page = PAGE_ROWS as isize;
    let keys = [
        (Key::ArrowUp, Move::By(-1)),
        (Key::ArrowDown, Move::By(1)),
        (Key::PageUp, Move::By(-page)),
        (Key::PageDown, Move::By(page)),
        (Key::Enter, Move::Enter),
    ];
    ui.input_mut(|input| keys.into_iter().find(|(key, _)| input.consume_key(Modifiers::NONE, *key)).map(|(_, it)| it))
}

/// Draws the items and scrolls to the selected one; returns the clicked one.
fn list_ui(ui: &mut Ui, ctx: &PanelContext<'_>, items: &[Item], chosen: usize, bring: bool) -> Option<usize> {
    let mut clicked = None;
    // The height does not depend on the number of items, so that the palette stays in its place.
    let height = LIST_HEIGHT.min(ui.ctx().content_rect().height() - 120.0);
    ScrollArea::vertical().max_height(height).min_scrolled_height(height).auto_shrink(false).show(ui, |ui| {
        if items.is_empty() {
            ui.label(RichText::new("No match").color(ctx.theme.text_weak));
        }
        for (number, item) in items.iter().enumerate() {
            let size = vec2(ui.available_width(), ui.spacing().interact_size.y);
            ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
                ui.label(RichText::new(item.keys).small().color(ctx.theme.text_weak));
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    // A long name does not widen the palette.
                    let row = ui.add(Button::selectable(number == chosen, &item.name).truncate());
                    if row.clicked() {
                        clicked = Some(number);
                    }
                    if bring && number == chosen {
                        row.scroll_to_me(None);
                    }
                });
            });
        }
    });
    clicked
}
