//! Export of egui's shapes as SVG 1.1: sharp at any size, with searchable texts.
//!
//! Every shape becomes an element before tessellation; textures are embedded as PNG. Numbers have two decimals of a
//! point, so that the same shapes give the same bytes.

mod document;
mod element;
mod mesh;
mod symbols;
#[cfg(test)]
mod tests;
mod text;
mod textures;

pub(super) use document::document;
pub(super) use textures::Textures;
