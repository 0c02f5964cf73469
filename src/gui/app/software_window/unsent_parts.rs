//! Painted parts of the window that the adapter does not have yet.

use egui::ColorImage;

use crate::gui::rendering::painter::{Painter, PixelRect};

/// Changed parts in the order of painting. A frame that is not shown leaves them to the next one.
#[derive(Default)]
pub(super) struct UnsentParts {
    size_px: [u32; 2],
    parts: Vec<(PixelRect, ColorImage)>,
}

impl UnsentParts {
    /// Adds what the last update of a painter changed; all of it when the size is new, or when less is not fewer pixels.
    pub(super) fn add(&mut self, painter: &Painter, size_px: [u32; 2]) {
        let whole = size_px.map(|side| side as usize);
        if self.size_px == size_px {
            self.parts.extend(painter.changes());
            let pixels: usize = self.parts.iter().map(|(_, colors)| colors.pixels.len()).sum();
            if pixels <= whole[0] * whole[1] {
                return;
            }
        }
        self.size_px = size_px;
        self.parts = vec![(PixelRect { at: [0; 2], size: whole }, painter.whole())];
    }

    pub(super) fn size_px(&self) -> [u32; 2] {
        self.size_px
    }

    pub(super) fn take(&mut self) -> Vec<(PixelRect, ColorImage)> {
        std::mem::take(&mut self.parts)
    }
}
