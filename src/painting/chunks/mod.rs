//! Tessellation in chunks of shapes; unchanged chunks are reused in the next frame.
//!
//! Most of a window does not change between frames: labels, frames, and plots over the whole flight. A chunk is a run
//! of shapes with one clip rectangle. The ends of the chunks depend on the shapes alone, so that an added or removed
//! shape in a panel changes one or two chunks and not all that follow.

mod shape_hash;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::sync::Arc;

use egui::epaint::{ClippedPrimitive, ClippedShape, TessellationOptions};
use egui::{Context, Galley};

use self::shape_hash::ShapeHasher;

const MOST_SHAPES: usize = 64;
/// A chunk ends after a shape whose hash has none of these bits: after eight shapes on average.
const ENDING_BITS: u64 = 7;
/// A shape with more points or vertices is a separate chunk.
const MANY_POINTS: usize = 64;

/// Consecutive shapes of a frame, tessellated.
pub struct Chunk {
    /// Meshes in points, and primitives that the graphics adapter paints itself.
    pub primitives: Vec<ClippedPrimitive>,
    /// Texts of the shapes. Texts are compared by address, which is unique while they are kept.
    _texts: Vec<Arc<Galley>>,
}

impl Chunk {
    pub fn new(primitives: Vec<ClippedPrimitive>) -> Self {
        Self { primitives, _texts: Vec::new() }
    }
}

/// Inputs of the tessellation in addition to the shape.
#[derive(PartialEq)]
struct Setting {
    pixels_per_point: f32,
    font_image_px: [usize; 2],
    options: TessellationOptions,
}

/// Tessellates frames of one context.
#[derive(Default)]
pub struct Tessellation {
    /// Chunks of the last frame by hash.
    chunks: HashMap<u64, Arc<Chunk>>,
    setting: Option<Setting>,
}

impl Tessellation {
    /// Tessellates the shapes of a frame, in the order of painting.
    ///
    /// Together the meshes give the same image as the meshes of [`Context::tessellate`].
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

/// True if a shape is a separate chunk.
fn is_alone(shape: &ClippedShape) -> bool {
    shape_hash::points_of(&shape.shape) > MANY_POINTS
}
