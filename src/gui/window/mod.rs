//! Content of the window: bars, panels, timeline, dialogs.
//!
//! The real window and headless screenshots both draw [`window_ui`].

mod actions;
mod answer_bar;
mod context_menu;
mod copying;
#[cfg(test)]
mod dialog_tests;
mod dialogs;
mod figure;
#[cfg(test)]
mod figure_tests;
#[cfg(test)]
mod fit_tests;
mod focus_ring;
mod guidance;
mod history;
#[cfg(test)]
mod keyboard_tests;
mod legend;
mod menu;
mod notices;
mod panel_export;
mod panel_tiles;
mod panels;
pub(in crate::gui) mod path_field;
mod perform;
#[cfg(test)]
mod pointer_tests;
mod presets;
mod progress;
#[cfg(test)]
mod reading_tests;
mod request;
mod saved_layouts;
mod settings;
mod shortcuts;
mod state;
mod status_bar;
#[cfg(test)]
mod tests;
mod tiles;
mod timeline_height;
mod top_bar;
mod tour;

use std::sync::Arc;

use egui::{CentralPanel, Frame, Margin, Rect, Ui, UiBuilder, vec2};

use self::actions::Action;
use self::context_menu::MenuParts;
use self::dialogs::DialogParts;
pub use self::dialogs::state::Dialogs;
pub(in crate::gui) use self::dialogs::{Modal, hide_covered_pointer, show_pointer};
pub(crate) use self::figure::complete;
pub use self::figure::{
    FIGURE_FONT_PT, FIGURE_SIDE_MM, FigureContent, FigureFormat, FigureInput, FigureSpec, FigureText, alone_ui,
    figure_height,
};
pub use self::legend::RunLegend;
pub use self::notices::{NoticeLevel, Notices};
pub use self::panel_export::panel_table;
pub use self::panel_tiles::PanelTiles;
pub use self::panels::Panels;
use self::perform::perform;
pub use self::progress::{Progress, ProgressMeter};
pub use self::request::WindowRequest;
pub use self::saved_layouts::SavedLayouts;
pub(in crate::gui) use self::settings::first_scale;
pub use self::settings::{SCALES, Settings};
pub use self::state::MainWindow;
pub use self::status_bar::AppStatus;
pub use self::tiles::Preset;
use self::tiles::TabClicks;
use self::timeline_height::TimelineHeight;
use super::help;
use super::plot::plot_under_pointer;
use super::{Panel as _, PanelContext, PanelName};

