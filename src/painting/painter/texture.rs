//! Textures of egui, and texel lookup.

use std::collections::BTreeMap;

use egui::epaint::textures::{TextureFilter, TextureOptions, TextureWrapMode};
use egui::epaint::{ImageData, ImageDelta};
use egui::{Color32, TextureId, TexturesDelta};

use super::blend;

/// Fractional bits of a texel coordinate.
pub(super) const TEXEL_BITS: u32 = 32;

#[derive(Default)]
pub(super) struct TextureStore {
    textures: BTreeMap<TextureId, Texture>,
    /// Number of changes so far.
    version: u64,
}

/// Number of texel rows whose changes share one version.
const BLOCK_ROWS: usize = 32;

impl TextureStore {
    pub(super) fn get(&self, id: TextureId) -> Option<&Texture> {
        self.textures.get(&id)
    }

    pub(super) fn set(&mut self, delta: &TexturesDelta) {
        // The textures do not depend on each other, so the order of the ids does not matter.
        let mut ids: Vec<TextureId> = delta.set.keys().copied().collect();
        ids.sort_unstable();
        for id in ids {
            for change in delta.set.get(&id).into_iter().flatten() {
                self.change(id, change);
            }
        }
    }

    pub(super) fn free(&mut self, delta: &TexturesDelta) {
        self.textures.retain(|id, _| !delta.free.contains(id));
    }

    fn change(&mut self, id: TextureId, delta: &ImageDelta) {
        let ImageData::Color(image) = &delta.image;
        self.version += 1;
        let Some([left, top]) = delta.pos else {
            self.textures.insert(id, Texture::new(image.size, &image.pixels, delta.options, self.version));
            return;
        };
        let Some(texture) = self.textures.get_mut(&id) else { return };
        texture.change_rows(top, image.height(), delta.options, self.version);
        let width = image.width().min(texture.width.saturating_sub(left));
        for (row, texels) in image.pixels.chunks_exact(image.width().max(1)).enumerate() {
            if top + row >= texture.height {
                break;
            }
            let start = (top + row) * texture.width + left;
            for (texel, color) in texture.texels[start..start + width].iter_mut().zip(texels) {
                *texel = blend::pack(color.to_array());
            }
            let kind = texture.kind.joined(TexelKind::of(&texels[..width]));
            if kind != texture.kind {
                texture.kind = kind;
                texture.versions.fill(self.version);
            }
        }
    }
}

/// Common property of all texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TexelKind {
    /// Four equal channels: coverage, as in the font atlas.
    Coverage,
    /// Alpha 255: an image.
    Opaque,
    Mixed,
}

impl TexelKind {
    fn of(texels: &[Color32]) -> Self {
        let is_coverage = |color: &Color32| color.to_array() == [color.a(); 4];
        if texels.iter().all(is_coverage) {
            Self::Coverage
        } else if texels.iter().all(|color| color.a() == 255) {
            Self::Opaque
        } else {
            Self::Mixed
        }
    }

    fn joined(self, other: Self) -> Self {
        if self == other { self } else { Self::Mixed }
    }
}

pub(super) struct Texture {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) kind: TexelKind,
    options: TextureOptions,
    texels: Vec<u32>,
    newest: u64,
    /// Version of the last change of each block of [`BLOCK_ROWS`] rows.
    versions: Vec<u64>,
}

impl Texture {
    fn new(size: [usize; 2], pixels: &[Color32], options: TextureOptions, version: u64) -> Self {
        let texels = pixels.iter().map(|color| blend::pack(color.to_array())).collect();
        let versions = vec![version; size[1].div_ceil(BLOCK_ROWS)];
        Self {
            width: size[0],
            height: size[1],
            kind: TexelKind::of(pixels),
            options,
            texels,
            newest: version,
            versions,
        }
    }

    /// Records a change of rows, and of the texture options.
    fn change_rows(&mut self, top: usize, rows: usize, options: TextureOptions, version: u64) {
        let all = self.versions.len();
        let blocks = if self.options == options {
            (top / BLOCK_ROWS).min(all)..(top + rows).div_ceil(BLOCK_ROWS).min(all)
        } else {
            0..all
        };
        self.options = options;
        self.newest = version;
        self.versions[blocks].fill(version);
    }

