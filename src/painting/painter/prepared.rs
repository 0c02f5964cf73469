//! Chunks of meshes, sorted into the tiles of the image.

use std::ops::Range;
use std::sync::Arc;

use egui::TextureId;
use egui::epaint::{Mesh, Primitive, WHITE_UV};

use super::raster::{PreparedMesh, Snapped, Target};
use super::texture::TextureStore;
use crate::chunks::Chunk;
use crate::mixing::mixed;

/// Size of a tile in pixels: small enough that a moving cursor changes few tiles and that a tile fits into the cache.
pub(super) const TILE_PX: [usize; 2] = [64, 32];

/// Indices of a mesh and of a triangle in it.
#[derive(Clone, Copy)]
struct Piece {
    mesh: u32,
    triangle: u32,
}

/// Part of a chunk in one tile.
pub(super) struct Share {
    pub(super) tile: u32,
    /// Hash of the triangles: shares with equal hashes have equal pixels.
    pub(super) hash: u64,
    pieces: Range<u32>,
}

/// Region of a texture that a mesh shows.
struct TextureView {
    texture: TextureId,
    /// Smallest and largest vertical texture coordinate.
    vs: [f32; 2],
    /// State when the chunk was prepared; `None` without that texture.
    seen: Option<Seen>,
}

/// State of a texture.
struct Seen {
    /// Version of the last change of the texture.
    newest: u64,
    /// State of the rows that the mesh shows.
    rows: (u64, u32),
}

impl TextureView {
    fn of(mesh: &Mesh, textures: &TextureStore) -> Self {
        let textured = mesh.vertices.iter().filter(|vertex| vertex.uv != WHITE_UV);
        let vs = textured.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], vertex| {
            [low.min(vertex.uv.y), high.max(vertex.uv.y)]
        });
        // An untextured mesh uses only the corner texel, which is part of every state.
        let vs = if vs[0] <= vs[1] { vs } else { [0.0; 2] };
        let texture = textures.get(mesh.texture_id);
        let seen = texture.map(|texture| Seen { newest: texture.newest(), rows: texture.state(vs) });
        Self { texture: mesh.texture_id, vs, seen }
    }

    fn is_current(&self, textures: &TextureStore) -> bool {
        match (&self.seen, textures.get(self.texture)) {
            (None, None) => true,
            (Some(seen), Some(texture)) => seen.newest == texture.newest() || seen.rows == texture.state(self.vs),
            _ => false,
        }
    }
}

/// A chunk with its triangles by tile, for one size of the image.
pub(super) struct PreparedChunk {
    chunk: Arc<Chunk>,
    /// Vertices of each mesh; `None` for a mesh that is not painted.
    snapped: Vec<Option<Snapped>>,
    views: Vec<TextureView>,
    /// Parts of primitives, ordered by tile.
    shares: Vec<Share>,
    /// By share, in the order of painting.
    pieces: Vec<Piece>,
}

impl PreparedChunk {
    pub(super) fn new(chunk: &Arc<Chunk>, textures: &TextureStore, size_px: [u32; 2], pixels_per_point: f32) -> Self {
        let (mut snapped, mut views) = (Vec::new(), Vec::new());
        let mut placed: Vec<(u32, Piece, u64)> = Vec::new();
        let columns = tiles_in_row(size_px[0] as usize);
        let tile_of = |pixel: i32, axis: usize| pixel as usize / TILE_PX[axis];
        for (number, clipped) in chunk.primitives.iter().enumerate() {
            let Primitive::Mesh(mesh) = &clipped.primitive else {
                snapped.push(None);
                continue;
            };
            views.push(TextureView::of(mesh, textures));
            let texture = textures.get(mesh.texture_id).filter(|texture| !texture.is_empty());
            let vertices = texture.and_then(|_| Snapped::new(mesh, clipped.clip_rect, pixels_per_point, size_px));
            if let (Some(texture), Some(snapped)) = (texture, &vertices) {
                PreparedMesh { mesh, texture, snapped }.for_each_visible(|triangle, reach, hash| {
                    let piece = Piece { mesh: number as u32, triangle: triangle as u32 };
                    for row in tile_of(reach.top, 1)..=tile_of(reach.bottom - 1, 1) {
                        for column in tile_of(reach.left, 0)..=tile_of(reach.right - 1, 0) {
                            placed.push(((row * columns + column) as u32, piece, hash));
                        }
                    }
                });
            }
            snapped.push(vertices);
        }
        // A stable sort keeps the order of painting within a tile.
        placed.sort_by_key(|(tile, _, _)| *tile);
        let mut shares = Vec::new();
        let mut start = 0;
        for run in placed.chunk_by(|(before, _, _), (after, _, _)| before == after) {
            let hash = run.iter().fold(run.len() as u64, |hash, (_, _, triangle)| mixed(hash, *triangle));
            let end = start + run.len() as u32;
            shares.push(Share { tile: run[0].0, hash, pieces: start..end });
            start = end;
        }
        let pieces = placed.into_iter().map(|(_, piece, _)| piece).collect();
        Self { chunk: Arc::clone(chunk), snapped, views, shares, pieces }
    }

    /// True if the textures have not changed.
    pub(super) fn is_current(&self, textures: &TextureStore) -> bool {
        self.views.iter().all(|view| view.is_current(textures))
    }

    /// The parts of the chunk by tile.
    pub(super) fn shares(&self) -> &[Share] {
        &self.shares
    }

    /// Paints the part of the chunk in one tile.
    pub(super) fn paint(&self, share: usize, textures: &TextureStore, target: &mut Target<'_>) {
        let Range { start, end } = self.shares[share].pieces;
        let pieces = &self.pieces[start as usize..end as usize];
        for pieces in pieces.chunk_by(|before, after| before.mesh == after.mesh) {
            let number = pieces[0].mesh as usize;
            let Primitive::Mesh(mesh) = &self.chunk.primitives[number].primitive else { continue };
            let (Some(texture), Some(snapped)) = (textures.get(mesh.texture_id), &self.snapped[number]) else {
                continue;
            };
            let mesh = PreparedMesh { mesh, texture, snapped };
            for piece in pieces {
                mesh.paint(piece.triangle as usize, target);
            }
        }
    }
}

/// Number of tiles in a row of an image of width `width_px`.
pub(super) fn tiles_in_row(width_px: usize) -> usize {
    width_px.div_ceil(TILE_PX[0])
}
