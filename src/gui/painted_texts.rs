//! Texts that a window has painted, for tests.

use egui::epaint::TextShape;
use egui::{Rect, Shape};
use egui_kittest::Harness;

/// Text on the screen with the rectangle that clips it.
pub(in crate::gui) struct PaintedText<'a> {
    pub(in crate::gui) shape: &'a TextShape,
    pub(in crate::gui) clip: Rect,
}

impl PaintedText<'_> {
    pub(in crate::gui) fn text(&self) -> &str {
        self.shape.galley.text()
    }

    pub(in crate::gui) fn rect(&self) -> Rect {
        self.shape.visual_bounding_rect()
    }
}

/// Texts of the last frame in the order in which they were painted.
pub(in crate::gui) fn painted_texts<'a, S>(harness: &'a Harness<'_, S>) -> Vec<PaintedText<'a>> {
    fn collect<'a>(shape: &'a Shape, clip: Rect, texts: &mut Vec<PaintedText<'a>>) {
        match shape {
            Shape::Text(shape) => texts.push(PaintedText { shape, clip }),
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| collect(shape, clip, texts)),
            _ => {}
        }
    }
    let mut texts = Vec::new();
    harness.output().shapes.iter().for_each(|clipped| collect(&clipped.shape, clipped.clip_rect, &mut texts));
    texts
}
