//! Painting of egui's frames without a window into pixels, SVG or PDF: on the CPU with identical bytes on every machine,
//! or on a graphics adapter.

pub mod chunks;
pub mod headless;
pub(in crate::gui) mod image_copy;
mod mixing;
pub mod offscreen;
pub mod painter;
mod pdf;
pub mod scene_backend;
mod svg;
mod vector;
