//! A PDF file as a growing list of objects.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::{Filter, Pdf, Ref};

use crate::vector::TextureImage;

/// A file that is being written, with the number of its next object.
pub(super) struct File {
    pub(super) pdf: Pdf,
    next: i32,
}

impl File {
    pub(super) fn new() -> Self {
        Self { pdf: Pdf::new(), next: 1 }
    }

    pub(super) fn reference(&mut self) -> Ref {
        let reference = Ref::new(self.next);
        self.next += 1;
        reference
    }

    /// Writes a compressed stream.
    pub(super) fn stream(&mut self, id: Ref, data: &[u8]) {
        let compressed = compressed(data);
        self.pdf.stream(id, &compressed).filter(Filter::FlateDecode);
    }

    /// Writes the pixels of a texture, and their opacity if it varies.
    pub(super) fn image(&mut self, image: &TextureImage) -> Ref {
        let [width, height] = image.size.map(|side| side as i32);
        let channels = |range: std::ops::Range<usize>| -> Vec<u8> {
            image.rgba.chunks_exact(4).flat_map(|pixel| pixel[range.clone()].to_vec()).collect()
        };
        let opacity = channels(3..4);
        let mask = opacity.iter().any(|alpha| *alpha < u8::MAX).then(|| self.reference());
        if let Some(mask) = mask {
            let opacity = compressed(&opacity);
            let mut written = self.pdf.image_xobject(mask, &opacity);
            written.width(width).height(height).bits_per_component(8).filter(Filter::FlateDecode);
            written.color_space().device_gray();
        }
        let id = self.reference();
        let colors = compressed(&channels(0..3));
        let mut written = self.pdf.image_xobject(id, &colors);
        written.width(width).height(height).bits_per_component(8).filter(Filter::FlateDecode);
        written.color_space().device_rgb();
        if let Some(mask) = mask {
            written.s_mask(mask);
        }
        id
    }
}

fn compressed(data: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(data).and_then(|()| encoder.finish()).expect("writing into memory cannot fail")
}
