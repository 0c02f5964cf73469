//! A rasterizer on the CPU for what egui tessellates, so that pictures need no driver and have the same bytes everywhere.
//!
//! It does what egui's shader does: colours are premultiplied and blended in gamma space, textures are filtered between
//! texel centres, and clip rectangles are rounded to whole pixels.
//! Vertices are snapped to 1/256 pixel and edges follow the top-left rule in whole numbers, so that triangles that share
//! an edge leave no gap and paint no pixel twice.
//! Paint callbacks are not drawn: on the CPU the scene comes as a texture.

pub(in crate::gui) mod blend;
pub(in crate::gui) mod raster;
#[cfg(test)]
mod tests;
mod texture;

use egui::epaint::{ClippedPrimitive, Primitive};
use egui::{Color32, TexturesDelta};
use image::RgbaImage;
use rayon::prelude::*;

use self::raster::{Band, PreparedMesh};
use self::texture::TextureStore;

/// Rows that one worker paints at a time.
const BAND_ROWS: usize = 32;

/// Paints egui's meshes and keeps their textures between pictures.
#[derive(Default)]
pub struct Painter {
    textures: TextureStore,
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
    /// Primitives with an unknown texture are left out, as are triangles with positions that are not finite.
    pub fn paint(
        &self,
        primitives: &[ClippedPrimitive],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> RgbaImage {
        let [width, height] = size_px.map(|side| side as usize);
        let ground = Color32::from_rgb(background.r(), background.g(), background.b());
        let mut pixels = vec![blend::pack(ground.to_array()); width * height];
        let meshes: Vec<PreparedMesh<'_>> = primitives
            .iter()
            .filter_map(|clipped| match &clipped.primitive {
                Primitive::Mesh(mesh) => {
                    let texture = self.textures.get(mesh.texture_id)?;
                    PreparedMesh::new(mesh, texture, clipped.clip_rect, pixels_per_point, size_px)
                }
                Primitive::Callback(_) => None,
            })
            .collect();
        if width > 0 {
            pixels.par_chunks_mut(width * BAND_ROWS).enumerate().for_each(|(number, rows)| {
                let mut band = Band::new(rows, width, (number * BAND_ROWS) as i32);
                for mesh in &meshes {
                    mesh.paint(&mut band);
                }
            });
        }
        let bytes = pixels.iter().flat_map(|pixel| blend::unpack(*pixel)).collect();
        RgbaImage::from_raw(size_px[0], size_px[1], bytes).expect("four bytes were written per pixel")
    }
}
