//! Section of the context menu about a panel and the value under the pointer.

use egui::Ui;

use super::widgets::{entry_ui, heading_ui};
use crate::gui::window::actions::Action;
use crate::gui::window::copying::{copy_table, copy_value};
use crate::gui::window::state::MainWindow;
use crate::gui::{PanelContext, PanelName};

/// Draws the section of a panel; `value` is the one under the pointer.
pub(super) fn ui(
    ui: &mut Ui,
    state: &mut MainWindow,
    ctx: &PanelContext<'_>,
    panel: PanelName,
    value: Option<&str>,
    actions: &mut Vec<Action>,
) {
    heading_ui(ui, ctx.theme, panel.title());
    if let Some(value) = value
        && entry_ui(ui, "Copy value", true, Some(Action::Copy))
    {
        copy_value(value.to_owned(), state);
    }
    if entry_ui(ui, "Copy table (CSV)", true, None) {
        copy_table(panel, state, ctx);
    }
    if entry_ui(ui, "Export the panel (PNG, SVG, CSV)", true, Some(Action::Export)) {
        state.focus = Some(panel);
        actions.push(Action::Export);
    }
    if panel != PanelName::Timeline {
        let maximized = state.layout.maximized() == Some(panel);
        let text = if maximized { "Restore all panels" } else { "Maximize the panel" };
        if entry_ui(ui, text, true, Some(Action::Maximize)) {
            state.layout.toggle_maximized(panel);
        }
        if entry_ui(ui, "Close the panel", true, None) {
            actions.push(Action::Hide(panel));
        }
    }
    if entry_ui(ui, "What is this?", true, Some(Action::Explain)) {
        state.help.ask(panel);
    }
}
