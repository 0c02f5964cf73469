//! State of the tour: its stop, and the run and instant that it is about.

use super::card::Pressed;
use super::story::{self, CLASSICAL, Stop, Story};
use super::texts;
use crate::gui::PanelContext;
use crate::gui::theme::MAX_RUNS;
use crate::session::Command;

/// State of the tour; it starts and ends only on request.
#[derive(Debug, Default)]
pub(crate) struct Tour {
    /// Index of the stop, `None` while there is no tour.
    pub(super) stop: Option<usize>,
    /// Frames since the panels have been laid out for the stop; 0 before.
    pub(super) frames: u8,
    /// True once cursor, run and selection are set, which may have to wait for the estimator.
    pub(super) arranged: bool,
    /// Id of the run that the tour is about, and its instant.
    pub(super) story: Option<Story>,
    /// True if the run `classical` has been added.
    added: bool,
    /// True while that run waits to be shown until it has a step.
    pub(super) awaited: bool,
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

    pub(super) fn apply(&mut self, pressed: Pressed) {
        let Some(stop) = self.stop else { return };
        match pressed {
            Pressed::Next => self.go(stop + 1),
            Pressed::Back => self.go(stop.saturating_sub(1)),
            Pressed::End => self.end(),
        }
    }

    /// Chooses the run of the tour, and its instant as soon as that is computed.
    pub(super) fn read_story(&mut self, ctx: &PanelContext<'_>) {
        let runs = &ctx.recording.runs;
        let known = self.story.filter(|story| runs.iter().any(|run| run.id == story.run));
        let first = || runs.get(ctx.selection.run).or_else(|| runs.first()).map(Story::new);
        self.story = known.or_else(first);
        if let Some(story) = &mut self.story {
            story.read(runs);
        }
    }

    /// Sets cursor, shown run and selection of a stop; returns whether everything that it needs is computed.
    pub(super) fn arrange(&mut self, stop: Stop, story: Story, ctx: &mut PanelContext<'_>) -> bool {
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
