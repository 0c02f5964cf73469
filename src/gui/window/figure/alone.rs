//! One panel without the window around it.

use std::cell::RefCell;

use egui::{CentralPanel, Frame, Ui};

use crate::gui::rendering::{headless, headless::HeadlessOptions};
use crate::gui::theme::PANEL_MARGIN;
use crate::gui::window::panels::Panels;
use crate::gui::{PanelContext, PanelName};
use crate::text::Named as _;

/// Largest side of a figure in pixels that follows from its content.
const MAX_SIDE_PX: f32 = 8192.0;

/// Draws one panel into all of `ui`.
pub fn alone_ui(panel: PanelName, ui: &mut Ui, panels: &mut Panels, ctx: &mut PanelContext<'_>) {
    let frame = Frame::new().fill(ctx.theme.surface).inner_margin(PANEL_MARGIN);
    ctx.move_chain();
    CentralPanel::no_frame().frame(frame).show(ui, |ui| panels.get(panel).ui(ui, ctx));
}

/// Options with the size at which tables and plots of a figure that would scroll are shown completely.
pub(crate) fn complete(
    panel: PanelName,
    options: HeadlessOptions,
    panels: &RefCell<Panels>,
    ui: &mut dyn FnMut(&mut Ui),
) -> HeadlessOptions {
    if panel != PanelName::Comparison {
        return options;
    }
    headless::svg_of(options, "clip", panel.name(), ui);
    let wanted = panels.borrow().comparison.figure_size * options.pixels_per_point;
    panels.borrow_mut().drop_textures();
    let [width, height] = options.size_px;
    let side = |least: u32, wanted: f32| least.max(wanted.ceil().min(MAX_SIDE_PX) as u32);
    HeadlessOptions { size_px: [side(width, wanted.x), side(height, wanted.y)], ..options }
}
