//! State of the window without the session.

use super::context_menu::MenuPlace;
use super::dialogs::state::Dialogs;
use super::focus_ring::FocusRing;
use super::history::{Arrangement, SettingsHistory};
use super::legend::RunLegend;
use super::notices::Notices;
use super::panel_tiles::PanelTiles;
use super::panels::Panels;
use super::request::WindowRequest;
use super::settings::Settings;
use super::status_bar::AppStatus;
use super::tour::state::Tour;
use crate::gui::PanelContext;
use crate::gui::derived::reading::EventLines;
use crate::gui::help::Help;
use crate::session::{Command, Markers};

/// State of the window without the session.
#[derive(Default)]
pub struct MainWindow {
    pub panels: Panels,
    /// Arrangement of the panels.
    pub tiles: PanelTiles,
    /// The runs with their accuracy.
    pub legend: RunLegend,
    pub notices: Notices,
    pub dialogs: Dialogs,
    /// Requests to the application, which takes them after each frame.
    pub requests: Vec<WindowRequest>,
    /// User settings, applied by the application.
    pub settings: Settings,
    /// Set by the application before each frame.
    pub status: AppStatus,
    /// State of "What is this?" and the manual.
    pub(crate) help: Help,
    pub(in crate::gui) tour: Tour,
    pub(in crate::gui) ring: FocusRing,
    pub(super) history: SettingsHistory,
    /// The open context menu.
    pub(super) menu: Option<MenuPlace>,
    pub(super) event_lines: EventLines,
}

impl MainWindow {
    /// Closes all dialogs and lists when a session ends.
    pub(in crate::gui) fn close_everything(&mut self) {
        self.close_dialogs();
        self.tour.end();
        (self.status.progress, self.status.opening) = (None, None);
    }

    pub(super) fn close_dialogs(&mut self) {
        self.dialogs.close();
        self.notices.list_open = false;
        self.help.manual.close();
    }

    /// Starts the history of the markers of a session that is opened.
    pub(in crate::gui) fn begin_session(&mut self, markers: &Markers) {
        self.history.begin_session(markers);
    }

    /// Restores settings, layout and markers as before the last change.
    pub(super) fn undo(&mut self, ctx: &mut PanelContext<'_>) {
        if let Some(message) = self.history.take_barrier() {
            self.notices.inform(message);
            return;
        }
        let before = self.history.undo();
        self.restore(before, "Nothing to undo", ctx);
    }

    /// Restores settings, layout and markers as before the last undo.
    pub(super) fn redo(&mut self, ctx: &mut PanelContext<'_>) {
        let undone = self.history.redo();
        self.restore(undone, "Nothing to redo", ctx);
    }

    fn restore(&mut self, arrangement: Option<Arrangement>, none: &str, ctx: &mut PanelContext<'_>) {
        match arrangement {
            Some(Arrangement { settings, layout, markers }) => {
                (self.settings, self.tiles.layout) = (settings, layout);
                if markers != ctx.playback.markers {
                    ctx.commands.push(Command::SetMarkers(markers));
                }
            }
            None => self.notices.inform(none),
        }
    }
}
