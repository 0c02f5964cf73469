// Copies an image pixel by pixel.

struct Copied {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
};

@group(0) @binding(0) var source_image: texture_2d<f32>;
@group(0) @binding(1) var source_sampler: sampler;

// One triangle over the whole viewport.
@vertex
fn copy_vertex(@builtin(vertex_index) index: u32) -> Copied {
    let uv = vec2<f32>(f32(index & 1u) * 2.0, f32(index >> 1u) * 2.0);
    return Copied(vec4<f32>(uv.x * 2.0 - 1.0, 1.0 - uv.y * 2.0, 0.0, 1.0), uv);
}

@fragment
fn copy_gamma(in: Copied) -> @location(0) vec4<f32> {
    return vec4<f32>(textureSample(source_image, source_sampler, in.uv).rgb, 1.0);
}

// For targets that encode what is written to them.
@fragment
fn copy_linear(in: Copied) -> @location(0) vec4<f32> {
    let gamma = textureSample(source_image, source_sampler, in.uv).rgb;
    let low = gamma / 12.92;
    let high = pow((gamma + 0.055) / 1.055, vec3<f32>(2.4));
    return vec4<f32>(select(high, low, gamma < vec3<f32>(0.04045)), 1.0);
}