/// Draws the window for a session.
pub fn window_ui(ui: &mut Ui, state: &mut MainWindow, ctx: &mut PanelContext<'_>) {
    let theme = *ctx.theme;
    ctx.move_chain();
    read_pointer(ui, state, ctx);
    if !state.dialogs.is_open() {
        tour::keys(ui, &mut state.tour);
    }
    // Shortcuts have no effect while a dialog is open.
    let mut actions: Vec<Action> = if state.dialogs.is_open() { Vec::new() } else { actions::pressed(ui) };
    // A dialog receives the keys after the one that opens it, even in the same frame.
    if let Some(opening) = actions.iter().copied().find(|action| matches!(action, Action::Dialog(_))) {
        actions.clear();
        perform(ui, opening, state, ctx);
    }
    state.panels.inspector.show_times = state.status.show_times;

    let bar = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 3));
    egui::Panel::top("top bar").exact_size(30.0).frame(bar).show(ui, |ui| top_bar::ui(ui, state, ctx, &mut actions));
    egui::Panel::top("answer")
        .exact_size(answer_bar::HEIGHT)
        .frame(bar)
        .show(ui, |ui| answer_bar::ui(ui, ctx, &mut actions));
    if ctx.recording.is_being_written
        && let Some(run) = ctx.selected_run()
        && let Some(needed) = ctx.motion(ui, run)
    {
        egui::Panel::top("guidance")
            .exact_size(guidance::HEIGHT)
            .frame(bar)
            .show(ui, |ui| guidance::ui(ui, ctx, run, &needed));
    }
    notices::banner_ui(ui, ctx);
    if let Some(panel) = ctx.selection.wanted_panel.take() {
        state.tiles.show(panel);
    }

    // The panels are drawn before the timeline below them, because the Tab key follows the order of drawing.
    let height = TimelineHeight::of(ui, state, ctx);
    let below = state.tiles.below_height.unwrap_or(height.wanted + status_bar::HEIGHT);
    let rest = ui.available_rect_before_wrap();
    let above = rest.with_max_y((rest.bottom() - below).max(rest.top()));
    let mut clicks = TabClicks::default();
    state.tiles.places.clear();
    let ground = Frame::new().fill(theme.background).inner_margin(Margin::same(3));
    let mut panels_ui = ui.new_child(UiBuilder::new().max_rect(above));
    CentralPanel::no_frame().frame(ground).show(&mut panels_ui, |ui| {
        let PanelTiles { layout, focus, places, .. } = &mut state.tiles;
        clicks = layout.ui(ui, &mut state.panels, ctx, *focus, places);
    });

    // The status bar is laid out first, because it is the lowest.
    let status = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(8, 2));
    let status = egui::Panel::bottom("status bar").exact_size(status_bar::HEIGHT).frame(status);
    let status = status.show(ui, |ui| ui.max_rect());
    let frame = Frame::new().fill(theme.surface).inner_margin(Margin::symmetric(6, 4));
    let timeline = height.panel().frame(frame).show(ui, |ui| {
        let corner = ui.max_rect().right_top() + vec2(-24.0, 2.0);
        state.panels.timeline.ui(ui, ctx);
        let place = UiBuilder::new().max_rect(Rect::from_min_size(corner, vec2(20.0, 18.0)));
        let pressed = ui.scope_builder(place, |ui| help::button_ui(ui, &theme, PanelName::Timeline)).inner;
        clicks.asked = pressed.then_some(PanelName::Timeline).or(clicks.asked);
    });
    height.follow(&mut state.tiles.timeline_ratios, timeline.response.rect.height());
    state.tiles.places.push((PanelName::Timeline, timeline.response.rect));
    ui.scope_builder(UiBuilder::new().max_rect(status.inner), |ui| {
        status_bar::ui(ui, &state.status, ctx, &mut state.notices, &mut state.requests);
    });
    let below = rest.bottom() - timeline.response.rect.top();
    if state.tiles.below_height.replace(below).is_none_or(|known| known != below) {
        ui.request_repaint();
    }
    state.tiles.follow_focus(ui);
    state.tiles.focus = clicks.focused.or(state.tiles.focus);
    if let Some(panel) = clicks.asked {
        state.help.toggle(ui.ctx(), panel);
    }
    actions.extend(state.panels.comparison.asked.take().map(Action::Dialog));
    state.requests.extend(state.panels.laboratory.take_request().map(WindowRequest::Motion));
    above_panels_ui(ui, state, ctx, &clicks, &mut actions);
    for action in actions {
        perform(ui, action, state, ctx);
    }
    let settled = !ui.input(|input| input.pointer.any_down());
    if state.history.follow(&state.settings, &state.tiles.layout, &ctx.playback.markers, settled) {
        ui.request_repaint();
    }
}

/// Draws what lies above the panels: dialogs, messages, tour, help and menus.
fn above_panels_ui(
    ui: &Ui,
    state: &mut MainWindow,
    ctx: &mut PanelContext<'_>,
    clicks: &TabClicks,
    actions: &mut Vec<Action>,
) {
    let theme = *ctx.theme;
    let MainWindow { panels, tiles, settings, history, requests, dialogs, .. } = &mut *state;
    dialogs::ui(ui, dialogs, ctx, DialogParts { panels, tiles, settings, history, requests, actions });
    shortcuts::ui(ui, &theme, &mut state.dialogs.shortcuts_open);
    state.notices.list_ui(ui, ctx);
    tour::ui(ui, &mut state.tour, &mut state.tiles, &state.panels.rank, ctx);
    state.help.ui(ui, &theme, &state.tiles.places);
    state.ring.ui(ui, &theme);
    let MainWindow { tiles, notices, dialogs, help, menu, .. } = &mut *state;
    context_menu::ui(ui, menu, ctx, clicks.menu, MenuParts { tiles, notices, dialogs, help, actions });
}

/// Finds the plot under the pointer before the panels are drawn, and sets what all plots show.
fn read_pointer(ui: &Ui, state: &mut MainWindow, ctx: &mut PanelContext<'_>) {
    let reading = &mut ctx.selection.reading;
    reading.pointer_ns = plot_under_pointer(ui).map(|(_, stamp_ns)| stamp_ns);
    reading.events =
        if state.settings.event_lines { state.event_lines.read(&ctx.recording.runs) } else { Arc::default() };
}
