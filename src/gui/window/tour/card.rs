//! Card of a stop: it is placed next to its panel and points at it.

use egui::{Area, Button, Id, Label, Order, Pos2, Rect, RichText, Shape, Stroke, StrokeKind, Ui, Vec2, pos2, vec2};

use super::texts::CardText;
use crate::gui::theme::{Theme, dialog_frame};

/// Width of the text in points.
const WIDTH: f32 = 370.0;
/// Gap in points between card and panel, in which the pointer is drawn.
const GAP: f32 = 14.0;
/// Distance of the card from the edges of the window in points.
const MARGIN: f32 = 6.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pressed {
    /// Go to the next stop; at the last one, end the tour.
    Next,
    /// Go to the previous stop.
    Back,
    End,
}

/// Draws the card of stop `index` of `count` and marks its panel; returns the pressed button.
pub(super) fn card_ui(
    ui: &Ui,
    theme: &Theme,
    (index, count): (usize, usize),
    text: &CardText,
    panel: Option<Rect>,
) -> Option<Pressed> {
    let room = ui.ctx().content_rect().shrink(MARGIN);
    let id = Id::unique("tour");
    let size = ui.ctx().memory(|memory| memory.area_rect(id)).map_or(vec2(WIDTH + 26.0, 220.0), |rect| rect.size());
    let place = panel.map_or_else(|| corner(room, size), |panel| beside(panel, room, size));
    if let Some(panel) = panel {
        let ring = Stroke::new(2.0, theme.accent);
        ui.painter().rect_stroke(panel, 3.0, ring, StrokeKind::Inside);
        if let Some(pointer) = pointer(place, panel) {
            ui.painter().add(Shape::convex_polygon(pointer.to_vec(), theme.accent, Stroke::NONE));
        }
    }
    let mut pressed = None;
    let area = Area::new(id).order(Order::Middle).fixed_pos(place.min).constrain_to(room).fade_in(false);
    area.show(ui.ctx(), |ui| {
        dialog_frame(theme).stroke(Stroke::new(1.5, theme.accent)).show(ui, |ui| {
            ui.set_width(WIDTH);
            ui.spacing_mut().item_spacing.y = 6.0;
            let title = format!("{} of {count}: {}", index + 1, text.title);
            ui.add(Label::new(RichText::new(title).size(15.0).color(theme.text_strong)).wrap());
            for line in &text.lines {
                ui.add(Label::new(RichText::new(line).color(theme.text)).wrap());
            }
            if let Some(waiting) = &text.waiting {
                ui.horizontal(|ui| {
                    ui.spinner();
                    ui.label(RichText::new(waiting).color(theme.text_weak));
                });
                ui.ctx().request_repaint_after(std::time::Duration::from_millis(100));
            }
            ui.horizontal(|ui| {
                let last = index + 1 == count;
                let next = Button::new(if last { "Finish" } else { "Next" }).fill(theme.accent.gamma_multiply(0.35));
                if ui.add(next).clicked() {
                    pressed = Some(Pressed::Next);
                }
                if ui.add_enabled(index > 0, Button::new("Back")).clicked() {
                    pressed = Some(Pressed::Back);
                }
                if !last && ui.button("End tour").clicked() {
                    pressed = Some(Pressed::End);
                }
                ui.label(RichText::new("Enter: next, Backspace: back, Escape: end").small().color(theme.text_weak));
            });
        });
    });
    pressed
}

/// Rectangle of the card inside the window: left, right, above or below the panel, else in the panel's lower right
/// corner.
fn beside(panel: Rect, room: Rect, size: Vec2) -> Rect {
    let middle = panel.center() - 0.5 * size;
    let inside = |at: Pos2| {
        let limit = room.max - size;
        pos2(at.x.min(limit.x).max(room.left()), at.y.min(limit.y).max(room.top()))
    };
    let candidates = [
        pos2(panel.left() - GAP - size.x, middle.y),
        pos2(panel.right() + GAP, middle.y),
        pos2(middle.x, panel.top() - GAP - size.y),
        pos2(middle.x, panel.bottom() + GAP),
    ];
    let places = candidates.into_iter().map(|at| Rect::from_min_size(inside(at), size));
    let free = |place: &Rect| !place.intersects(panel);
    places.into_iter().find(free).unwrap_or_else(|| corner(panel.intersect(room).shrink(GAP), size))
}

fn corner(room: Rect, size: Vec2) -> Rect {
    Rect::from_min_size(room.max - size, size)
}

/// Triangle from the card to its panel; `None` for a card inside its panel.
fn pointer(card: Rect, panel: Rect) -> Option<[Pos2; 3]> {
    const HALF: f32 = 9.0;
    let (x, y) = (card.center().x.clamp(panel.left() + HALF, panel.right() - HALF), card.center().y);
    let y = y.clamp(panel.top() + HALF, panel.bottom() - HALF);
    if card.right() <= panel.left() {
        Some([pos2(card.right(), y - HALF), pos2(panel.left(), y), pos2(card.right(), y + HALF)])
    } else if card.left() >= panel.right() {
        Some([pos2(card.left(), y - HALF), pos2(panel.right(), y), pos2(card.left(), y + HALF)])
    } else if card.bottom() <= panel.top() {
        Some([pos2(x - HALF, card.bottom()), pos2(x, panel.top()), pos2(x + HALF, card.bottom())])
    } else if card.top() >= panel.bottom() {
        Some([pos2(x - HALF, card.top()), pos2(x, panel.bottom()), pos2(x + HALF, card.top())])
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_card_lies_beside_its_panel_and_inside_the_window() {
        let room = Rect::from_min_size(Pos2::ZERO, vec2(1366.0, 768.0));
        let size = vec2(400.0, 200.0);
        for panel in [
            Rect::from_min_size(pos2(1020.0, 30.0), vec2(346.0, 420.0)),
            Rect::from_min_size(pos2(0.0, 560.0), vec2(1366.0, 180.0)),
            Rect::from_min_size(pos2(0.0, 30.0), vec2(500.0, 300.0)),
            Rect::from_min_size(pos2(0.0, 30.0), vec2(1018.0, 320.0)),
        ] {
            let card = beside(panel, room, size);
            assert!(room.contains_rect(card) && !card.intersects(panel), "{panel}: {card}");
            assert!(pointer(card, panel).is_some(), "{panel}");
        }
        let card = beside(room, room, size);
        assert!(room.contains_rect(card) && pointer(card, room).is_none());
    }
}
