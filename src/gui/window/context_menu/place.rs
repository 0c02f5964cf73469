//! Place at which the context menu is open.

use egui::Pos2;

use crate::gui::PanelName;
use crate::gui::plot::PlotOnScreen;
use crate::gui::under_pointer::Item;

/// Position of the pointer when the menu was opened, with the things under it.
#[derive(Debug)]
pub(in crate::gui::window) struct MenuPlace {
    pub(super) at: Pos2,
    pub(super) panel: Option<PanelName>,
    pub(super) item: Option<Item>,
    pub(super) value: Option<String>,
    /// Plot over time, with the time there in nanoseconds since the log began.
    pub(super) plot: Option<(PlotOnScreen, i64)>,
}
