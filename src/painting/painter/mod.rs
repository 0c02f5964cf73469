//! A CPU rasterizer for egui's meshes, so that screenshots need no driver and have the same bytes on every machine.
//!
//! It follows egui's shader: colours are premultiplied and blended in gamma space, textures are filtered between texel
//! centres, and clip rectangles are rounded to whole pixels. Vertices are snapped to 1/256 pixel and edges follow the
//! top-left rule in integers, so that triangles with a common edge leave no gap and paint no pixel twice. Paint
//! callbacks are not drawn: on the CPU the scene is a texture.

pub mod blend;
mod canvas;
mod prepared;
mod raster;
#[cfg(test)]
mod tests;
mod texture;
pub mod triangle;

use std::collections::HashMap;
use std::sync::Arc;

use egui::{Color32, ColorImage, TexturesDelta};
use image::RgbaImage;
use rayon::prelude::*;

use self::canvas::Canvas;
pub use self::canvas::PixelRect;
use self::prepared::PreparedChunk;
use self::texture::TextureStore;
use super::chunks::Chunk;

/// Paints egui's meshes. It keeps their textures, the chunks of the last image, and the last image, of which only
/// changed tiles are repainted.
#[derive(Default)]
pub struct Painter {
    textures: TextureStore,
    canvas: Canvas,
    /// Size and scale for which the chunks are prepared.
    format: ([u32; 2], f32),
    /// Chunks of the last image by address; they are kept, so that the addresses stay unique.
    prepared: HashMap<usize, Arc<PreparedChunk>>,
}

impl Painter {
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

    /// Paints chunks, whose positions are in points, over an opaque background.
    ///
    /// Primitives with an unknown texture are skipped, as are triangles with positions that are not finite. Tiles that
    /// did not change since the last image are not repainted.
    pub fn paint(
        &mut self,
        chunks: &[Arc<Chunk>],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> RgbaImage {
        self.update(chunks, size_px, pixels_per_point, background);
        self.canvas.image()
    }

    /// Like [`Painter::paint`], without copying the image.
    pub fn update(&mut self, chunks: &[Arc<Chunk>], size_px: [u32; 2], pixels_per_point: f32, background: Color32) {
        if self.format != (size_px, pixels_per_point) {
            self.format = (size_px, pixels_per_point);
            self.prepared.clear();
        }
        let prepared: Vec<Arc<PreparedChunk>> = chunks
            .par_iter()
            .map(|chunk| match self.prepared.get(&address(chunk)) {
                Some(prepared) if prepared.is_current(&self.textures) => Arc::clone(prepared),
                _ => Arc::new(PreparedChunk::new(chunk, &self.textures, size_px, pixels_per_point)),
            })
            .collect();
        self.prepared = chunks.iter().map(address).zip(prepared.iter().map(Arc::clone)).collect();
        let ground = Color32::from_rgb(background.r(), background.g(), background.b());
        let size_px = size_px.map(|side| side as usize);
        self.canvas.update(&prepared, &self.textures, size_px, blend::pack(ground.to_array()));
    }

    /// The last image as colours.
    pub fn whole(&self) -> ColorImage {
        self.canvas.part(PixelRect { at: [0; 2], size: self.canvas.size_px() })
    }

    /// The rectangles of the image that changed in the last update, as colours.
    pub fn changes(&self) -> impl Iterator<Item = (PixelRect, ColorImage)> {
        self.canvas.changed().into_iter().map(|rect| (rect, self.canvas.part(rect)))
    }
}

/// Address of a chunk, unique while the chunk is kept.
fn address(chunk: &Arc<Chunk>) -> usize {
    Arc::as_ptr(chunk).addr()
}