    /// Version of the rows that a triangle with these texture coordinates can show; it differs after every change of
    /// these rows.
    pub(super) fn version(&self, vs: [f32; 3]) -> u64 {
        let (low, high) = (vs[0].min(vs[1]).min(vs[2]), vs[0].max(vs[1]).max(vs[2]));
        let all = self.versions.len();
        let blocks = if low >= 0.0 && high <= 1.0 && self.options.wrap_mode == TextureWrapMode::ClampToEdge {
            // Filtering also reads the adjacent rows.
            let row = |v: f32| (v * self.height as f32) as usize;
            let (first, last) = (row(low).saturating_sub(2), row(high) + 2);
            first / BLOCK_ROWS..(last / BLOCK_ROWS + 1).min(all)
        } else {
            0..all
        };
        self.versions.get(blocks).unwrap_or(&self.versions).iter().copied().max().unwrap_or(0)
    }

    pub(super) fn newest(&self) -> u64 {
        self.newest
    }

    /// State of the rows of these texture coordinates and of the corner texel; it differs after every change of them.
    pub(super) fn state(&self, vs: [f32; 2]) -> (u64, u32) {
        (self.version([vs[0], vs[1], vs[1]]), self.corner())
    }

    /// Corner texel, which egui uses for untextured meshes.
    pub(super) fn corner(&self) -> u32 {
        self.texels.first().copied().unwrap_or(u32::MAX)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.texels.is_empty()
    }

    pub(super) fn is_nearest(&self) -> bool {
        self.options.magnification == TextureFilter::Nearest
    }

    /// One row of texels; row indices wrap.
    pub(super) fn row(&self, row: i64) -> &[u32] {
        let start = self.wrap(row, self.height) * self.width;
        &self.texels[start..start + self.width]
    }

    /// A column index inside the texture.
    #[inline]
    pub(super) fn column(&self, column: i64) -> usize {
        self.wrap(column, self.width)
    }

    #[inline]
    fn wrap(&self, index: i64, size: usize) -> usize {
        let size = size as i64;
        let wrapped = match self.options.wrap_mode {
            TextureWrapMode::ClampToEdge => index.clamp(0, size - 1),
            TextureWrapMode::Repeat => index.rem_euclid(size),
            TextureWrapMode::MirroredRepeat => {
                let phase = index.rem_euclid(2 * size);
                phase.min(2 * size - 1 - phase)
            }
        };
        wrapped as usize
    }

    /// The colour at a position in texels with [`TEXEL_BITS`] fractional bits, from the corner of the first texel.
    #[inline]
    pub(super) fn sample(&self, u: i64, v: i64) -> u32 {
        if self.is_nearest() {
            return self.row(v >> TEXEL_BITS)[self.column(u >> TEXEL_BITS)];
        }
        let (u, v) = (u - (1 << (TEXEL_BITS - 1)), v - (1 << (TEXEL_BITS - 1)));
        let row = v >> TEXEL_BITS;
        self.between(self.row(row), self.row(row + 1), u, weight(v))
    }

    /// Bilinear interpolation between texels of two rows; `u` is relative to the centre of the first texel.
    #[inline]
    pub(super) fn between(&self, upper: &[u32], lower: &[u32], u: i64, down: u32) -> u32 {
        let column = u >> TEXEL_BITS;
        let (left, right) = (self.column(column), self.column(column + 1));
        let across = weight(u);
        let mixed = |row: &[u32]| blend::mixed(blend::spread(row[left]), blend::spread(row[right]), across);
        let top = mixed(upper);
        if down == 0 {
            return blend::gathered(top);
        }
        blend::gathered(blend::mixed(top, mixed(lower), down))
    }
}

/// The fraction of a texel coordinate in 1/256, rounded: 0 to 256.
#[inline]
pub(super) fn weight(coordinate: i64) -> u32 {
    const SHIFT: u32 = TEXEL_BITS - 8;
    let fraction = coordinate & ((1 << TEXEL_BITS) - 1);
    ((fraction + (1 << (SHIFT - 1))) >> SHIFT) as u32
}
