//! Panels, the 3D scene and the window: they read a recording at a cursor and push commands.

pub mod allan;
pub mod app;
pub mod breakpoints;
pub mod calibration;
mod chain_values;
pub mod comparison;
pub mod convergence;
pub mod desktop;
mod determination;
mod events;
mod flight;
mod follow;
mod help;
pub mod image_panel;
pub mod inspector;
pub mod jacobian;
pub mod laboratory;
#[cfg(test)]
mod painted_texts;
mod pan_zoom;
mod panel;
#[cfg(test)]
mod panel_tests;
mod parameter_names;
mod path_field;
pub(crate) mod plot;
pub mod rank;
mod reading;
pub mod rendering;
pub mod residuals;
#[cfg(test)]
pub(crate) mod samples;
pub mod scene;
mod slide;
mod step_advice;
mod step_work;
pub mod stills_figure;
pub mod study;
#[cfg(test)]
pub(crate) mod tests;
pub mod theme;
pub mod timeline;
mod under_pointer;
mod units;
mod widgets;
pub mod window;

pub use panel::{CsvTable, Dialog, ImageSource, Panel, PanelContext, PanelName, Playback, Presentation, Selection};
pub use reading::{Reading, ReadingCursor};
