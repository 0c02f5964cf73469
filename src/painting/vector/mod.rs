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
pub use self::mesh::quad;
pub use self::shapes::elements;
pub use self::textures::{TextureImage, Textures};

/// The elements of a frame with what a file needs beside them.
#[derive(Clone, Debug)]
pub struct Drawing {
    pub elements: Vec<Element>,
    pub textures: Textures,
    /// Width and height in points of egui.
    pub size: Vec2,
    pub background: Color32,
    pub title: String,
    /// Description of the content, not shown by viewers; may be empty.
    pub description: String,
}
