//! Figures of the commands that analyse a recording without a window.

mod allan;
mod stills;

pub use self::allan::allan_ui;
pub use self::stills::stills_ui;
