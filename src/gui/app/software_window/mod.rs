//! Paints the window on the CPU if the graphics adapter is a CPU adapter.
//!
//! egui's meshes take several times as long in a software Vulkan driver as in [`Painter`]. The meshes of the window are
//! therefore painted here, and the adapter copies one image.

mod adapter_image;

use std::sync::Arc;

use eframe::egui_wgpu;
use egui::epaint::ClippedShape;
use egui::{Color32, Context, FullOutput, Plugin, Pos2, Rect, Shape};
use parking_lot::Mutex;

use crate::painting::chunks::Tessellation;
use crate::painting::painter::Painter;
use adapter_image::{CopyCallback, UnsentParts};

/// Replaces the meshes of a frame by the copy of an image.
pub(super) struct SoftwareWindow {
    tessellation: Tessellation,
    painter: Painter,
    unsent: Arc<Mutex<UnsentParts>>,
    target_format: wgpu::TextureFormat,
}

impl SoftwareWindow {
    /// Painter for a window whose pixels have the format `target_format` on the adapter.
    pub(super) fn new(target_format: wgpu::TextureFormat) -> Self {
        Self {
            tessellation: Tessellation::default(),
            painter: Painter::default(),
            unsent: Arc::default(),
            target_format,
        }
    }
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
        self.unsent.lock().add(&self.painter, size_px);
        let callback = CopyCallback { unsent: Arc::clone(&self.unsent), target_format: self.target_format };
        let rect = Rect::from_min_size(Pos2::ZERO, egui::vec2(size_px[0] as f32, size_px[1] as f32) / scale);
        let copy = Shape::Callback(egui_wgpu::Callback::new_paint_callback(rect, callback));
        output.shapes = vec![ClippedShape::new(rect, copy)];
    }
}

#[cfg(test)]
mod tests {
    use image::RgbaImage;

    use super::*;
    use crate::gui::rendering::headless::{Headless, HeadlessOptions};
    use crate::gui::theme::ThemeName;

    fn sample_ui(ui: &mut egui::Ui) {
        ui.label("one image");
        ui.add(egui::Slider::new(&mut 0.3, 0.0..=1.0));
        ui.button("unchanged").highlight();
    }

    /// Writes the unsent parts into the image on the adapter; returns the number of their pixels.
    fn send(unsent: &Mutex<UnsentParts>, image: &mut RgbaImage) -> usize {
        let mut sent = 0;
        for (part, colors) in unsent.lock().take() {
            sent += colors.pixels.len();
            for (index, color) in colors.pixels.iter().enumerate() {
                let [x, y] = [part.at[0] + index % part.size[0], part.at[1] + index / part.size[0]];
                image.put_pixel(x as u32, y as u32, image::Rgba(color.to_array()));
            }
        }
        sent
    }

    #[test]
    fn the_image_on_the_adapter_has_the_same_pixels() {
        for scale in [1.0, 1.5] {
            let size_px = [360, 180];
            let options = HeadlessOptions { size_px, pixels_per_point: scale, theme: ThemeName::Light };
            let panel = |ui: &mut egui::Ui| {
                egui::CentralPanel::default().show(ui, sample_ui);
            };
            let (mut plain, mut painter) = (Headless::new(options), Painter::new());
            let Ok(expected) = plain.screenshot(&mut painter, panel);

            let plugin = SoftwareWindow::new(wgpu::TextureFormat::Bgra8Unorm);
            let unsent = Arc::clone(&plugin.unsent);
            let (mut window, mut adapter) = (Headless::new(options), Painter::new());
            window.context().add_plugin(plugin);
            let mut image = RgbaImage::new(size_px[0], size_px[1]);
            let Ok(_) = window.screenshot(&mut adapter, panel);
            assert_eq!(send(&unsent, &mut image), 360 * 180, "no more than once, after several frames");
            assert!(image == expected, "at {scale}");

            let again = window.frame(Vec::new(), panel);
            assert!(again.textures.is_empty(), "the adapter needs no texture of egui");
            assert_eq!(send(&unsent, &mut image), 0, "what did not change is not sent again");

            // Only changed rectangles are sent.
            let changed = |ui: &mut egui::Ui| {
                egui::CentralPanel::default().show(ui, |ui| {
                    sample_ui(ui);
                    ui.label("more");
                });
            };
            let Ok(expected) = plain.screenshot(&mut painter, changed);
            let Ok(_) = window.screenshot(&mut adapter, changed);
            let sent = send(&unsent, &mut image);
            assert!(sent > 0 && sent < 360 * 180, "{sent} pixels");
            assert!(image == expected, "changed at {scale}");
        }
    }
}
