//! A CPU rasterizer for egui's meshes, so that screenshots need no driver and have the same bytes on every machine.
//!
//! It follows egui's shader: colours are premultiplied and blended in gamma space, textures are filtered between texel
//! centres, and clip rectangles are rounded to whole pixels.
//! Vertices are snapped to 1/256 pixel and edges follow the top-left rule in integers, so that triangles with a common
//! edge leave no gap and paint no pixel twice.
//! Paint callbacks are not drawn: on the CPU the scene is a texture.

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

/// Paints egui's meshes. It keeps their textures and the last image, of which only changed tiles are painted again.
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

    /// Stores new and changed textures. Call it before [`Painter::paint`] with each output of egui, and
    /// [`Painter::free_textures`] after it.
    pub fn set_textures(&mut self, delta: &TexturesDelta) {
        self.textures.set(delta);
    }

    /// Drops the textures that the output frees.
    pub fn free_textures(&mut self, delta: &TexturesDelta) {
        self.textures.free(delta);
    }

    /// Paints primitives, whose positions are in points, over an opaque background.
    ///
    /// Primitives with an unknown texture are skipped, as are triangles with positions that are not finite. Tiles that
    /// did not change since the last image are not painted again.
    pub fn paint(
        &mut self,
        primitives: &[ClippedPrimitive],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> RgbaImage {
        self.update(primitives, size_px, pixels_per_point, background);
        self.canvas.image()
    }

    /// Paints as [`Painter::paint`] does without copying the image.
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

    /// The last image as colours.
    pub(in crate::gui) fn whole(&self) -> ColorImage {
        self.canvas.part(PixelRect { at: [0; 2], size: self.canvas.size_px() })
    }

    /// The rectangles of the image that changed in the last update, as colours.
    pub(in crate::gui) fn changes(&self) -> impl Iterator<Item = (PixelRect, ColorImage)> {
        self.canvas.changed().into_iter().map(|rect| (rect, self.canvas.part(rect)))
    }
}
