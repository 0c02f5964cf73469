use std::convert::Infallible;
use std::sync::Arc;

use egui::{Color32, TexturesDelta};
use image::RgbaImage;

use super::chunks::Chunk;
use super::painter::Painter;

/// Paints frames into pixels.
pub trait FramePainter {
    type Error;

    /// Stores new and changed textures; called for every frame before it is painted.
    fn set_textures(&mut self, delta: &TexturesDelta);

    /// Drops the textures that a frame frees; called for every frame after it is painted.
    fn free_textures(&mut self, delta: &TexturesDelta);

    /// Paints chunks, whose positions are in points, over an opaque background.
    fn paint(
        &mut self,
        chunks: &[Arc<Chunk>],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> Result<RgbaImage, Self::Error>;
}

impl FramePainter for Painter {
    type Error = Infallible;

    fn set_textures(&mut self, delta: &TexturesDelta) {
        Self::set_textures(self, delta);
    }

    fn free_textures(&mut self, delta: &TexturesDelta) {
        Self::free_textures(self, delta);
    }

    fn paint(
        &mut self,
        chunks: &[Arc<Chunk>],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> Result<RgbaImage, Infallible> {
        Ok(Self::paint(self, chunks, size_px, pixels_per_point, background))
    }
}
