//! Draws a scene with wgpu into colour and depth targets with four samples per pixel, then copies it into egui's pass.
//!
//! egui's pass has no depth buffer. The scene is drawn again only when it has changed.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::{CallbackResources, CallbackTrait, ScreenDescriptor};
use egui::PaintCallbackInfo;
use wgpu::util::DeviceExt as _;

use super::layout::{Corner, Disc, ImageCorner, SceneDrawing, Segment};
use super::pipelines::{COLOR_FORMAT, DEPTH_FORMAT, PipelineMaker, SAMPLES};
use crate::gui::rendering::image_copy::ImageCopy;
use crate::sensors::GrayImage;

/// Vertices of the two triangles of a segment.
const SEGMENT_VERTICES: u32 = 6;
/// Vertices of the triangles of a disc, drawn as an octagon.
const DISC_VERTICES: u32 = 18;

/// One view of a scene as a paint callback of egui.
pub(super) struct SceneCallback {
    canvas: egui::Id,
    drawing: Arc<SceneDrawing>,
    target_format: wgpu::TextureFormat,
}

impl SceneCallback {
    /// `canvas` identifies the view; each view keeps its targets.
    pub(super) fn new(canvas: egui::Id, drawing: Arc<SceneDrawing>, target_format: wgpu::TextureFormat) -> Self {
        Self { canvas, drawing, target_format }
    }
}

