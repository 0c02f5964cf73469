//! Tessellation in chunks of shapes; chunks that did not change are kept from frame to frame.
//!
//! Most of a window is the same as in the frame before: labels, frames, and plots over the whole flight. A chunk is a run
//! of shapes with one clip rectangle. Where chunks end depends on the shapes alone, so that a shape more or less in a
//! panel changes one or two chunks and not all that follow.

mod shape_hash;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::sync::Arc;

use egui::epaint::{ClippedPrimitive, ClippedShape, TessellationOptions};
use egui::{Context, Galley};

use self::shape_hash::ShapeHasher;

/// A chunk ends after so many shapes at the latest.
const MOST_SHAPES: usize = 64;
/// A chunk ends after a shape whose hash has none of these bits: after eight shapes on average.
const ENDING_BITS: u64 = 7;
/// A shape with more points or vertices is a chunk of its own.
const MANY_POINTS: usize = 64;

/// Consecutive shapes, tessellated.
pub struct Chunk {
    /// Meshes, in points, and what the graphics adapter paints by itself.
    pub primitives: Vec<ClippedPrimitive>,
    /// The texts of the shapes. Texts are compared by address, which nothing else can have while they are kept.
    _texts: Vec<Arc<Galley>>,
}

impl Chunk {
    /// A chunk of meshes.
    pub fn new(primitives: Vec<ClippedPrimitive>) -> Self {
        Self { primitives, _texts: Vec::new() }
    }
}

/// What the tessellation of a shape depends on besides the shape.
#[derive(PartialEq)]
struct Setting {
    pixels_per_point: f32,
    font_image_px: [usize; 2],
    options: TessellationOptions,
}

/// Tessellates frames of one context.
#[derive(Default)]
pub struct Tessellation {
    /// The chunks of the last frame by hash.
    chunks: HashMap<u64, Arc<Chunk>>,
    setting: Option<Setting>,
}

impl Tessellation {
    /// Tessellates the shapes of a frame, in the order of painting.
    ///
    /// All meshes together paint the same as those of [`Context::tessellate`].
    pub fn chunks(&mut self, context: &Context, shapes: Vec<ClippedShape>, pixels_per_point: f32) -> Vec<Arc<Chunk>> {
        let setting = Setting {
            pixels_per_point,
            font_image_px: context.fonts(|fonts| fonts.font_image_size()),
            options: context.options(|options| options.tessellation_options),
        };
        if self.setting.as_ref() != Some(&setting) {
            self.chunks.clear();
            self.setting = Some(setting);
        }
        let mut kept = HashMap::with_capacity(self.chunks.len());
        let mut chunks = Vec::with_capacity(self.chunks.len());
        let mut run = Vec::new();
        let mut hasher = ShapeHasher::default();
        let mut shapes = shapes.into_iter().peekable();
        let mut next_is_alone = shapes.peek().is_some_and(is_alone);
        while let Some(shape) = shapes.next() {
            let this_is_alone = std::mem::replace(&mut next_is_alone, shapes.peek().is_some_and(is_alone));
            hasher.add(&shape);
            let clip_rect = shape.clip_rect;
            run.push(shape);
            let ends = this_is_alone
                || next_is_alone
                || run.len() >= MOST_SHAPES
                || hasher.last() & ENDING_BITS == 0
                || shapes.peek().is_none_or(|next| next.clip_rect != clip_rect);
            if !ends {
                continue;
            }
            let (shapes, hasher) = (std::mem::take(&mut run), std::mem::take(&mut hasher));
            let hash = hasher.hash();
            let known = hash.and_then(|hash| kept.get(&hash).or_else(|| self.chunks.get(&hash)));
            let chunk = known.map_or_else(
                || {
                    let primitives = context.tessellate(shapes, pixels_per_point);
                    Arc::new(Chunk { primitives, _texts: hasher.into_texts() })
                },
                Arc::clone,
            );
            if let Some(hash) = hash {
                kept.insert(hash, Arc::clone(&chunk));
            }
            chunks.push(chunk);
        }
        self.chunks = kept;
        chunks
    }
}

/// Whether a shape is a chunk of its own.
fn is_alone(shape: &ClippedShape) -> bool {
    shape_hash::points_of(&shape.shape) > MANY_POINTS
}
