//! The tour: six stops over the open recording, from the log to the suggested excitation.
//!
//! Each stop sets layout, cursor and shown run, and points at one panel; its texts take their numbers from the
//! recording.

mod card;
mod story;
#[cfg(test)]
mod tests;
mod texts;

use egui::{Key, Modifiers, Popup, Ui};

use self::card::{Pressed, card_ui};
use self::story::{CLASSICAL, Story};
use super::tiles::Preset;
use super::{PanelName, WindowState};
use crate::gui::PanelContext;
use crate::gui::theme::MAX_RUNS;
use crate::session::Command;

/// Frames before the card is drawn: the layout of a stop is shown from the second one on.
const FRAMES_TO_LAYOUT: u8 = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    Log,
    Image,
    Convergence,
    Which,
    Why,
    Remedy,
}

impl Stop {
    const ALL: [Self; 6] = [Self::Log, Self::Image, Self::Convergence, Self::Which, Self::Why, Self::Remedy];

    /// Layout of the stop, and the panel at which the card points.
    const fn place(self) -> (Preset, PanelName) {
        match self {
            Self::Log => (Preset::Overview, PanelName::Timeline),
            Self::Image => (Preset::Overview, PanelName::Image),
            Self::Convergence => (Preset::Calibration, PanelName::Convergence),
            Self::Which | Self::Why | Self::Remedy => (Preset::Calibration, PanelName::Rank),
        }
    }
}

/// State of the tour; it starts and ends only on request.
#[derive(Debug, Default)]
pub(crate) struct Tour {
    /// Index of the stop; `None` without a tour.
    stop: Option<usize>,
    /// Frames since the panels have been laid out for the stop; 0 before.
    frames: u8,
    /// True if cursor, run and selection have been set; setting them may have to wait for the estimator.
    arranged: bool,
    /// Run and stamp of the tour.
    story: Option<Story>,
    /// True if the run `classical` has been added.
    added: bool,
    /// True if that run is to be shown as soon as it has a step.
    awaited: bool,
}

impl Tour {
    /// Starts at the first stop.
    pub(crate) fn start(&mut self) {
        *self = Self { stop: Some(0), ..Self::default() };
    }

    pub(crate) fn end(&mut self) {
        *self = Self::default();
    }

    pub(crate) fn is_running(&self) -> bool {
        self.stop.is_some()
    }

    fn go(&mut self, stop: usize) {
        self.stop = (stop < Stop::ALL.len()).then_some(stop);
        (self.frames, self.arranged, self.awaited) = (0, false, false);
    }

    fn apply(&mut self, pressed: Pressed) {
        let Some(stop) = self.stop else { return };
        match pressed {
            Pressed::Next => self.go(stop + 1),
            Pressed::Back => self.go(stop.saturating_sub(1)),
            Pressed::End => self.end(),
        }
    }
}

/// Reads the keys of the tour before the window reads its keys: Enter for the next stop, Backspace for the previous
/// one.
pub(super) fn keys(ui: &Ui, state: &mut WindowState) {
    let busy = state.dialogs.is_open() || ui.egui_wants_keyboard_input() || Popup::is_any_open(ui.ctx());
    if !state.tour.is_running() || busy || ui.memory(|memory| memory.focused().is_some()) {
        return;
    }
    let pressed = ui.input_mut(|input| {
        let next = input.consume_key(Modifiers::NONE, Key::Enter).then_some(Pressed::Next);
        next.or_else(|| input.consume_key(Modifiers::NONE, Key::Backspace).then_some(Pressed::Back))
    });
    if let Some(pressed) = pressed {
        state.tour.apply(pressed);
    }
}

/// Arranges the window for the stop and draws its card.
pub(super) fn ui(ui: &Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>) {
    let mut tour = std::mem::take(&mut state.tour);
    tour.ui(ui, state, ctx);
    // No action of the tour starts another tour, so nothing is overwritten.
    state.tour = tour;
}

impl Tour {
    fn ui(&mut self, ui: &Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>) {
        let Some(index) = self.stop else { return };
        let stop = Stop::ALL[index];
        self.read_story(ctx);
        let Some(story) = self.story else { return };
        if self.frames == 0 {
            lay_out(stop, state);
        }
        if !self.arranged {
            self.arranged = self.arrange(stop, story, ctx);
        }
        if self.awaited
            && let Some(number) = story::classical(&ctx.recording.runs)
        {
            (ctx.selection.run, self.awaited) = (number, false);
        }
        if self.frames < FRAMES_TO_LAYOUT {
            self.frames += 1;
            ui.ctx().request_repaint();
            return;
        }
        let step = story.step(&ctx.recording.runs);
        let excitation = step.and_then(|step| state.panels.rank.suggested_excitation(story.run, step));
        let text = texts::of(stop, story, ctx, excitation.as_deref());
        let (_, panel) = stop.place();
        let place = state.places.iter().find(|(known, _)| *known == panel).map(|(_, place)| *place);
        if let Some(pressed) = card_ui(ui, ctx.theme, (index, Stop::ALL.len()), &text, place) {
            self.apply(pressed);
            ui.ctx().request_repaint();
        }
    }

    /// Chooses the run of the tour, and its stamp as soon as that step is computed.
    fn read_story(&mut self, ctx: &PanelContext<'_>) {
        let runs = &ctx.recording.runs;
        let known = self.story.filter(|story| runs.iter().any(|run| run.id == story.run));
        let first = || runs.get(ctx.selection.run).or_else(|| runs.first()).map(Story::new);
        self.story = known.or_else(first);
        if let Some(story) = &mut self.story {
            story.read(runs);
        }
    }

    /// Sets cursor, shown run and selection of a stop; returns true if all its inputs are computed.
    fn arrange(&mut self, stop: Stop, story: Story, ctx: &mut PanelContext<'_>) -> bool {
        let runs = &ctx.recording.runs;
        let number_of = |id: u64| runs.iter().position(|run| run.id == id);
        let own = number_of(story.run).unwrap_or(0);
        ctx.selection.run = own;
        ctx.selection.slide = None;
        if stop == Stop::Log {
            (ctx.selection.parameter, ctx.selection.feature) = (None, None);
            ctx.commands.push(Command::GoToStart);
            return true;
        }
        let Some(instant_ns) = story.instant_ns else { return false };
        ctx.commands.push(Command::Seek { stamp_ns: instant_ns });
        ctx.selection.parameter = match stop {
            Stop::Convergence => texts::least_reduced(&runs[own], instant_ns),
            Stop::Which | Stop::Remedy => texts::leading(&runs[own], instant_ns),
            Stop::Log | Stop::Image | Stop::Why => None,
        };
        let room = runs.len() < MAX_RUNS && !ctx.recording.rig.joint_names().is_empty();
        self.awaited = stop == Stop::Why;
        if self.awaited && !self.added && room && story::classical(runs).is_none() {
            ctx.commands.extend(CLASSICAL.parse().ok().map(Command::AddRun));
            self.added = true;
        }
        true
    }
}

/// Arranges the panels for a stop and focuses its panel.
fn lay_out(stop: Stop, state: &mut WindowState) {
    let (preset, panel) = stop.place();
    if state.layout.preset != Some(preset) {
        state.layout.arrange(preset);
    }
    if panel != PanelName::Timeline {
        state.layout.set_visible(panel, true);
    }
    state.focus = Some(panel);
}
