//! Textures as images that a drawing embeds.

use std::collections::BTreeMap;
use std::io::Cursor;

use egui::epaint::{ImageData, ImageDelta};
use egui::{TextureId, TexturesDelta};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

/// Pixels of a texture: red, green, blue and alpha, not premultiplied.
#[derive(Clone, Debug, Default)]
pub struct TextureImage {
    /// Width and height in pixels.
    pub(crate) size: [usize; 2],
    pub(crate) rgba: Vec<u8>,
}

/// All textures except the font atlas.
#[derive(Clone, Debug, Default)]
pub struct Textures {
    images: BTreeMap<TextureId, TextureImage>,
}

impl Textures {
    pub fn set(&mut self, delta: &TexturesDelta) {
        for (id, changes) in delta.set.iter().filter(|(id, _)| **id != TextureId::default()) {
            let texture = self.images.entry(*id).or_default();
            for change in changes {
                texture.change(change);
            }
        }
    }

    /// Drops the textures that the output frees.
    pub fn free(&mut self, delta: &TexturesDelta) {
        self.images.retain(|id, _| !delta.free.contains(id));
    }

    /// Pixels of a texture; `None` for an unknown or empty one.
    pub(crate) fn image(&self, id: TextureId) -> Option<&TextureImage> {
        self.images.get(&id).filter(|texture| !texture.rgba.is_empty())
    }
}

impl TextureImage {
    fn change(&mut self, delta: &ImageDelta) {
        let ImageData::Color(image) = &delta.image;
        let rgba: Vec<u8> = image.pixels.iter().flat_map(|pixel| pixel.to_srgba_unmultiplied()).collect();
        let Some([left, top]) = delta.pos else {
            *self = Self { size: image.size, rgba };
            return;
        };
        let width = image.size[0].min(self.size[0].saturating_sub(left)) * 4;
        for (row, pixels) in rgba.chunks_exact(image.size[0].max(1) * 4).enumerate() {
            let begin = ((top + row) * self.size[0] + left) * 4;
            if let Some(target) = self.rgba.get_mut(begin..begin + width) {
                target.copy_from_slice(&pixels[..width]);
            }
        }
    }

    pub(crate) fn png(&self) -> Option<Vec<u8>> {
        let mut bytes = Cursor::new(Vec::new());
        let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
        let [width, height] = self.size.map(|side| side as u32);
        // Camera images and the scene are opaque.
        let rgb: Vec<u8> = self.rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        let opaque = self.rgba.chunks_exact(4).all(|pixel| pixel[3] == u8::MAX);
        let gray = opaque && rgb.chunks_exact(3).all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2]);
        let written = if gray {
            let gray: Vec<u8> = rgb.iter().step_by(3).copied().collect();
            encoder.write_image(&gray, width, height, ExtendedColorType::L8)
        } else if opaque {
            encoder.write_image(&rgb, width, height, ExtendedColorType::Rgb8)
        } else {
            encoder.write_image(&self.rgba, width, height, ExtendedColorType::Rgba8)
        };
        written.ok().map(|()| bytes.into_inner())
    }
}
