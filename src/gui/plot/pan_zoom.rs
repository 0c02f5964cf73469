//! Zooming and panning of an image or matrix with the pointer.

use egui::{LayerId, Order, PointerButton, Rect, Response, Stroke, StrokeKind, Ui, Vec2};

use crate::gui::theme::Theme;

/// Minimum side in points of a box that is selected with the pointer.
const MIN_BOX: f32 = 8.0;

/// The visible region of an image or matrix, the content.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gui) struct PanZoom {
    /// Size relative to the fitted size.
    pub(in crate::gui) zoom: f32,
    /// Centre of the region as fractions of the size of the image.
    pub(in crate::gui) centre: Vec2,
}

impl Default for PanZoom {
    fn default() -> Self {
        Self { zoom: 1.0, centre: Vec2::splat(0.5) }
    }
}

impl PanZoom {
    /// Rectangle of the whole content around the centre of `area`, given its fitted size; it may be larger than the
    /// area.
    pub(in crate::gui) fn place(self, area: Rect, fitted: Vec2) -> Rect {
        let size = fitted * self.zoom;
        Rect::from_min_size(area.center() - self.centre * size, size)
    }

    /// The wheel and pinching zoom about the pointer, dragging and horizontal scrolling pan, a drag with the secondary
    /// button zooms to a box, a double click fits the image.
    pub(in crate::gui) fn navigate(
        &mut self,
        ui: &Ui,
        theme: &Theme,
        area: Rect,
        fitted: Vec2,
        response: &Response,
        max_zoom: f32,
    ) {
        if response.double_clicked() {
            *self = Self::default();
        }
        let before = self.place(area, fitted);
        if let Some(pointer) = response.hover_pos() {
            let (pinched, scrolled) = ui.input(|input| (input.zoom_delta(), input.smooth_scroll_delta()));
            let upright = scrolled.y.abs() > scrolled.x.abs();
            let factor = if upright { pinched * (scrolled.y * 0.004).exp() } else { pinched };
            self.zoom_about((pointer - before.min) / before.size(), factor, max_zoom);
            if !upright {
                self.centre.x -= scrolled.x / before.width();
            }
        }
        if response.dragged() && !response.dragged_by(PointerButton::Secondary) {
            self.centre -= response.drag_delta() / before.size();
        }
        self.select_box(ui, theme, area, fitted, response, max_zoom);
        let room = 0.5 / self.zoom;
        self.centre = self.centre.clamp(Vec2::splat(room), Vec2::splat(1.0 - room));
    }

    /// Zooms by a factor; the position `anchor`, in fractions of the content, stays where it is.
    fn zoom_about(&mut self, anchor: Vec2, factor: f32, max_zoom: f32) {
        let zoom = (self.zoom * factor).clamp(1.0, max_zoom);
        self.centre = anchor + (self.centre - anchor) * (self.zoom / zoom);
        self.zoom = zoom;
    }

    fn select_box(&mut self, ui: &Ui, theme: &Theme, area: Rect, fitted: Vec2, response: &Response, max_zoom: f32) {
        let stored = response.id.with("box");
        if response.drag_started_by(PointerButton::Secondary)
            && let Some(origin) = ui.input(|input| input.pointer.press_origin())
        {
            ui.data_mut(|data| data.insert_temp(stored, origin));
        }
        let dragged = response.dragged_by(PointerButton::Secondary);
        let complete = response.drag_stopped_by(PointerButton::Secondary);
        let origin = ui.data(|data| data.get_temp(stored)).filter(|_| dragged || complete);
        let Some((origin, pointer)) = origin.zip(response.interact_pointer_pos()) else { return };
        let selected = Rect::from_two_pos(origin, pointer).intersect(area);
        if dragged && !complete {
            // Drawn above the content, which is painted later.
            let layer = LayerId::new(Order::Foreground, stored);
            let painter = ui.ctx().layer_painter(layer).with_clip_rect(area);
            let line = Stroke::new(1.0, theme.accent);
            painter.rect(selected, 0.0, theme.accent.gamma_multiply(0.2), line, StrokeKind::Inside);
        } else if selected.width() >= MIN_BOX && selected.height() >= MIN_BOX {
            let place = self.place(area, fitted);
            let fit = (area.width() / selected.width()).min(area.height() / selected.height());
            self.centre = (selected.center() - place.min) / place.size();
            self.zoom = (self.zoom * fit).clamp(1.0, max_zoom);
        }
    }
}

