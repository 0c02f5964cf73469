//! Size and position of the window and the layout of its panels, restored at the next start.

use egui::{ViewportBuilder, ViewportInfo, pos2};
use serde::{Deserialize, Serialize};

/// Size of the window in logical pixels where the size of the screen is unknown; at the first start it is maximized.
const FIRST_SIZE: [f32; 2] = [1600.0, 900.0];
/// Part of each side of the screen that a window takes at the first start where it is not maximized: without a window
/// manager, or when it is restored.
const FIRST_RATIO: f32 = 0.9;
/// Minimum size in logical pixels.
const MIN_SIZE: [f32; 2] = [640.0, 400.0];
/// Number of frames after which a window is shown with its frame.
pub(super) const SHOWN_FRAMES: u32 = 4;
/// Seconds after which a change is stored.
pub(super) const STORED_AFTER_S: f64 = 1.0;

/// State of the window at the end of the last use.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub(super) struct KeptWindow {
    /// Size and position on the screen.
    pub(super) place: WindowPlace,
    /// Layout of the panels, in the window's format.
    pub(super) layout: Option<serde_json::Value>,
}

impl KeptWindow {
    /// Reads the text of [`KeptWindow::to_text`]; a text of another format gives the default.
    pub(super) fn from_text(text: &str) -> Self {
        let mut kept: Self = serde_json::from_str(text).unwrap_or_default();
        if !kept.place.is_valid() {
            kept.place = WindowPlace::default();
        }
        kept
    }

    pub(super) fn to_text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Size and position of a window in logical pixels: points at a program scale of 1.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub(super) struct WindowPlace {
    /// Upper left corner of the frame; `None` where the desktop does not report it (Wayland).
    position: Option<[f32; 2]>,
    /// Size without the frame.
    size: [f32; 2],
    /// True if the window is maximized; position and size are those before maximizing.
    maximized: bool,
}

impl Default for WindowPlace {
    fn default() -> Self {
        Self { position: None, size: FIRST_SIZE, maximized: true }
    }
}

impl WindowPlace {
    fn is_valid(&self) -> bool {
        let finite = |side: &f32| side.is_finite();
        let size = self.size.iter().zip(MIN_SIZE).all(|(side, least)| finite(side) && *side >= 0.5 * least);
        size && self.position.iter().flatten().all(finite)
    }

    /// Reads the place of a window of `size_points` at the program's scale. Minimized and full screens keep the last
    /// place.
    pub(super) fn read(&mut self, viewport: &ViewportInfo, size_points: egui::Vec2, scale: f32) {
        let is = |state: Option<bool>| state.unwrap_or(false);
        if is(viewport.minimized) || is(viewport.fullscreen) {
            return;
        }
        self.maximized = is(viewport.maximized);
        if !self.maximized {
            self.position = viewport.outer_rect.map(|rect| (rect.min.to_vec2() * scale).into());
            self.size = (size_points * scale).round().into();
        }
    }

