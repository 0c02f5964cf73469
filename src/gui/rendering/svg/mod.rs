//! What egui paints, as a drawing of lines, areas and texts (SVG 1.1): sharp at any size, with texts that can be searched.
//!
//! Every shape becomes an element of its own kind before anything is tessellated; pictures are embedded as PNG.
//! Numbers are written with two decimals of a point, so that the same shapes give the same bytes.

mod document;
mod element;
mod mesh;
#[cfg(test)]
mod tests;
mod text;
mod textures;

pub(super) use document::document;
pub(super) use textures::Textures;
