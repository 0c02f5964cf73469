//! Undo and redo for settings, layout and markers.

use std::collections::VecDeque;

use super::settings::Settings;
use super::tiles::PanelLayout;
use crate::session::Markers;

/// Maximum number of changes that can be undone.
const MAX_CHANGES: usize = 100;

/// Settings, layout and markers at one time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Arrangement {
    pub(super) settings: Settings,
    pub(super) layout: PanelLayout,
    pub(super) markers: Markers,
}

/// Changes of settings, layout and markers, oldest first.
#[derive(Debug, Default)]
pub(super) struct SettingsHistory {
    before: VecDeque<Arrangement>,
    undone: Vec<Arrangement>,
    /// State after the last change in `before` and before the first one in `undone`.
    current: Option<Arrangement>,
    /// State after a change that is not yet recorded.
    pending: Option<Arrangement>,
    /// Message about an act after the last change that cannot be undone.
    barrier: Option<String>,
}

impl SettingsHistory {
    /// Records a change since the last call; returns true if another frame is needed for that.
    ///
    /// A change is recorded when it is complete: no button of the pointer is down (`settled`), and two calls get the
    /// same state, because the tree of panels is simplified in the frame after a drop. Another open tab alone is no
    /// change.
    pub(super) fn follow(
        &mut self,
        settings: &Settings,
        layout: &PanelLayout,
        markers: &Markers,
        settled: bool,
    ) -> bool {
        let now = || Arrangement { settings: settings.clone(), layout: layout.clone(), markers: markers.clone() };
        let Some(current) = &mut self.current else {
            self.current = Some(now());
            return false;
        };
        let same = current.settings == *settings && current.markers == *markers;
        if same && current.layout == *layout {
            self.pending = None;
        } else if same && current.layout.differs_by_open_tabs_only(layout) {
            *current = now();
            self.pending = None;
        } else if settled {
            let now = now();
            if self.pending.as_ref() != Some(&now) {
                self.pending = Some(now);
                return true;
            }
            self.record();
        }
        false
    }

    /// Records the pending change.
    fn record(&mut self) {
        let Some(now) = self.pending.take() else { return };
        self.before.extend(self.current.replace(now));
        self.undone.clear();
        self.barrier = None;
        if self.before.len() > MAX_CHANGES {
            self.before.pop_front();
        }
    }

    /// Lets the next undo report that the last act cannot be undone, instead of undoing an older change.
    pub(super) fn set_barrier(&mut self, message: String) {
        self.record();
        self.barrier = Some(message);
    }

    /// Replaces the markers of all changes by the markers of a session that is opened.
    pub(super) fn begin_session(&mut self, markers: &Markers) {
        let known = self.before.iter_mut().chain(&mut self.undone).chain(&mut self.current).chain(&mut self.pending);
        for arrangement in known {
            arrangement.markers = markers.clone();
        }
    }

    pub(super) fn take_barrier(&mut self) -> Option<String> {
        self.barrier.take()
    }

    pub(super) fn can_undo(&self) -> bool {
        !self.before.is_empty()
    }

    pub(super) fn can_redo(&self) -> bool {
        !self.undone.is_empty()
    }

    /// Undoes one change and returns the state before it.
    pub(super) fn undo(&mut self) -> Option<Arrangement> {
        self.record();
        let before = self.before.pop_back()?;
        self.undone.extend(self.current.replace(before.clone()));
        Some(before)
    }

