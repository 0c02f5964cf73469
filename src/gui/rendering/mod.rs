//! From a frame of egui to pixels or SVG without a window: on the CPU with the same bytes everywhere, or on a graphics adapter.

pub mod headless;
pub mod offscreen;
pub mod painter;
mod svg;
