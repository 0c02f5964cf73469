//! The image in tiles, which are repainted only when their content changes.

use std::sync::Arc;

use egui::{Color32, ColorImage};
use image::RgbaImage;
use rayon::prelude::*;

use super::blend;
use super::prepared::{PreparedChunk, TILE_PX, tiles_in_row};
use super::raster::Target;
use super::texture::TextureStore;
use super::triangle::Clip;

#[derive(Default)]
struct Tile {
    /// Parts of chunks that may touch the tile, in the order of painting: number of the chunk and of its part (share).
    shares: Vec<[u32; 2]>,
    /// Hashes of the shares of the last image; `None` before the first one.
    hashes: Option<Vec<u64>>,
    /// Pixels by row, each row as wide as the tile.
    pixels: Vec<u32>,
    /// Pixels below the first share that changed in the last update. A moving element, such as a cursor over plots, is
    /// mostly the same share again; all content below it need not be repainted.
    below: Vec<u32>,
    /// Number of shares in `below`.
    below_count: usize,
    /// True if the tile was painted in the last update.
    changed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// Column and row of the upper left pixel.
    pub at: [usize; 2],
    pub size: [usize; 2],
}

#[derive(Default)]
pub(super) struct Canvas {
    size_px: [usize; 2],
    ground: u32,
    tiles: Vec<Tile>,
}

impl Canvas {
    fn columns(&self) -> usize {
        tiles_in_row(self.size_px[0])
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

    /// Updates the image; the result is the same as painting it completely.
    pub(super) fn update(
        &mut self,
        chunks: &[Arc<PreparedChunk>],
        textures: &TextureStore,
        size_px: [usize; 2],
        ground: u32,
    ) {
        if (self.size_px, self.ground) != (size_px, ground) {
            *self = Self { size_px, ground, tiles: Vec::new() };
            let count = if size_px[0] > 0 { tiles_in_row(size_px[0]) * size_px[1].div_ceil(TILE_PX[1]) } else { 0 };
            self.tiles.resize_with(count, Tile::default);
        }
        for tile in &mut self.tiles {
            tile.shares.clear();
        }
        for (number, chunk) in chunks.iter().enumerate() {
            for (place, share) in chunk.shares().iter().enumerate() {
                self.tiles[share.tile as usize].shares.push([number as u32, place as u32]);
            }
        }
        let clips: Vec<Clip> = (0..self.tiles.len()).map(|number| self.clip_of(number)).collect();
        self.tiles.par_iter_mut().zip(clips).for_each(|(tile, clip)| tile.update(chunks, textures, clip, ground));
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

    pub(super) fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// A rectangle of whole tiles, as colours.
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
    fn update(&mut self, chunks: &[Arc<PreparedChunk>], textures: &TextureStore, clip: Clip, ground: u32) {
        let share = |[chunk, share]: &[u32; 2]| (&chunks[*chunk as usize], *share as usize);
        let hash = |at: &[u32; 2]| {
            let (chunk, share) = share(at);
            chunk.shares()[share].hash
        };
        self.changed =
            self.hashes.as_ref().is_none_or(|hashes| !hashes.iter().copied().eq(self.shares.iter().map(hash)));
        if !self.changed {
            return;
        }
        let hashes: Vec<u64> = self.shares.iter().map(hash).collect();
        let old = self.hashes.take().unwrap_or_default();
        let same = old.iter().zip(&hashes).take_while(|(old, new)| old == new).count();
        if self.below_count == 0 || self.below_count > same {
            self.below_count = 0;
            self.below.clear();
            self.below.resize((clip.right - clip.left) as usize * (clip.bottom - clip.top) as usize, ground);
        }
        let paint = |shares: &[[u32; 2]], pixels: &mut [u32]| {
            let mut target = Target { pixels, clip };
            for (chunk, share) in shares.iter().map(share) {
                chunk.paint(share, textures, &mut target);
            }
        };
        paint(&self.shares[self.below_count..same], &mut self.below);
        self.below_count = same;
        self.pixels.clone_from(&self.below);
        paint(&self.shares[same..], &mut self.pixels);
        self.hashes = Some(hashes);
    }
}
