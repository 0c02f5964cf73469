//! Figures of the commands that analyse a recording without a window.

mod allan;
mod history;
mod stills;

pub use self::allan::allan_ui;
pub use self::history::{HistoryFigure, HistoryPlot, history_ui};
pub use self::stills::stills_ui;