    /// Redoes one change and returns the state after it.
    pub(super) fn redo(&mut self) -> Option<Arrangement> {
        self.record();
        let after = self.undone.pop()?;
        self.before.extend(self.current.replace(after.clone()));
        Some(after)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tiles::Preset;
    use super::*;
    use crate::gui::PanelName;
    use crate::gui::theme::ThemeName;

    /// Two frames after a change.
    fn complete(history: &mut SettingsHistory, settings: &Settings, layout: &PanelLayout) {
        history.follow(settings, layout, &Markers::default(), true);
        assert!(!history.follow(settings, layout, &Markers::default(), true));
    }

    #[test]
    fn changes_are_undone_and_redone_in_order() {
        let (mut settings, mut layout) = (Settings::default(), PanelLayout::default());
        let mut history = SettingsHistory::default();
        complete(&mut history, &settings, &layout);
        assert!(!history.can_undo() && history.undo().is_none());
        layout.arrange(Preset::Scene);
        complete(&mut history, &settings, &layout);
        for scale in [1.1, 1.2, 1.3] {
            settings.scale = scale;
            history.follow(&settings, &layout, &Markers::default(), false);
        }
        complete(&mut history, &settings, &layout);
        layout.set_visible(PanelName::Rank, false);
        complete(&mut history, &settings, &layout);

        let shown = |step: Option<Arrangement>| {
            step.map(|step| (step.layout.preset, step.settings.scale, step.layout.is_visible(PanelName::Rank)))
        };
        assert_eq!(shown(history.undo()), Some((Some(Preset::Scene), 1.3, true)));
        assert_eq!(shown(history.undo()), Some((Some(Preset::Scene), 1.0, true)));
        assert_eq!(shown(history.undo()), Some((Some(Preset::Overview), 1.0, true)));
        assert_eq!(shown(history.undo()), None);
        assert_eq!(shown(history.redo()), Some((Some(Preset::Scene), 1.0, true)));
        assert_eq!(shown(history.redo()), Some((Some(Preset::Scene), 1.3, true)));
        // A new change replaces those that were undone.
        let Some(Arrangement { mut settings, layout, .. }) = history.current.clone() else { panic!() };
        settings.theme = ThemeName::Print;
        complete(&mut history, &settings, &layout);
        assert!(!history.can_redo());
        assert_eq!(history.undo().map(|step| step.settings.theme), Some(ThemeName::default()));
    }

    #[test]
    fn markers_are_undone_within_their_session() {
        let (settings, layout) = (Settings::default(), PanelLayout::default());
        let mut history = SettingsHistory::default();
        complete(&mut history, &settings, &layout);
        let one = Markers::default().toggled(5);
        let follow = |history: &mut SettingsHistory, markers: &Markers| {
            history.follow(&settings, &layout, markers, true) || history.follow(&settings, &layout, markers, true)
        };
        follow(&mut history, &one);
        history.follow(&settings, &layout, &one, true);
        // The session takes the markers over in the frame after the undo.
        assert_eq!(history.undo().map(|step| step.markers), Some(Markers::default()));
        assert!(history.follow(&settings, &layout, &one, true));
        assert!(!history.follow(&settings, &layout, &Markers::default(), true));
        assert_eq!(history.redo().map(|step| step.markers), Some(one));
        let other = Markers::default().toggled(8);
        history.begin_session(&other);
        assert_eq!(history.undo().map(|step| step.markers), Some(other));
    }

    #[test]
    fn an_act_without_undo_is_not_skipped() {
        let (mut settings, layout) = (Settings::default(), PanelLayout::default());
        let mut history = SettingsHistory::default();
        complete(&mut history, &settings, &layout);
        settings.scale = 2.0;
        complete(&mut history, &settings, &layout);
        history.set_barrier("removed".to_owned());
        assert_eq!(history.take_barrier().as_deref(), Some("removed"));
        assert_eq!(history.take_barrier(), None);
        // A change after the act is undone as usual.
        history.set_barrier("removed".to_owned());
        settings.scale = 3.0;
        complete(&mut history, &settings, &layout);
        assert_eq!(history.take_barrier(), None);
        assert_eq!(history.undo().map(|step| step.settings.scale), Some(2.0));
    }

    #[test]
    fn an_open_tab_is_no_change_and_the_number_of_changes_is_limited() {
        let (mut settings, mut layout) = (Settings::default(), PanelLayout::default());
        let mut history = SettingsHistory::default();
        complete(&mut history, &settings, &layout);
        layout.set_visible(PanelName::Residuals, true);
        complete(&mut history, &settings, &layout);
        assert!(!history.can_undo(), "the tab of the residuals is in front now, and nothing else changed");
        for memory_mib in 0..2 * MAX_CHANGES {
            settings.memory_mib = memory_mib;
            complete(&mut history, &settings, &layout);
        }
        assert_eq!(history.before.len(), MAX_CHANGES);
    }
}
