//! Modal dialogs; one is open at a time.

mod add_run;
mod fork;
mod fuzzy;
mod modal;
mod open_log;
mod palette;
mod palette_items;
mod settings;
mod unsaved;

use std::sync::Arc;

use egui::Ui;

use self::add_run::AddRunDialog;
use self::fork::ForkDialog;
use self::open_log::{OpenLogDialog, Picked};
use self::palette::CommandPalette;
use super::actions::Action;
use super::{WindowRequest, WindowState};
use crate::gui::PanelContext;
use crate::gui::desktop::Desktop;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialog {
    /// Opens a log or a saved session.
    OpenLog,
    /// Adds a run on the same log.
    AddRun,
    /// Forks the selected run at the cursor.
    Fork,
    Palette,
    Settings,
    /// Question asked before unsaved work is discarded.
    Unsaved,
}

/// State of all dialogs, open or not.
#[derive(Default)]
pub struct Dialogs {
    open: Option<Dialog>,
    open_log: OpenLogDialog,
    add_run: AddRunDialog,
    fork: ForkDialog,
    palette: CommandPalette,
    /// Unsaved work as text.
    unsaved: String,
}

impl Dialogs {
    /// Gives the dialogs access to the machine, for completing paths.
    pub fn set_desktop(&mut self, desktop: Arc<dyn Desktop>) {
        self.open_log = OpenLogDialog::new(desktop);
    }

    /// Opens a dialog and closes the open one; the palette opens with an empty input.
    pub fn show(&mut self, dialog: Dialog) {
        match dialog {
            Dialog::OpenLog => self.open_log.show_picker(),
            Dialog::Palette => self.palette = CommandPalette::default(),
            _ => {}
        }
        self.open = Some(dialog);
    }

    /// Asks whether to save the session before leaving it; `lost` is the unsaved work as text.
    pub fn ask_to_save(&mut self, lost: String) {
        self.unsaved = lost;
        self.open = Some(Dialog::Unsaved);
    }

    /// True if a dialog is open.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Closes the open dialog.
    pub fn close(&mut self) {
        self.open = None;
    }
}

/// Draws the open dialog.
pub(super) fn ui(ui: &Ui, state: &mut WindowState, ctx: &mut PanelContext<'_>, actions: &mut Vec<Action>) {
    let WindowState { dialogs, requests, saved_layouts, settings, layout, history, .. } = state;
    let picked = dialogs.open_log.picked(ui);
    if picked.is_some() && dialogs.open == Some(Dialog::OpenLog) {
        dialogs.open = None;
    }
    if let Some(Picked::Path(path)) = picked {
        requests.push(WindowRequest::OpenLog(path));
    }
    let stays_open = match dialogs.open {
        None => return,
        Some(Dialog::OpenLog) => {
            let (path, stays_open) = dialogs.open_log.ui(ui, ctx.theme);
            requests.extend(path.map(WindowRequest::OpenLog));
            stays_open
        }
        Some(Dialog::AddRun) => dialogs.add_run.ui(ui, ctx),
        Some(Dialog::Fork) => dialogs.fork.ui(ui, ctx),
        Some(Dialog::Palette) => dialogs.palette.ui(ui, ctx, saved_layouts, layout, actions),
        Some(Dialog::Settings) => settings::ui(ui, ctx.theme, settings, history, saved_layouts.names(), actions),
        Some(Dialog::Unsaved) => unsaved::ui(ui, ctx, &dialogs.unsaved, requests),
    };
    if !stays_open {
        dialogs.open = None;
    }
}
