//! Export of the focused panel: a screenshot, a drawing and its values.

use std::cell::RefCell;

use egui::{Ui, Vec2};

use super::figure::{alone_ui, complete};
use super::panels::Panels;
use crate::geometry::seconds_from_ns;
use crate::gui::desktop::PanelExport;
use crate::gui::rendering::{headless, headless::HeadlessOptions};
use crate::gui::{PanelContext, PanelName, Playback, Presentation};
use crate::text::Named as _;

/// Pixels per point of the screenshot: twice an ordinary screen, so that it can be printed.
const PIXELS_PER_POINT: f32 = 2.0;
/// Largest side of the screenshot in pixels.
const MAX_SIDE_PX: f32 = 8192.0;

/// Minimum size in points of the screenshot of a panel with a list.
const MIN_LIST_SIZE: Vec2 = Vec2::new(460.0, 640.0);

/// Draws a panel of a size in points again without the window around it.
pub(super) fn export(panels: &Panels, (panel, size): (PanelName, Vec2), ctx: &mut PanelContext<'_>) -> PanelExport {
    let mut copy = panels.views();
    copy.inspector.show_times = panels.inspector.show_times;
    let copy = RefCell::new(copy);
    // A scrolling list in a low panel is exported completely, up to a limit.
    let min_size = match panel {
        PanelName::Rank | PanelName::Inspector | PanelName::Breakpoints => MIN_LIST_SIZE,
        _ => Vec2::ZERO,
    };
    let size = size.max(min_size);
    let side = |points: f32| (points * PIXELS_PER_POINT).clamp(64.0, MAX_SIDE_PX) as u32;
    let options_of = |size: Vec2| HeadlessOptions {
        size_px: [side(size.x), side(size.y)],
        pixels_per_point: PIXELS_PER_POINT,
        theme: ctx.theme.name,
    };
    let PanelContext { recording, cursor_ns, theme, .. } = *ctx;
    let mut selection = ctx.selection.clone();
    let images = &mut *ctx.images;
    let playback = Playback { playing: false, ..ctx.playback.clone() };
    let mut draw_ui = |ui: &mut Ui| {
        // Commands of the panel have no effect.
        let commands = &mut Vec::new();
        let (images, selection, playback) = (&mut *images, &mut selection, &playback);
        let presentation = Presentation::Figure;
        let context =
            &mut PanelContext { recording, cursor_ns, playback, images, selection, theme, presentation, commands };
        alone_ui(panel, ui, &mut copy.borrow_mut(), context);
    };
    let options = complete(panel, options_of(size), &copy, &mut draw_ui);
    let screenshot = headless::draw(options, &mut draw_ui);
    copy.borrow_mut().drop_textures();
    let drawing = headless::svg_of(options, "clip", panel.name(), &mut draw_ui);
    let name = format!("{}/{}-{:.3}s", recording.log_stem(), panel.name(), seconds_from_ns(cursor_ns));
    PanelExport { name, screenshot, drawing, table: copy.into_inner().csv_table(panel, ctx) }
}

/// The values of a panel, comma separated.
pub fn panel_table(panel: PanelName, panels: &mut Panels, ctx: &mut PanelContext<'_>) -> String {
    ctx.move_chain();
    panels.csv_table(panel, ctx)
}
