//! The keyboard focus: a ring around the focused widget, and names of the separators between panels.

use egui::accesskit::{Orientation, Role};
use egui::{Event, Id, Key, LayerId, Order, Stroke, StrokeKind, Ui, WidgetRect};

use crate::gui::theme::{CORNER_RADIUS, Theme};

/// Maximum width of a separator between panels and its minimum length, in points.
const LINE_WIDTH: f32 = 14.0;
const MIN_LINE_LENGTH: f32 = 40.0;

/// State of keyboard navigation.
#[derive(Debug, Default)]
pub(in crate::gui) struct FocusRing {
    by_key: bool,
    /// True if the focus moves backwards.
    backward: bool,
}

impl FocusRing {
    /// Draws the ring; no ring while the pointer moves the focus.
    pub(in crate::gui) fn ui(&mut self, ui: &Ui, theme: &Theme) {
        self.read_keys(ui);
        let widgets = focusable(ui);
        for line in widgets.iter().filter(|widget| is_line(widget)) {
            name_line(ui, line);
        }
        let Some(focused) = ui.memory(egui::Memory::focused).filter(|_| self.by_key) else { return };
        let focused = self.passed_over(ui, &widgets, focused);
        let Some(response) = ui.ctx().read_response(focused) else { return };
        // Drawn above everything, so that adjacent widgets do not cover the ring.
        let layer = LayerId::new(Order::Tooltip, Id::unique("focus ring"));
        let painter = ui.ctx().layer_painter(layer).with_clip_rect(ui.ctx().content_rect());
        let rect = response.rect.intersect(response.interact_rect.expand(2.0)).expand(1.0);
        painter.rect_stroke(rect, CORNER_RADIUS, Stroke::new(2.0, theme.accent), StrokeKind::Outside);
    }

    fn read_keys(&mut self, ui: &Ui) {
        ui.input(|input| {
            for event in &input.raw.events {
                match event {
                    Event::Key { key: Key::Tab, pressed: true, modifiers, .. } => {
                        (self.by_key, self.backward) = (true, modifiers.shift);
                    }
                    Event::Key {
                        key: Key::ArrowDown | Key::ArrowUp | Key::ArrowLeft | Key::ArrowRight,
                        pressed: true,
                        ..
                    } => self.by_key = true,
                    Event::PointerButton { pressed: true, .. } => self.by_key = false,
                    _ => {}
                }
            }
        });
    }

    /// Moves the focus on from a separator between panels, which no key moves. Returns the widget with the focus.
    fn passed_over(&self, ui: &Ui, widgets: &[WidgetRect], focused: Id) -> Id {
        let Some(at) = widgets.iter().position(|widget| widget.id == focused) else { return focused };
        if !is_line(&widgets[at]) {
            return focused;
        }
        let (before, from) = widgets.split_at(at);
        let mut onward = from.iter().chain(before);
        let stop = |widget: &&WidgetRect| !is_line(widget);
        let next = if self.backward { onward.rev().find(stop) } else { onward.find(stop) };
        let Some(next) = next else { return focused };
        ui.memory_mut(|memory| memory.request_focus(next.id));
        next.id
    }
}

/// Focusable widgets in the layer of `ui`, in the order of the Tab key.
fn focusable(ui: &Ui) -> Vec<WidgetRect> {
    ui.ctx().viewport(|viewport| {
        let widgets = viewport.this_pass.widgets.layers().filter(|(layer, _)| **layer == ui.layer_id());
        let can = |widget: &&WidgetRect| widget.enabled && widget.visible && widget.sense.is_focusable();
        widgets.flat_map(|(_, widgets)| widgets.iter().filter(can).copied()).collect()
    })
}

/// True for a separator between panels and for a scroll bar: they are dragged with the pointer, not moved by keys.
fn is_line(widget: &WidgetRect) -> bool {
    let size = widget.rect.size();
    widget.sense.senses_drag() && size.min_elem() < LINE_WIDTH && size.max_elem() >= MIN_LINE_LENGTH
}

/// Names a separator between panels; the libraries do not.
fn name_line(ui: &Ui, line: &WidgetRect) {
    let upright = line.rect.height() > line.rect.width();
    ui.ctx().accesskit_node_builder(line.id, |node| {
        if node.role() == Role::Unknown && node.label().is_none() {
            node.set_role(Role::Splitter);
            node.set_label("Resize panels");
            node.set_orientation(if upright { Orientation::Vertical } else { Orientation::Horizontal });
        }
    });
}
