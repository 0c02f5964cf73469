//! The tour: six stops over the open recording, from the log to the suggested excitation.
//!
//! Each stop sets layout, cursor and shown run, and points at one panel; its texts take their numbers from the
//! recording.

mod card;
pub(super) mod state;
mod story;
#[cfg(test)]
mod tests;
mod texts;

use egui::{Key, Modifiers, Popup, Ui};

use self::card::{Pressed, card_ui};
use self::state::Tour;
use self::story::Stop;
use super::panel_tiles::PanelTiles;
use crate::gui::PanelContext;
use crate::gui::rank::RankPanel;

/// Frames before the card is drawn: the layout of a stop is shown from the second one on.
const FRAMES_TO_LAYOUT: u8 = 2;

/// Reads the keys of the tour before the window reads its own: Enter for the next stop, Backspace for the one before.
pub(super) fn keys(ui: &Ui, tour: &mut Tour) {
    let busy = ui.egui_wants_keyboard_input() || Popup::is_any_open(ui.ctx());
    if !tour.is_running() || busy || ui.memory(|memory| memory.focused().is_some()) {
        return;
    }
    let pressed = ui.input_mut(|input| {
        let next = input.consume_key(Modifiers::NONE, Key::Enter).then_some(Pressed::Next);
        next.or_else(|| input.consume_key(Modifiers::NONE, Key::Backspace).then_some(Pressed::Back))
    });
    if let Some(pressed) = pressed {
        tour.apply(pressed);
    }
}

/// Arranges the window for the stop and draws its card.
pub(super) fn ui(ui: &Ui, tour: &mut Tour, tiles: &mut PanelTiles, rank: &RankPanel, ctx: &mut PanelContext<'_>) {
    let Some(index) = tour.stop else { return };
    let stop = Stop::ALL[index];
    tour.read_story(ctx);
    let Some(story) = tour.story else { return };
    if tour.frames == 0 {
        lay_out(stop, tiles);
    }
    if !tour.arranged {
        tour.arranged = tour.arrange(stop, story, ctx);
    }
    if tour.awaited
        && let Some(number) = story::classical(&ctx.recording.runs)
    {
        (ctx.selection.run, tour.awaited) = (number, false);
    }
    if tour.frames < FRAMES_TO_LAYOUT {
        tour.frames += 1;
        ui.ctx().request_repaint();
        return;
    }
    let step = story.step(&ctx.recording.runs);
    let excitation = step.and_then(|step| rank.suggested_excitation(story.run, step));
    let text = texts::of(stop, story, ctx, excitation.as_deref());
    let (_, panel) = stop.place();
    let card = (index, Stop::ALL.len());
    if let Some(pressed) = card_ui(ui, ctx.theme, card, &text, tiles.place_of(panel)) {
        tour.apply(pressed);
        ui.ctx().request_repaint();
    }
}

/// Arranges the panels for a stop and focuses its panel.
fn lay_out(stop: Stop, tiles: &mut PanelTiles) {
    let (preset, panel) = stop.place();
    if tiles.layout.preset != Some(preset) {
        tiles.arrange(preset);
    }
    tiles.show(panel);
}
