//! A ring around the widget with the keyboard focus.

use egui::{Event, Key, LayerId, Order, Stroke, StrokeKind, Ui};

use crate::gui::theme::{CORNER_RADIUS, Theme};

/// Whether the user navigates by keyboard.
#[derive(Debug, Default)]
pub(super) struct FocusRing {
    by_key: bool,
}

impl FocusRing {
    /// Draws the ring; none while the pointer moves the focus.
    pub(super) fn ui(&mut self, ui: &Ui, theme: &Theme) {
        ui.input(|input| {
            for event in &input.raw.events {
                match event {
                    Event::Key {
                        key: Key::Tab | Key::ArrowDown | Key::ArrowUp | Key::ArrowLeft | Key::ArrowRight,
                        pressed: true,
                        ..
                    } => self.by_key = true,
                    Event::PointerButton { pressed: true, .. } => self.by_key = false,
                    _ => {}
                }
            }
        });
        let focused = ui.memory(egui::Memory::focused).filter(|_| self.by_key);
        let Some(response) = focused.and_then(|id| ui.ctx().read_response(id)) else { return };
        // Above everything, so that adjacent widgets do not cover the ring.
        let layer = LayerId::new(Order::Tooltip, egui::Id::unique("focus ring"));
        let painter = ui.ctx().layer_painter(layer).with_clip_rect(ui.ctx().content_rect());
        let rect = response.rect.intersect(response.interact_rect.expand(2.0)).expand(1.0);
        painter.rect_stroke(rect, CORNER_RADIUS, Stroke::new(2.0, theme.accent), StrokeKind::Outside);
    }
}
