//! The stops of the tour.

use crate::gui::PanelName;
use crate::gui::window::tiles::Preset;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    Log,
    Image,
    Convergence,
    Which,
    Why,
    Remedy,
}

impl Stop {
    pub(super) const ALL: [Self; 6] = [Self::Log, Self::Image, Self::Convergence, Self::Which, Self::Why, Self::Remedy];

    /// The layout, and the panel that the card points at.
    pub(super) const fn place(self) -> (Preset, PanelName) {
        match self {
            Self::Log => (Preset::Overview, PanelName::Timeline),
            Self::Image => (Preset::Overview, PanelName::Image),
            Self::Convergence => (Preset::Calibration, PanelName::Convergence),
            Self::Which | Self::Why | Self::Remedy => (Preset::Calibration, PanelName::Rank),
        }
    }
}
