//! Painting of egui's frames without a window into pixels, SVG or PDF: on the CPU with identical bytes on every machine,
//! or on a graphics adapter.
//!
//! Part of [`dcvins`](../dcvins/index.html), which re-exports it; the table of the folders is there.

pub mod chunks;
mod frame_painter;
mod mixing;
pub mod painter;
pub mod pdf;
pub mod svg;
pub mod vector;

pub use frame_painter::FramePainter;
