//! The image of the window on the adapter, and its copy into egui's render pass.
//!
//! egui's own shader computes filters and dithering of every pixel, also where they are switched off: a software driver
//! evaluates both sides of a condition.

use std::sync::Arc;

use eframe::egui_wgpu::{CallbackResources, CallbackTrait, ScreenDescriptor};
use egui::{ColorImage, PaintCallbackInfo};
use parking_lot::Mutex;

use crate::gui::rendering::image_copy::ImageCopy;
use crate::painting::painter::{Painter, PixelRect};

/// Sends the changed parts to the adapter and shows the image.
pub(super) struct CopyCallback {
    pub(super) unsent: Arc<Mutex<UnsentParts>>,
    pub(super) target_format: wgpu::TextureFormat,
}

impl CallbackTrait for CopyCallback {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _screen: &ScreenDescriptor,
        _encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        let mut unsent = self.unsent.lock();
        let size_px = unsent.size_px();
        let image = resources.entry::<AdapterImage>().or_insert_with(|| AdapterImage::new(device, self.target_format));
        image.resize(device, size_px);
        for (part, colors) in unsent.take() {
            image.write(queue, part, &colors);
        }
        Vec::new()
    }

    fn paint(&self, _info: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, resources: &CallbackResources) {
        if let Some(AdapterImage { copy, texture: Some((_, group)) }) = resources.get::<AdapterImage>() {
            copy.draw(pass, group);
        }
    }
}

struct AdapterImage {
    copy: ImageCopy,
    texture: Option<(wgpu::Texture, wgpu::BindGroup)>,
}

impl AdapterImage {
    fn new(device: &wgpu::Device, target_format: wgpu::TextureFormat) -> Self {
        Self { copy: ImageCopy::new(device, target_format), texture: None }
    }

    /// Creates the texture when its size has changed; the next parts fill it.
    fn resize(&mut self, device: &wgpu::Device, [width, height]: [u32; 2]) {
        let is_current = |(texture, _): &(wgpu::Texture, _)| [texture.width(), texture.height()] == [width, height];
        if self.texture.as_ref().is_some_and(is_current) {
            return;
        }
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("window"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let group = self.copy.group(device, &texture.create_view(&wgpu::TextureViewDescriptor::default()));
        self.texture = Some((texture, group));
    }

    fn write(&self, queue: &wgpu::Queue, part: PixelRect, colors: &ColorImage) {
        let Some((texture, _)) = &self.texture else { return };
        let [x, y, width, height] = [part.at[0], part.at[1], part.size[0], part.size[1]].map(|side| side as u32);
        queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x, y, z: 0 },
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::cast_slice(&colors.pixels),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: Some(height) },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
    }
}

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
