//! The wgpu pipelines of the scene, and the formats of their targets.

/// Samples per pixel, as on the CPU.
pub(super) const SAMPLES: u32 = 4;
pub(super) const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Creates the pipelines of the scene's shader.
pub(super) struct PipelineMaker<'a> {
    pub(super) device: &'a wgpu::Device,
    pub(super) shader: &'a wgpu::ShaderModule,
    pub(super) uniform_layout: &'a wgpu::BindGroupLayout,
    pub(super) texture_layout: &'a wgpu::BindGroupLayout,
}

impl PipelineMaker<'_> {
    /// A pipeline that draws into the targets of the scene with a depth test.
    pub(super) fn scene(
        &self,
        [vertex, fragment]: [&str; 2],
        buffer: Option<wgpu::VertexBufferLayout<'_>>,
    ) -> wgpu::RenderPipeline {
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(vertex),
            bind_group_layouts: &[Some(self.uniform_layout), Some(self.texture_layout)]
                [..if fragment == "image_fragment" { 2 } else { 1 }],
            immediate_size: 0,
        });
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(vertex),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: self.shader,
                entry_point: Some(vertex),
                buffers: &[buffer],
                compilation_options: wgpu::PipelineCompilationOptions::default(),
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::GreaterEqual),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState { count: SAMPLES, ..wgpu::MultisampleState::default() },
            fragment: Some(wgpu::FragmentState {
                module: self.shader,
                entry_point: Some(fragment),
                targets: &[Some(COLOR_FORMAT.into())],
                compilation_options: wgpu::PipelineCompilationOptions::default(),
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
