//! Panels, the 3D scene and the window: they read a recording at a cursor and push commands.

pub mod app;
pub mod breakpoints;
pub mod calibration;
mod cells;
pub mod comparison;
pub mod convergence;
mod derived;
pub mod desktop;
mod determination;
mod events;
pub mod figures;
mod findings;
mod help;
pub mod image_panel;
pub mod inspector;
pub mod jacobian;
pub mod laboratory;
#[cfg(test)]
mod painted_texts;
mod panel;
#[cfg(test)]
mod panel_tests;
mod parameter_names;
pub(crate) mod plot;
pub mod rank;
pub mod rendering;
pub mod residuals;
#[cfg(test)]
pub(crate) mod samples;
pub mod scene;
pub mod study;
mod table;
#[cfg(test)]
pub(crate) mod tests;
pub mod theme;
pub mod timeline;
mod under_pointer;
mod units;
mod widgets;
pub mod window;

pub use derived::reading::{Reading, ReadingCursor};
pub use panel::{
    CsvTable, Dialog, ImageSource, Panel, PanelContext, PanelName, Playback, Presentation, Selection, ShownCameras,
};
