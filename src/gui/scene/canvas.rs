//! Shows a drawing in a rectangle with the context's scene backend.

use std::sync::Arc;

use egui::{Pos2, Rect, TextureHandle, TextureOptions, Ui, pos2};

use super::layout::SceneDrawing;
use super::{cpu, gpu};
use crate::gui::rendering::scene_backend::SceneBackend;

/// Keeps the last drawing, so that it is drawn again only when it changes.
pub(super) struct Canvas {
    name: &'static str,
    drawing: Option<Arc<SceneDrawing>>,
    texture: Option<(Arc<SceneDrawing>, TextureHandle)>,
}

impl Canvas {
    /// Creates an empty canvas; `name` distinguishes the canvases of one panel.
    pub(super) fn new(name: &'static str) -> Self {
        Self { name, drawing: None, texture: None }
    }

    /// Draws everything except the labels; the edges of `rect` are on whole pixels.
    pub(super) fn show(&mut self, ui: &Ui, rect: Rect, drawing: SceneDrawing) -> Arc<SceneDrawing> {
        let drawing = match self.drawing.take() {
            Some(last) if *last == drawing => last,
            _ => Arc::new(drawing),
        };
        self.drawing = Some(Arc::clone(&drawing));
        match SceneBackend::of(ui.ctx()) {
            SceneBackend::Cpu => self.show_texture(ui, rect, &drawing),
            SceneBackend::Wgpu(format) => {
                let callback = gpu::SceneCallback::new(ui.scope_id().with(self.name), Arc::clone(&drawing), format);
                ui.painter().add(eframe::egui_wgpu::Callback::new_paint_callback(rect, callback));
            }
        }
        drawing
    }

    fn show_texture(&mut self, ui: &Ui, rect: Rect, drawing: &Arc<SceneDrawing>) {
        let is_current = self.texture.as_ref().is_some_and(|(shown, _)| Arc::ptr_eq(shown, drawing));
        if !is_current {
            let image = cpu::draw(drawing);
            if let Some((shown, handle)) = &mut self.texture {
                handle.set(image, TextureOptions::NEAREST);
                *shown = Arc::clone(drawing);
            } else {
                let handle = ui.ctx().load_texture(self.name, image, TextureOptions::NEAREST);
                self.texture = Some((Arc::clone(drawing), handle));
            }
        }
        if let Some((_, handle)) = &self.texture {
            let whole = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
            ui.painter().image(handle.id(), rect, whole, egui::Color32::WHITE);
        }
    }
}
