//! A rasterizer on the CPU for what egui tessellates, so that pictures need no driver and have the same bytes everywhere.
//!
//! It does what egui's shader does: colours are premultiplied and blended in gamma space, textures are filtered between
//! texel centres, and clip rectangles are rounded to whole pixels.
//! Vertices are snapped to 1/256 pixel and edges follow the top-left rule in whole numbers, so that triangles that share
//! an edge leave no gap and paint no pixel twice.
//! Paint callbacks are not drawn: on the CPU the scene comes as a texture.

pub(in crate::gui) mod blend;
mod canvas;
mod raster;
#[cfg(test)]
mod tests;
mod texture;
pub(in crate::gui) mod triangle;

use egui::epaint::{ClippedPrimitive, Primitive};
use egui::{Color32, ColorImage, TexturesDelta};
use image::RgbaImage;
use rayon::prelude::*;

use self::canvas::{Canvas, PixelRect};
use self::raster::PreparedMesh;
use self::texture::TextureStore;

/// Paints egui's meshes; it keeps their textures and the last picture, of which only what changes is painted again.
#[derive(Default)]
pub struct Painter {
    textures: TextureStore,
    canvas: Canvas,
}

impl Painter {
    /// A painter without textures.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes over new and changed textures; call it before [`Painter::paint`] with each output of egui, then
    /// [`Painter::free_textures`] after it.
    pub fn set_textures(&mut self, delta: &TexturesDelta) {
        self.textures.set(delta);
    }

    /// Forgets the textures that the output frees.
    pub fn free_textures(&mut self, delta: &TexturesDelta) {
        self.textures.free(delta);
    }

    /// Paints primitives, whose positions are in points, over an opaque ground.
    ///
    /// Primitives with an unknown texture are left out, as are triangles with positions that are not finite. What is the same
    /// as in the picture before is not painted again.
    pub fn paint(
        &mut self,
        primitives: &[ClippedPrimitive],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> RgbaImage {
        self.update(primitives, size_px, pixels_per_point, background);
        self.canvas.picture()
    }

    /// Paints as [`Painter::paint`] does and leaves the picture where it is.
    pub fn update(
        &mut self,
        primitives: &[ClippedPrimitive],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) {
        let ground = Color32::from_rgb(background.r(), background.g(), background.b());
        let meshes: Vec<PreparedMesh<'_>> = primitives
            .par_iter()
            .filter_map(|clipped| match &clipped.primitive {
                Primitive::Mesh(mesh) => {
                    let texture = self.textures.get(mesh.texture_id)?;
                    PreparedMesh::new(mesh, texture, clipped.clip_rect, pixels_per_point, size_px)
                }
                Primitive::Callback(_) => None,
            })
            .collect();
        self.canvas.update(&meshes, size_px.map(|side| side as usize), blend::pack(ground.to_array()));
    }

    /// The last picture, as colours.
    pub(in crate::gui) fn whole(&self) -> ColorImage {
        self.canvas.part(PixelRect { at: [0; 2], size: self.canvas.size_px() })
    }

    /// The parts of the picture that differ from the one before it, as colours.
    pub(in crate::gui) fn changes(&self) -> impl Iterator<Item = (PixelRect, ColorImage)> {
        self.canvas.changed().into_iter().map(|rect| (rect, self.canvas.part(rect)))
    }
}
