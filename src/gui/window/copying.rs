//! Copying values and tables to the clipboard.

use super::{NoticeLevel, PanelName, WindowState};
use crate::gui::PanelContext;
use crate::gui::units::counted;

/// Copies the value under the pointer, or else the table of the panel with the focus.
pub(super) fn copy(state: &mut WindowState, ctx: &PanelContext<'_>) {
    let (panel, _) = state.focused();
    copy_table(panel, state, ctx);
}

/// Copies the values of a panel as comma-separated values.
pub(super) fn copy_table(panel: PanelName, state: &mut WindowState, ctx: &PanelContext<'_>) {
    let table = state.panels.csv_table(panel, ctx);
    let rows = table.lines().count().saturating_sub(1);
    if rows == 0 {
        let text = format!("{}: no values to copy at the cursor", panel.title());
        state.notices.show_message(NoticeLevel::Info, text);
        return;
    }
    let text = format!("Copied the table of {}: {} (CSV)", panel.title(), counted(rows, "row"));
    state.notices.show_message(NoticeLevel::Info, text);
    state.copied = Some(table);
}
