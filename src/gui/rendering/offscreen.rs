//! Paints frames with wgpu like the window, but into a texture that is read back: for comparing graphics drivers with
//! the CPU painter, and for large screenshots of scenes.
//!
//! The bytes of such a screenshot depend on the driver; the bytes of the CPU painter's screenshots do not.

use std::sync::Arc;
use std::time::Duration;

use eframe::egui_wgpu::{self, RendererOptions, ScreenDescriptor};
use egui::{ClippedPrimitive, Color32, TextureId, TexturesDelta, Ui};
use image::RgbaImage;
use thiserror::Error;

use super::headless::{Headless, HeadlessOptions};
use super::scene_backend::SceneBackend;
use crate::painting::FramePainter;
use crate::painting::chunks::Chunk;

/// Format of the target: eight bits per channel in gamma space, in which egui blends.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const BYTES_PER_PIXEL: u32 = 4;
/// Timeout for one frame of the driver.
const DRIVER_HANGS_AFTER: Duration = Duration::from_mins(1);

/// Reason why a screenshot cannot be painted.
#[derive(Debug, Error)]
pub enum OffscreenError {
    #[error("no graphics adapter: {problem}; use --renderer cpu")]
    NoAdapter {
        /// Backends that were tried.
        problem: String,
    },
    #[error(
        "a screenshot of {width}×{height} pixels exceeds the limit of the graphics adapter {adapter}, {largest} pixels per \
         side; use --renderer cpu"
    )]
    TooLarge { width: u32, height: u32, largest: u32, adapter: String },
    #[error("the graphics adapter {adapter} returned no image: {problem}; use --renderer cpu")]
    NotDelivered { adapter: String, problem: String },
}

/// A graphics adapter without a window.
pub struct Offscreen {
    device: wgpu::Device,
    queue: wgpu::Queue,
    renderer: egui_wgpu::Renderer,
    largest_side_px: u32,
    adapter: String,
}

impl Offscreen {
    /// Selects an adapter: through Vulkan, Metal or Direct3D 12, or through OpenGL when there is none. The environment
    /// variable `WGPU_BACKEND` overrides the choice.
    pub fn open() -> Result<Self, OffscreenError> {
        let tries = wgpu::Backends::from_env()
            .map_or_else(|| vec![wgpu::Backends::PRIMARY, wgpu::Backends::GL], |chosen| vec![chosen]);
        let mut problems = Vec::new();
        for backends in tries {
            match pollster::block_on(Self::open_with(backends)) {
                Ok(opened) => return Ok(opened),
                Err(problem) => problems.push(problem),
            }
        }
        Err(OffscreenError::NoAdapter { problem: problems.join("; ") })
    }

    async fn open_with(backends: wgpu::Backends) -> Result<Self, String> {
        let descriptor =
            wgpu::InstanceDescriptor { backends, ..wgpu::InstanceDescriptor::new_without_display_handle_from_env() };
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::from_env().unwrap_or(wgpu::PowerPreference::HighPerformance),
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter = instance.request_adapter(&options).await.map_err(|error| error.to_string())?;
        let info = adapter.get_info();
        let limits = wgpu::Limits::downlevel_defaults().using_resolution(adapter.limits());
        let largest_side_px = limits.max_texture_dimension_2d;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("offscreen"),
            required_limits: limits,
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) =
            adapter.request_device(&descriptor).await.map_err(|error| format!("{}: {error}", info.name))?;
        let renderer = egui_wgpu::Renderer::new(&device, FORMAT, RendererOptions::PREDICTABLE);
        Ok(Self { device, queue, renderer, largest_side_px, adapter: format!("{} ({:?})", info.name, info.backend) })
    }

    /// Name of the adapter and its graphics interface.
    pub fn adapter(&self) -> &str {
        &self.adapter
    }

    /// A screenshot of a user interface.
    pub fn draw(&mut self, options: HeadlessOptions, ui: impl FnMut(&mut Ui)) -> Result<RgbaImage, OffscreenError> {
        let [width, height] = options.size_px;
        if width.max(height) > self.largest_side_px {
            let (largest, adapter) = (self.largest_side_px, self.adapter.clone());
            return Err(OffscreenError::TooLarge { width, height, largest, adapter });
        }
        let mut headless = Headless::new(options);
        SceneBackend::Wgpu(FORMAT).set(headless.context());
        headless.screenshot(self, ui)
    }

    fn not_delivered(&self, problem: &impl ToString) -> OffscreenError {
        OffscreenError::NotDelivered { adapter: self.adapter.clone(), problem: problem.to_string() }
    }

    /// Copies a finished texture into memory.
    fn read_back(
        &self,
        mut encoder: wgpu::CommandEncoder,
        before: Vec<wgpu::CommandBuffer>,
        texture: &wgpu::Texture,
    ) -> Result<RgbaImage, OffscreenError> {
        let (width, height) = (texture.width(), texture.height());
        let row_bytes = width * BYTES_PER_PIXEL;
        let padded_bytes = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("screenshot"),
            size: u64::from(padded_bytes) * u64::from(height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded_bytes), rows_per_image: None };
        let target = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), target, texture.size());
        let submission = self.queue.submit(before.into_iter().chain([encoder.finish()]));
        // The result of mapping is checked below, when the range is taken.
        buffer.map_async(wgpu::MapMode::Read, .., drop);
        let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(DRIVER_HANGS_AFTER) };
        self.device.poll(wait).map_err(|error| self.not_delivered(&error))?;
        let rows = buffer.get_mapped_range(..).map_err(|error| self.not_delivered(&error))?;
        let bytes = rows.chunks_exact(padded_bytes as usize).flat_map(|row| &row[..row_bytes as usize]).copied();
        RgbaImage::from_raw(width, height, bytes.collect()).ok_or_else(|| self.not_delivered(&"too few bytes"))
    }
}

impl FramePainter for Offscreen {
    type Error = OffscreenError;

    fn set_textures(&mut self, delta: &TexturesDelta) {
        // The textures do not depend on each other; the fixed order is for reproducibility.
        let mut ids: Vec<TextureId> = delta.set.keys().copied().collect();
        ids.sort_unstable();
        for id in ids {
            for change in delta.set.get(&id).into_iter().flatten() {
                self.renderer.update_texture(&self.device, &self.queue, id, change);
            }
        }
    }

    fn free_textures(&mut self, delta: &TexturesDelta) {
        let mut ids: Vec<&TextureId> = delta.free.iter().collect();
        ids.sort_unstable();
        for id in ids {
            self.renderer.free_texture(id);
        }
    }

    fn paint(
        &mut self,
        chunks: &[Arc<Chunk>],
        size_px: [u32; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> Result<RgbaImage, OffscreenError> {
        let primitives: Vec<ClippedPrimitive> =
            chunks.iter().flat_map(|chunk| chunk.primitives.iter().cloned()).collect();
        let screen = ScreenDescriptor { size_in_pixels: size_px, pixels_per_point };
        let label = Some("screenshot");
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
        let before = self.renderer.update_buffers(&self.device, &self.queue, &mut encoder, &primitives, &screen);
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label,
            size: wgpu::Extent3d { width: size_px[0], height: size_px[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let [r, g, b] = [background.r(), background.g(), background.b()].map(|channel| f64::from(channel) / 255.0);
        {
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label,
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..wgpu::RenderPassDescriptor::default()
            });
            self.renderer.render(&mut pass.forget_lifetime(), &primitives, &screen);
        }
        self.read_back(encoder, before, &texture)
    }
}