impl CallbackTrait for SceneCallback {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _screen: &ScreenDescriptor,
        encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        let renderer =
            resources.entry::<SceneRenderer>().or_insert_with(|| SceneRenderer::new(device, self.target_format));
        renderer.prepare(device, queue, encoder, self.canvas, &self.drawing);
        Vec::new()
    }

    fn paint(&self, _info: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, resources: &CallbackResources) {
        if let Some(renderer) = resources.get::<SceneRenderer>() {
            renderer.copy(pass, self.canvas);
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Uniforms {
    size_px: [f32; 2],
    padding: [f32; 2],
}

/// Pipelines, and the targets of each view.
struct SceneRenderer {
    image_pipeline: wgpu::RenderPipeline,
    face_pipeline: wgpu::RenderPipeline,
    segment_pipeline: wgpu::RenderPipeline,
    disc_pipeline: wgpu::RenderPipeline,
    copy: ImageCopy,
    uniform_layout: wgpu::BindGroupLayout,
    canvases: egui::IdMap<Canvas>,
}

/// The targets of one view and its last drawing.
struct Canvas {
    drawing: Arc<SceneDrawing>,
    size_px: [u32; 2],
    samples: wgpu::TextureView,
    depth: wgpu::TextureView,
    resolved: wgpu::TextureView,
    copy_group: wgpu::BindGroup,
}

impl SceneRenderer {
    fn new(device: &wgpu::Device, target_format: wgpu::TextureFormat) -> Self {
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("scene"),
            source: wgpu::ShaderSource::Wgsl(include_str!("../../../assets/shaders/scene.wgsl").into()),
        });
        let uniform_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("scene view"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let copy = ImageCopy::new(device, target_format);
        let pipelines =
            PipelineMaker { device, shader: &shader, uniform_layout: &uniform_layout, texture_layout: copy.layout() };
        let per_instance = wgpu::VertexStepMode::Instance;
        let per_vertex = wgpu::VertexStepMode::Vertex;
        Self {
            image_pipeline: pipelines.scene(
                ["image_vertex", "image_fragment"],
                Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<ImageCorner>() as u64,
                    step_mode: per_vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x2],
                }),
            ),
            face_pipeline: pipelines.scene(
                ["face_vertex", "color_fragment"],
                Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<Corner>() as u64,
                    step_mode: per_vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Unorm8x4],
                }),
            ),
            segment_pipeline: pipelines.scene(
                ["segment_vertex", "color_fragment"],
                Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<Segment>() as u64,
                    step_mode: per_instance,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32, 3 => Unorm8x4],
                }),
            ),
            disc_pipeline: pipelines.scene(
                ["disc_vertex", "color_fragment"],
                Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<Disc>() as u64,
                    step_mode: per_instance,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Unorm8x4],
                }),
            ),
            copy,
            uniform_layout,
            canvases: egui::IdMap::default(),
        }
    }

    /// Draws a view if it has changed.
    fn prepare(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        id: egui::Id,
        drawing: &Arc<SceneDrawing>,
    ) {
        let old = self.canvases.remove(&id);
        if let Some(canvas) = old.as_ref().filter(|canvas| Arc::ptr_eq(&canvas.drawing, drawing)) {
            debug_assert_eq!(canvas.size_px, drawing.size_px);
            self.canvases.extend(old.map(|canvas| (id, canvas)));
            return;
        }
        let mut canvas = old
            .filter(|canvas| canvas.size_px == drawing.size_px)
            .unwrap_or_else(|| Canvas::new(device, drawing, &self.copy));
        canvas.drawing = Arc::clone(drawing);
        self.draw(device, queue, encoder, &canvas);
        self.canvases.insert(id, canvas);
    }

    fn draw(&self, device: &wgpu::Device, queue: &wgpu::Queue, encoder: &mut wgpu::CommandEncoder, canvas: &Canvas) {
        let drawing = &canvas.drawing;
        let buffer = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let vertices = |label, contents: &[u8]| {
            (!contents.is_empty()).then(|| buffer(label, contents, wgpu::BufferUsages::VERTEX))
        };
        let uniforms = Uniforms { size_px: drawing.size_px.map(|side| side as f32), padding: [0.0; 2] };
        let uniforms = buffer("scene view", bytemuck::bytes_of(&uniforms), wgpu::BufferUsages::UNIFORM);
        let uniform_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene view"),
            layout: &self.uniform_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() }],
        });
        let images: Vec<_> = drawing
            .images
            .iter()
            .filter_map(|image_shape| {
                let corners = vertices("scene images", bytemuck::cast_slice(&image_shape.corners))?;
                Some((corners, image_shape.corners.len() as u32, self.image_group(device, queue, &image_shape.image)?))
            })
            .collect();
        let faces = vertices("scene faces", bytemuck::cast_slice(&drawing.corners));
        let segments = vertices("scene segments", bytemuck::cast_slice(&drawing.segments));
        let discs = vertices("scene discs", bytemuck::cast_slice(&drawing.discs));

        let [red, green, blue, _] = drawing.background.to_array().map(|channel| f64::from(channel) / 255.0);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &canvas.samples,
                depth_slice: None,
                resolve_target: Some(&canvas.resolved),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r: red, g: green, b: blue, a: 1.0 }),
                    store: wgpu::StoreOp::Discard,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &canvas.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_bind_group(0, &uniform_group, &[]);
        pass.set_pipeline(&self.image_pipeline);
        for (corners, count, group) in &images {
            pass.set_bind_group(1, group, &[]);
            pass.set_vertex_buffer(0, corners.slice(..));
            pass.draw(0..*count, 0..1);
        }
        if let Some(faces) = &faces {
            pass.set_pipeline(&self.face_pipeline);
            pass.set_vertex_buffer(0, faces.slice(..));
            pass.draw(0..drawing.corners.len() as u32, 0..1);
        }
        if let Some(segments) = &segments {
            pass.set_pipeline(&self.segment_pipeline);
            pass.set_vertex_buffer(0, segments.slice(..));
            pass.draw(0..SEGMENT_VERTICES, 0..drawing.segments.len() as u32);
        }
        if let Some(discs) = &discs {
            pass.set_pipeline(&self.disc_pipeline);
            pass.set_vertex_buffer(0, discs.slice(..));
            pass.draw(0..DISC_VERTICES, 0..drawing.discs.len() as u32);
        }
    }

    /// The bind group with the image as a texture; `None` for an image without pixels.
    fn image_group(&self, device: &wgpu::Device, queue: &wgpu::Queue, image: &GrayImage) -> Option<wgpu::BindGroup> {
        if image.pixels.is_empty() || image.pixels.len() < image.width * image.height {
            return None;
        }
        let size = wgpu::Extent3d { width: image.width as u32, height: image.height as u32, depth_or_array_layers: 1 };
        let texture = device.create_texture_with_data(
            queue,
            &wgpu::TextureDescriptor {
                label: Some("scene image"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::R8Unorm,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            },
            wgpu::util::TextureDataOrder::LayerMajor,
            &image.pixels[..image.width * image.height],
        );
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Some(self.copy.group(device, &view))
    }

    /// Copies a prepared view into egui's pass.
    fn copy(&self, pass: &mut wgpu::RenderPass<'static>, id: egui::Id) {
        if let Some(canvas) = self.canvases.get(&id) {
            self.copy.draw(pass, &canvas.copy_group);
        }
    }
}

impl Canvas {
    fn new(device: &wgpu::Device, drawing: &Arc<SceneDrawing>, copy: &ImageCopy) -> Self {
        let size_px = drawing.size_px;
        let target = |label, format, sample_count, usage| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size_px[0], height: size_px[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let resolved = target("scene", COLOR_FORMAT, 1, attachment | wgpu::TextureUsages::TEXTURE_BINDING);
        Self {
            drawing: Arc::clone(drawing),
            size_px,
            samples: target("scene samples", COLOR_FORMAT, SAMPLES, attachment),
            depth: target("scene depth", DEPTH_FORMAT, SAMPLES, attachment),
            copy_group: copy.group(device, &resolved),
            resolved,
        }
    }
}