    /// Returns `viewport` with this size and position.
    pub(super) fn of(self, viewport: ViewportBuilder) -> ViewportBuilder {
        let viewport = viewport.with_inner_size(self.size).with_min_inner_size(MIN_SIZE).with_maximized(self.maximized);
        match self.position {
            Some([x, y]) => viewport.with_position(pos2(x, y)),
            None => viewport,
        }
    }
}

/// A rectangle on the screen in pixels: left, top, width, height.
pub(super) type PixelRect = [i32; 4];

/// A window's rectangle, shifted and if necessary shrunk to lie inside the screen of which it covers most, or inside
/// the first screen. `None` if it is inside already.
pub(super) fn inside_screen(window: PixelRect, screens: &[PixelRect]) -> Option<PixelRect> {
    let overlap = |screen: &PixelRect, axis: usize| {
        let end = |rect: &PixelRect| i64::from(rect[axis]) + i64::from(rect[axis + 2]);
        let begin = i64::from(window[axis].max(screen[axis]));
        (end(&window).min(end(screen)) - begin).max(0)
    };
    let area = |screen: &&PixelRect| overlap(screen, 0) * overlap(screen, 1);
    // Of several equal ones the first; `max_by_key` alone would give the last.
    let screen = screens.iter().rev().max_by_key(area)?;
    let mut inside = window;
    for axis in 0..2 {
        inside[axis + 2] = window[axis + 2].min(screen[axis + 2]);
        let last = screen[axis].saturating_add(screen[axis + 2]).saturating_sub(inside[axis + 2]);
        inside[axis] = window[axis].clamp(screen[axis], last.max(screen[axis]));
    }
    (inside != window).then_some(inside)
}

/// Rectangle of a window at the first start, in the middle of its screen.
pub(super) fn first_on_screen(screen: PixelRect) -> PixelRect {
    let [left, top, width, height] = screen;
    let part = |side: i32| (FIRST_RATIO * side as f32) as i32;
    [left + (width - part(width)) / 2, top + (height - part(height)) / 2, part(width), part(height)]
}

/// Places a window: at the first start by the size of its screen, later only if it is partly outside of all screens, which
/// may have changed since the last use.
pub(super) fn place_on_screen(window: &winit::window::Window, is_first: bool) {
    use winit::dpi::{PhysicalPosition, PhysicalSize};
    // Wayland neither reports nor accepts a position.
    let Ok(position) = window.outer_position() else { return };
    let rect = |position: PhysicalPosition<i32>, size: PhysicalSize<u32>| {
        let side = |pixels: u32| i32::try_from(pixels).unwrap_or(i32::MAX);
        [position.x, position.y, side(size.width), side(size.height)]
    };
    let screens: Vec<PixelRect> =
        window.available_monitors().map(|monitor| rect(monitor.position(), monitor.size())).collect();
    let wanted = match screens.first() {
        Some(screen) if is_first => Some(first_on_screen(*screen)),
        _ => inside_screen(rect(position, window.outer_size()), &screens),
    };
    if let Some([left, top, width, height]) = wanted {
        // The size excludes the frame, which does not change.
        let frame = |outer: u32, inner: u32| i32::try_from(outer.saturating_sub(inner)).unwrap_or(0);
        let (outer, inner) = (window.outer_size(), window.inner_size());
        let width = width - frame(outer.width, inner.width);
        let height = height - frame(outer.height, inner.height);
        // The call returns the size if it is known immediately; the window reads it in its next frame in any case.
        let _known = window.request_inner_size(PhysicalSize::new(width.max(1), height.max(1)));
        window.set_outer_position(PhysicalPosition::new(left, top));
    }
}

/// Current window state, and the time since which it differs from the stored one.
#[derive(Debug, Default)]
pub(super) struct WindowKeeper {
    pub(super) kept: KeptWindow,
    pub(super) changed_s: Option<f64>,
    /// True if the window is maximized when it is shown.
    pub(super) maximizes: bool,
    /// Number of frames in which the window was shown, until it has its place.
    pub(super) shown: u32,
}

impl WindowKeeper {
    /// Starts with the stored state.
    pub(super) fn new(kept: KeptWindow) -> Self {
        Self { maximizes: kept.place.maximized, kept, changed_s: None, shown: 0 }
    }
}

#[cfg(test)]
mod tests {
    use egui::vec2;

    use super::*;

    #[test]
    fn a_window_is_moved_into_the_screen_it_covers_most() {
        let (left, right) = ([0, 0, 1920, 1080], [1920, 0, 1366, 768]);
        let moved = |window| inside_screen(window, &[left, right]);
        assert_eq!(moved([100, 50, 1600, 900]), None);
        assert_eq!(moved([2000, 10, 1200, 700]), None);
        assert_eq!(moved([-300, 900, 1600, 900]), Some([0, 180, 1600, 900]));
        assert_eq!(moved([1900, -20, 1600, 900]), Some([1920, 0, 1366, 768]), "the smaller screen");
        assert_eq!(moved([9000, 9000, 800, 600]), Some([1120, 480, 800, 600]), "a screen that is gone");
        assert_eq!(inside_screen([9000, 9000, 800, 600], &[]), None, "no screen is known");
    }

    #[test]
    fn the_first_window_is_in_the_middle_of_its_screen() {
        assert_eq!(first_on_screen([0, 0, 3840, 2160]), [192, 108, 3456, 1944]);
        assert_eq!(first_on_screen([1920, 0, 1000, 800]), [1970, 40, 900, 720]);
    }

    #[test]
    fn the_place_is_read_in_logical_pixels_and_kept_while_maximized() {
        let mut place = WindowPlace::default();
        let rect = egui::Rect::from_min_size(pos2(50.0, 20.0), vec2(500.0, 300.0));
        let mut viewport = ViewportInfo { outer_rect: Some(rect), ..ViewportInfo::default() };
        place.read(&viewport, vec2(500.0, 290.0), 2.0);
        let usual = WindowPlace { position: Some([100.0, 40.0]), size: [1000.0, 580.0], maximized: false };
        assert_eq!(place, usual);
        viewport.maximized = Some(true);
        place.read(&viewport, vec2(960.0, 540.0), 2.0);
        assert_eq!(place, WindowPlace { maximized: true, ..usual });
        viewport.minimized = Some(true);
        viewport.maximized = Some(false);
        place.read(&viewport, vec2(0.0, 0.0), 2.0);
        assert!(place.maximized, "a minimized window keeps its last place");
        let kept = KeptWindow { place, layout: Some(serde_json::json!({"a": 1})) };
        assert_eq!(KeptWindow::from_text(&kept.to_text()), kept);
        let tiny = "{\"place\": {\"position\": null, \"size\": [0.0, 3.0], \"maximized\": false}}";
        assert_eq!(KeptWindow::from_text(tiny), KeptWindow::default());
        assert_eq!(KeptWindow::from_text("no json"), KeptWindow::default());
    }
}