#[cfg(test)]
mod tests {
    use egui::{Event, Modifiers, MouseWheelUnit, Pos2, Sense, TouchPhase, pos2, vec2};
    use egui_kittest::Harness;

    use super::*;
    use crate::gui::theme::ThemeName;

    /// Content of 400 × 300 points that fills its area.
    fn harness() -> Harness<'static, PanZoom> {
        let draw = |ui: &mut Ui, view: &mut PanZoom| {
            let area = Rect::from_min_size(pos2(10.0, 10.0), vec2(400.0, 300.0));
            let response = ui.interact(area, ui.unique_id().with("content"), Sense::click_and_drag());
            view.navigate(ui, &Theme::of(ThemeName::Dark), area, area.size(), &response, 16.0);
        };
        Harness::builder().with_size([500.0, 400.0]).build_ui_state(draw, PanZoom::default())
    }

    fn drag(harness: &mut Harness<'static, PanZoom>, button: PointerButton, from: Pos2, to: Pos2) {
        harness.event(Event::PointerMoved(from));
        harness.run_steps(1);
        let press = |pos, pressed| Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE };
        harness.event(press(from, true));
        harness.run_steps(1);
        for step in 1..=4 {
            harness.event(Event::PointerMoved(from + (to - from) * (step as f32 / 4.0)));
            harness.run_steps(1);
        }
        harness.event(press(to, false));
        harness.run_steps(2);
    }

    fn scroll(harness: &mut Harness<'static, PanZoom>, at: Pos2, delta: Vec2, modifiers: Modifiers) {
        harness.event(Event::PointerMoved(at));
        harness.event(Event::MouseWheel {
            unit: MouseWheelUnit::Point,
            delta,
            phase: TouchPhase::Move,
            source: egui::MouseWheelSource::Unknown,
            modifiers,
        });
        harness.run_steps(30);
    }

    #[test]
    fn the_wheel_zooms_about_the_pointer_and_a_double_click_fits() {
        let mut harness = harness();
        let pointer = pos2(110.0, 85.0);
        scroll(&mut harness, pointer, vec2(0.0, 200.0), Modifiers::NONE);
        let view = *harness.state();
        assert!(view.zoom > 1.5, "{view:?}");
        let area = Rect::from_min_size(pos2(10.0, 10.0), vec2(400.0, 300.0));
        let place = view.place(area, area.size());
        let under = (pointer - place.min) / place.size();
        assert!((under - vec2(0.25, 0.25)).length() < 1e-3, "a quarter of the content is still under it: {under:?}");
        scroll(&mut harness, pointer, vec2(-40.0, 0.0), Modifiers::NONE);
        assert!(harness.state().zoom == view.zoom && harness.state().centre.x > view.centre.x);
        // In one frame: a frame of the test takes a quarter of a second.
        let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
        let press = |pressed| Event::PointerButton { pos: pointer, button, pressed, modifiers };
        harness.input_mut().events.extend([true, false, true, false].map(press));
        harness.run_steps(1);
        assert_eq!(*harness.state(), PanZoom::default());
    }

    #[test]
    fn dragging_pans_and_the_secondary_button_zooms_to_a_box() {
        let mut harness = harness();
        drag(&mut harness, PointerButton::Secondary, pos2(110.0, 85.0), pos2(210.0, 160.0));
        let view = *harness.state();
        assert!((view.zoom - 4.0).abs() < 1e-3 && (view.centre - vec2(0.375, 0.375)).length() < 1e-3, "{view:?}");
        drag(&mut harness, PointerButton::Primary, pos2(200.0, 200.0), pos2(260.0, 170.0));
        let panned = *harness.state();
        assert!(panned.zoom == view.zoom && panned.centre.x < view.centre.x && panned.centre.y > view.centre.y);
        drag(&mut harness, PointerButton::Secondary, pos2(200.0, 200.0), pos2(203.0, 203.0));
        assert_eq!(*harness.state(), panned, "a click with the secondary button zooms nowhere");
    }
}
