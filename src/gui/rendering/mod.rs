//! Frames of egui without a window, drawn by `painting` or on a graphics adapter, and what scene and window need of an
//! adapter.

pub mod headless;
pub(in crate::gui) mod image_copy;
pub mod offscreen;
pub mod scene_backend;
