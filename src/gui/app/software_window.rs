//! Paints the window on the CPU if the graphics adapter is a CPU adapter.
//!
//! egui's meshes take several times as long in a software Vulkan driver as in [`Painter`]. The meshes of the window are
//! therefore painted here, and the adapter draws one textured rectangle.

use egui::epaint::{ClippedShape, ImageDelta, Mesh};
use egui::{Color32, Context, FullOutput, Plugin, Pos2, Rect, Shape, TextureId, TextureOptions, pos2};

use crate::gui::rendering::chunks::Tessellation;
use crate::gui::rendering::painter::Painter;

/// Texture with the content of the window; egui numbers its textures from 0 upwards.
const WINDOW_TEXTURE: TextureId = TextureId::Managed(u64::MAX);

/// Replaces the meshes of a frame by one texture.
#[derive(Default)]
pub(super) struct SoftwareWindow {
    tessellation: Tessellation,
    painter: Painter,
    /// Size of the texture on the adapter.
    shown_px: [u32; 2],
}

impl Plugin for SoftwareWindow {
    fn debug_name(&self) -> &'static str {
        "software window"
    }

    fn output_hook(&mut self, ctx: &Context, output: &mut FullOutput) {
        let scale = output.pixels_per_point;
        let size = ctx.viewport_rect().max.to_vec2();
        let size_px = [size.x, size.y].map(|side| (side * scale).round().max(0.0) as u32);
        let shapes = std::mem::take(&mut output.shapes);
        let chunks = self.tessellation.chunks(ctx, shapes, scale);
        self.painter.set_textures(&output.textures_delta);
        self.painter.update(&chunks, size_px, scale, Color32::BLACK);
        self.painter.free_textures(&output.textures_delta);
        output.textures_delta.clear();
        if size_px.contains(&0) {
            return;
        }
        let options = TextureOptions::NEAREST;
        if self.shown_px == size_px {
            for (part, colors) in self.painter.changes() {
                output.textures_delta.push(WINDOW_TEXTURE, ImageDelta::partial(part.at, colors, options));
            }
        } else {
            self.shown_px = size_px;
            output.textures_delta.push(WINDOW_TEXTURE, ImageDelta::full(self.painter.whole(), options));
        }
        let rect = Rect::from_min_size(Pos2::ZERO, egui::vec2(size_px[0] as f32, size_px[1] as f32) / scale);
        let mut mesh = Mesh::with_texture(WINDOW_TEXTURE);
        mesh.add_rect_with_uv(rect, Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0)), Color32::WHITE);
        output.shapes = vec![ClippedShape::new(rect, Shape::mesh(mesh))];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::rendering::headless::{Headless, HeadlessOptions};
    use crate::gui::theme::ThemeName;

    fn sample_ui(ui: &mut egui::Ui) {
        ui.label("one textured rectangle");
        ui.add(egui::Slider::new(&mut 0.3, 0.0..=1.0));
        ui.button("unchanged").highlight();
    }

    #[test]
    fn the_window_is_one_texture_with_the_same_pixels() {
        for scale in [1.0, 1.5] {
            let options = HeadlessOptions { size_px: [360, 180], pixels_per_point: scale, theme: ThemeName::Light };
            let panel = |ui: &mut egui::Ui| {
                egui::CentralPanel::default().show(ui, sample_ui);
            };
            let (mut plain, mut painter) = (Headless::new(options), Painter::new());
            let Ok(expected) = plain.screenshot(&mut painter, panel);

            let (mut window, mut adapter) = (Headless::new(options), Painter::new());
            window.context().add_plugin(SoftwareWindow::default());
            let Ok(seen) = window.screenshot(&mut adapter, panel);
            assert!(seen == expected, "at {scale}");

            let mut again = window.frame(Vec::new(), panel);
            assert_eq!(again.chunks.len(), 1, "one rectangle is left to the adapter");
            assert!(again.textures.is_empty(), "what did not change is not handed over again");
            again.textures.clear();

            // Only changed rectangles are uploaded.
            let changed = |ui: &mut egui::Ui| {
                egui::CentralPanel::default().show(ui, |ui| {
                    sample_ui(ui);
                    ui.label("more");
                });
            };
            let Ok(expected) = plain.screenshot(&mut painter, changed);
            let Ok(seen) = window.screenshot(&mut adapter, changed);
            assert!(seen == expected, "changed at {scale}");
        }
    }
}
