//! The panel that has the focus, as files: a picture of what it shows, and the numbers behind it.

use egui::{CentralPanel, Frame, Ui, Vec2};

use super::{PanelName, WindowState};
use crate::geometry::seconds_from_ns;
use crate::gui::desktop::PanelExport;
use crate::gui::rendering::{headless, headless::HeadlessOptions};
use crate::gui::slide;
use crate::gui::theme::PANEL_MARGIN;
use crate::gui::{PanelContext, Playback};

/// Pixels per point of the picture: twice an ordinary screen, so that it can be printed.
const PIXELS_PER_POINT: f32 = 2.0;
/// Largest side of the picture in pixels.
const LARGEST_SIDE_PX: f32 = 8192.0;

/// Least size of the picture of a panel that is a list, in points.
const LEAST_SIZE_OF_LISTS: Vec2 = Vec2::new(460.0, 640.0);

/// Draws the panel once more, without the window around it.
pub(super) fn export(state: &WindowState, ctx: &mut PanelContext<'_>) -> PanelExport {
    let (panel, size) = state.focused();
    let mut copy = WindowState { panels: state.panels.views(), show_times: state.show_times, ..WindowState::default() };
    copy.panels.inspector.show_times = state.show_times;
    // A list that scrolls in a low panel is written whole, as far as it goes.
    let least = match panel {
        PanelName::Rank | PanelName::Inspector | PanelName::Breakpoints => LEAST_SIZE_OF_LISTS,
        _ => Vec2::ZERO,
    };
    let size = size.max(least);
    let side = |points: f32| (points * PIXELS_PER_POINT).clamp(64.0, LARGEST_SIDE_PX) as u32;
    let options = HeadlessOptions {
        size_px: [side(size.x), side(size.y)],
        pixels_per_point: PIXELS_PER_POINT,
        theme: ctx.theme.name,
    };
    let PanelContext { recording, cursor_ns, theme, .. } = *ctx;
    let mut selection = ctx.selection.clone();
    let images = &mut *ctx.images;
    let playback = Playback { playing: false, ..ctx.playback.clone() };
    let mut draw_ui = |ui: &mut Ui| {
        // Nobody is there to carry out what a panel may ask for.
        let commands = &mut Vec::new();
        let (images, selection, playback) = (&mut *images, &mut selection, &playback);
        let context = &mut PanelContext { recording, cursor_ns, playback, images, selection, theme, commands };
        alone_ui(panel, ui, &mut copy, context);
    };
    let picture = headless::draw(options, &mut draw_ui);
    let drawing = headless::svg_of(options, "clip", panel.as_str(), &mut draw_ui);
    let log = recording.log_path.file_stem().map_or_else(|| "log".into(), |stem| stem.to_string_lossy().into_owned());
    let name = format!("{log}/{}-{:.3}s", panel.as_str(), seconds_from_ns(cursor_ns));
    PanelExport { name, picture, drawing, table: copy.panels.csv_table(panel, ctx) }
}

/// The numbers behind what a panel shows, comma separated.
pub fn panel_table(panel: PanelName, state: &mut WindowState, ctx: &mut PanelContext<'_>) -> String {
    slide::update(ctx);
    state.panels.csv_table(panel, ctx)
}

/// Draws a panel into all of `ui`.
pub fn alone_ui(panel: PanelName, ui: &mut Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>) {
    let frame = Frame::new().fill(ctx.theme.surface).inner_margin(PANEL_MARGIN);
    slide::update(ctx);
    CentralPanel::no_frame().frame(frame).show(ui, |ui| state.panels.ui(panel, ui, ctx));
}

/// Size of a panel that is not on the screen, in points.
pub(super) const HIDDEN_PANEL_SIZE: Vec2 = Vec2::new(960.0, 540.0);
