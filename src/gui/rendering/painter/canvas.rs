//! The image in tiles that are painted again only when their content changes.

use egui::{Color32, ColorImage};
use image::RgbaImage;
use rayon::prelude::*;

use super::blend;
use super::raster::{PreparedMesh, Target, mixed};
use super::triangle::Clip;

/// Size of a tile in pixels: small enough that a moving cursor changes few tiles, and that a tile fits the cache.
pub(super) const TILE_PX: [usize; 2] = [64, 32];

/// Indices of a mesh and of a triangle in it.
#[derive(Clone, Copy)]
struct Piece {
    mesh: u32,
    triangle: u32,
}

/// A tile of the image.
#[derive(Default)]
struct Tile {
    /// Triangles that may touch it, in the order of painting.
    pieces: Vec<Piece>,
    /// Hash of its content, `None` before it is painted.
    mark: Option<u64>,
    /// Pixels by row, each row as wide as the tile.
    pixels: Vec<u32>,
    /// Whether it was painted in the last update.
    changed: bool,
}

/// A rectangle of the image in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gui) struct PixelRect {
    /// Column and row of its upper left pixel.
    pub(in crate::gui) at: [usize; 2],
    /// Width and height.
    pub(in crate::gui) size: [usize; 2],
}

/// The last image.
#[derive(Default)]
pub(super) struct Canvas {
    size_px: [usize; 2],
    ground: u32,
    tiles: Vec<Tile>,
}

impl Canvas {
    /// Number of tiles in a row.
    fn columns(&self) -> usize {
        self.size_px[0].div_ceil(TILE_PX[0])
    }

    fn clip_of(&self, number: usize) -> Clip {
        let PixelRect { at, size } = self.rect_of(number);
        let [left, top] = at.map(|at| at as i32);
        Clip { left, top, right: left + size[0] as i32, bottom: top + size[1] as i32 }
    }

    fn rect_of(&self, number: usize) -> PixelRect {
        let at = [number % self.columns() * TILE_PX[0], number / self.columns() * TILE_PX[1]];
        PixelRect { at, size: [0, 1].map(|axis| TILE_PX[axis].min(self.size_px[axis] - at[axis])) }
    }

    /// Updates the image; the result is the same as painting all of it again.
    pub(super) fn update(&mut self, meshes: &[PreparedMesh<'_>], size_px: [usize; 2], ground: u32) {
        if (self.size_px, self.ground) != (size_px, ground) {
            *self = Self { size_px, ground, tiles: Vec::new() };
            let count = if size_px[0] > 0 { self.columns() * size_px[1].div_ceil(TILE_PX[1]) } else { 0 };
            self.tiles.resize_with(count, Tile::default);
        }
        self.sort_in(meshes);
        let clips: Vec<Clip> = (0..self.tiles.len()).map(|number| self.clip_of(number)).collect();
        self.tiles.par_iter_mut().zip(clips).for_each(|(tile, clip)| tile.update(meshes, clip, ground));
    }

    /// Assigns each triangle to the tiles that it may touch.
    fn sort_in(&mut self, meshes: &[PreparedMesh<'_>]) {
        let columns = self.columns();
        for tile in &mut self.tiles {
            tile.pieces.clear();
        }
        let tile_of = |pixel: i32, axis: usize| pixel as usize / TILE_PX[axis];
        for (mesh, prepared) in meshes.iter().enumerate() {
            for triangle in 0..prepared.triangles() {
                let Some(reach) = prepared.reach(triangle) else { continue };
                let piece = Piece { mesh: mesh as u32, triangle: triangle as u32 };
                for row in tile_of(reach.top, 1)..=tile_of(reach.bottom - 1, 1) {
                    for column in tile_of(reach.left, 0)..=tile_of(reach.right - 1, 0) {
                        self.tiles[row * columns + column].pieces.push(piece);
                    }
                }
            }
        }
    }

    /// The rectangles that the last update painted; adjacent ones are merged.
    pub(super) fn changed(&self) -> Vec<PixelRect> {
        let mut rects: Vec<PixelRect> = Vec::new();
        for (number, _) in self.tiles.iter().enumerate().filter(|(_, tile)| tile.changed) {
            let rect = self.rect_of(number);
            match rects.last_mut() {
                Some(last) if last.at[1] == rect.at[1] && last.at[0] + last.size[0] == rect.at[0] => {
                    last.size[0] += rect.size[0];
                }
                _ => rects.push(rect),
            }
        }
        rects
    }

    /// Width and height.
    pub(super) fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// A rectangle of whole tiles as colours.
    pub(super) fn part(&self, rect: PixelRect) -> ColorImage {
        let [left, top] = rect.at;
        let [first, end] = [left / TILE_PX[0], (left + rect.size[0]).div_ceil(TILE_PX[0])];
        let mut pixels = Vec::with_capacity(rect.size[0] * rect.size[1]);
        for row in top..top + rect.size[1] {
            let line = row / TILE_PX[1] * self.columns();
            for number in line + first..line + end {
                let width = self.rect_of(number).size[0];
                let start = row % TILE_PX[1] * width;
                pixels.extend(self.tiles[number].pixels[start..start + width].iter().map(|pixel| {
                    let [red, green, blue, alpha] = blend::unpack(*pixel);
                    Color32::from_rgba_premultiplied(red, green, blue, alpha)
                }));
            }
        }
        ColorImage::new(rect.size, pixels)
    }

    /// The whole image.
    pub(super) fn image(&self) -> RgbaImage {
        let [width, height] = self.size_px;
        let mut bytes = vec![0; width * height * 4];
        if width > 0 {
            let columns = self.columns();
            let lines = self.tiles.par_chunks(columns);
            bytes.par_chunks_mut(width * TILE_PX[1] * 4).zip(lines).for_each(|(rows, tiles)| {
                for (row, bytes) in rows.chunks_exact_mut(width * 4).enumerate() {
                    for (tile, bytes) in tiles.iter().zip(bytes.chunks_mut(TILE_PX[0] * 4)) {
                        let count = bytes.len() / 4;
                        let pixels = &tile.pixels[row * count..(row + 1) * count];
                        for (bytes, pixel) in bytes.chunks_exact_mut(4).zip(pixels) {
                            bytes.copy_from_slice(&blend::unpack(*pixel));
                        }
                    }
                }
            });
        }
        RgbaImage::from_raw(width as u32, height as u32, bytes).expect("four bytes were written per pixel")
    }
}

impl Tile {
    fn update(&mut self, meshes: &[PreparedMesh<'_>], clip: Clip, ground: u32) {
        let each = self.pieces.iter().map(|piece| meshes[piece.mesh as usize].mark(piece.triangle as usize));
        let mark = each.fold(self.pieces.len() as u64, mixed);
        self.changed = self.mark != Some(mark);
        if !self.changed {
            return;
        }
        self.mark = Some(mark);
        self.pixels.clear();
        self.pixels.resize((clip.right - clip.left) as usize * (clip.bottom - clip.top) as usize, ground);
        let mut target = Target { pixels: &mut self.pixels, clip };
        for Piece { mesh, triangle } in &self.pieces {
            meshes[*mesh as usize].paint(*triangle as usize, &mut target);
        }
    }
}
