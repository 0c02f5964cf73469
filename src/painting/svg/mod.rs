//! Export of egui's shapes as SVG 1.1: sharp at any size, with searchable texts.
//!
//! Textures are embedded as PNG. Numbers have two decimals of a point, so that the same shapes give the same bytes.

mod attributes;
mod document;
mod text;

pub use document::document;
