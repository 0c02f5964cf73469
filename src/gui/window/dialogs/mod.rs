//! Modal dialogs, one of which is open at a time, and the windows of the diagnosis and of the sources beside them.

mod add_run;
mod diagnosis;
mod figure;
mod fork;
mod fuzzy;
mod markers;
mod modal;
mod open_log;
mod palette;
mod palette_items;
mod questions;
mod settings;
mod sources;
pub(super) mod state;

use egui::Ui;

pub(in crate::gui) use self::modal::{Modal, hide_covered_pointer, show_pointer};
use self::open_log::Picked;
use self::state::Dialogs;
use super::actions::Action;
use super::history::SettingsHistory;
use super::panel_tiles::PanelTiles;
use super::panels::Panels;
use super::request::WindowRequest;
use super::settings::Settings;
use crate::gui::{Dialog, PanelContext};

/// Parts of the window on which the dialogs act.
pub(super) struct DialogParts<'a> {
    pub(super) panels: &'a Panels,
    pub(super) tiles: &'a PanelTiles,
    pub(super) settings: &'a mut Settings,
    pub(super) history: &'a mut SettingsHistory,
    pub(super) requests: &'a mut Vec<WindowRequest>,
    pub(super) actions: &'a mut Vec<Action>,
}

/// Draws the dialog that is open.
pub(super) fn ui(ui: &Ui, dialogs: &mut Dialogs, ctx: &mut PanelContext<'_>, parts: DialogParts<'_>) {
    let DialogParts { panels, tiles, settings, history, requests, actions } = parts;
    let picked = dialogs.open_log.picked(ui);
    if picked.is_some() && dialogs.open == Some(Dialog::OpenLog) {
        dialogs.open = None;
    }
    if let Some(Picked::Paths(paths)) = picked {
        requests.push(WindowRequest::OpenLog(paths));
    }
    dialogs.diagnosis_open = dialogs.diagnosis_open && diagnosis::ui(ui, ctx);
    dialogs.sources_open = dialogs.sources_open && sources::ui(ui, ctx);
    let stays_open = match dialogs.open {
        None | Some(Dialog::Diagnosis | Dialog::Sources) => return,
        Some(Dialog::OpenLog) => {
            let (path, stays_open) = dialogs.open_log.ui(ui, ctx.theme);
            requests.extend(path.map(|path| WindowRequest::OpenLog(vec![path])));
            stays_open
        }
        Some(Dialog::AddRun) => dialogs.add_run.ui(ui, ctx),
        Some(Dialog::Fork) => dialogs.fork.ui(ui, ctx),
        Some(Dialog::Markers) => dialogs.markers.ui(ui, ctx),
        Some(Dialog::Figure) => dialogs.figure.ui(ui, ctx, panels, requests),
        Some(Dialog::Palette) => dialogs.palette.ui(ui, ctx, tiles, actions),
        Some(Dialog::Settings) => settings::ui(ui, ctx.theme, settings, history, tiles.saved.names(), actions),
        Some(Dialog::RemoveRun) => questions::remove_run_ui(ui, ctx, dialogs.removed_run, history),
        Some(Dialog::Unsaved) => questions::unsaved_ui(ui, ctx, &dialogs.unsaved, requests),
    };
    if !stays_open {
        dialogs.open = None;
    }
}
