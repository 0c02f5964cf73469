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
        let mut bytes = vec![0; width * height * 4];
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
            let bands = sort_into_bands(&meshes, height.div_ceil(BAND_ROWS));
            let rows = pixels.par_chunks_mut(width * BAND_ROWS).zip(bytes.par_chunks_mut(width * BAND_ROWS * 4));
            rows.zip(bands).enumerate().for_each(|(number, ((rows, bytes), pieces))| {
                let mut band = Band::new(rows, width, (number * BAND_ROWS) as i32);
                for Piece { mesh, triangle } in pieces {
                    meshes[mesh as usize].paint(triangle as usize, &mut band);
                }
                for (bytes, pixel) in bytes.chunks_exact_mut(4).zip(rows) {
                    bytes.copy_from_slice(&blend::unpack(*pixel));
                }
            });
        }
        RgbaImage::from_raw(size_px[0], size_px[1], bytes).expect("four bytes were written per pixel")
    }
}

/// A triangle of a mesh, by their numbers.
#[derive(Clone, Copy)]
struct Piece {
    mesh: u32,
    triangle: u32,
}

/// The triangles that touch each band, in the order in which they are painted.
fn sort_into_bands(meshes: &[PreparedMesh<'_>], bands: usize) -> Vec<Vec<Piece>> {
    let mut sorted = vec![Vec::new(); bands];
    for (mesh, prepared) in meshes.iter().enumerate() {
        for triangle in 0..prepared.triangles() {
            let rows = prepared.rows(triangle);
            if rows.is_empty() {
                continue;
            }
            let (first, last) = (rows.start as usize / BAND_ROWS, (rows.end as usize - 1) / BAND_ROWS);
            for band in &mut sorted[first..=last] {
                band.push(Piece { mesh: mesh as u32, triangle: triangle as u32 });
            }
        }
    }
    sorted
}
