//! egui's shapes of one frame as elements of a drawing, from which SVG and PDF files are written.
//!
//! Every shape becomes an element before tessellation, so that lines stay lines and texts stay texts.

mod element;
mod mesh;
mod shapes;
mod text;
mod textures;

use egui::{Color32, Vec2};

pub(super) use self::element::{Element, FilledArea, Letter, TextRun};
#[cfg(test)]
pub(super) use self::mesh::quad;
pub(super) use self::shapes::elements;
pub(super) use self::textures::{TextureImage, Textures};

/// The elements of a frame with what a file needs beside them.
#[derive(Clone, Debug)]
pub(super) struct Drawing {
    pub(super) elements: Vec<Element>,
    pub(super) textures: Textures,
    /// Width and height in points of egui.
    pub(super) size: Vec2,
    pub(super) background: Color32,
    pub(super) title: String,
    /// Description of the content, not shown by viewers; may be empty.
    pub(super) description: String,
}
