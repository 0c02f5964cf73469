//! Height of the timeline: by its lanes, or the part of the window to which it was dragged.

use egui::{Panel, Rangef, Ui};

use super::state::MainWindow;
use super::status_bar;
use crate::gui::PanelContext;

/// Smallest height of the timeline in points, and the smallest that it has by itself: legible lanes of one run.
const MIN_HEIGHT: f32 = 60.0;
const MIN_LANES_HEIGHT: f32 = 150.0;
/// Largest height as a ratio of the room.
const MOST: f32 = 0.8;
/// Largest height that it has by itself: with the rows of the parameters, of more than two runs, and else.
const MOST_OF_ROWS: f32 = 0.5;
const MOST_OF_MANY: f32 = 0.3;
const MOST_OF_LANES: f32 = 0.25;

/// Height of the timeline in a frame.
pub(super) struct TimelineHeight {
    /// True if the rows of the parameters are open.
    open: bool,
    /// Height in points of the room of panels and timeline.
    room: f32,
    /// Height in points that the timeline gets.
    pub(super) wanted: f32,
    /// True while a button of the pointer is down.
    pressed: bool,
}

impl TimelineHeight {
    pub(super) fn of(ui: &Ui, state: &MainWindow, ctx: &PanelContext<'_>) -> Self {
        let open = state.panels.timeline.has_open_parameters();
        let many = ctx.recording.runs.len() + ctx.recording.trajectories.len() > 2;
        let most = match (open, many) {
            (true, _) => MOST_OF_ROWS,
            (false, true) => MOST_OF_MANY,
            (false, false) => MOST_OF_LANES,
        };
        let room = (ui.available_height() - status_bar::HEIGHT).max(MIN_HEIGHT);
        let by_hand = state.tiles.timeline_ratios[usize::from(open)].map(|ratio| ratio * room);
        let of_lanes = state.panels.timeline.wanted_height(ui, ctx);
        let wanted = by_hand.unwrap_or_else(|| of_lanes.min((most * room).max(MIN_LANES_HEIGHT)));
        let wanted = wanted.min(MOST * room).max(MIN_HEIGHT).round();
        Self { open, room, wanted, pressed: ui.input(|input| input.pointer.any_down()) }
    }

    /// The panel of the timeline: its height is free only while its edge may be dragged.
    pub(super) fn panel(&self) -> Panel {
        let range = Rangef::new(MIN_HEIGHT, (MOST * self.room).max(MIN_HEIGHT));
        let range = if self.pressed { range } else { Rangef::point(self.wanted) };
        let name = if self.open { "timeline with parameters" } else { "timeline" };
        Panel::bottom(name).resizable(true).default_size(self.wanted).size_range(range)
    }

    /// Keeps the height to which it was dragged.
    pub(super) fn follow(&self, ratios: &mut [Option<f32>; 2], height: f32) {
        if self.pressed && (height - self.wanted).abs() > 1.0 {
            ratios[usize::from(self.open)] = Some(height / self.room);
        }
    }
}
