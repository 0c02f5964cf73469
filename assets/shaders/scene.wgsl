// The scene's shapes arrive in pixels of their view, with a depth that is 1 at the near plane and 0 at infinity.

struct View {
    size_px: vec2<f32>,
    padding: vec2<f32>,
};

@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(0) var image: texture_2d<f32>;
@group(1) @binding(1) var image_sampler: sampler;

struct Colored {
    @builtin(position) position: vec4<f32>,
    @location(0) color: vec4<f32>,
};

fn clip_position(place: vec3<f32>) -> vec4<f32> {
    let x = 2.0 * place.x / view.size_px.x - 1.0;
    let y = 1.0 - 2.0 * place.y / view.size_px.y;
    return vec4<f32>(x, y, place.z, 1.0);
}

@fragment
fn color_fragment(in: Colored) -> @location(0) vec4<f32> {
    return in.color;
}

@vertex
fn face_vertex(@location(0) place: vec3<f32>, @location(1) color: vec4<f32>) -> Colored {
    return Colored(clip_position(place), color);
}

// A segment becomes a rectangle, a little longer at both ends so that bends have no notch.
@vertex
fn segment_vertex(
    @builtin(vertex_index) index: u32,
    @location(0) start: vec3<f32>,
    @location(1) end: vec3<f32>,
    @location(2) half_width: f32,
    @location(3) color: vec4<f32>,
) -> Colored {
    let reach = end.xy - start.xy;
    let length_px = length(reach);
    var along = vec2<f32>(1.0, 0.0);
    if length_px > 1e-3 {
        along = reach / length_px;
    }
    let across = vec2<f32>(-along.y, along.x) * half_width;
    let at_end = index == 1u || index == 2u || index == 4u;
    let side = select(-1.0, 1.0, index == 0u || index == 1u || index == 3u);
    let longer = along * half_width * select(-0.5, 0.5, at_end);
    let place = select(start, end, at_end);
    return Colored(clip_position(vec3<f32>(place.xy + longer + across * side, place.z)), color);
}

// Corners of an octagon as six triangles from its first corner.
@vertex
fn disc_vertex(
    @builtin(vertex_index) index: u32,
    @location(0) centre: vec3<f32>,
    @location(1) radius: f32,
    @location(2) color: vec4<f32>,
) -> Colored {
    let triangle = index / 3u;
    let corner = index % 3u;
    let number = select(triangle + corner, 0u, corner == 0u);
    let angle = (f32(number) + 0.5) * 0.78539816;
    // As large as the circle it stands for.
    let reach = radius * 1.0539;
    let place = centre.xy + vec2<f32>(cos(angle), sin(angle)) * reach;
    return Colored(clip_position(vec3<f32>(place, centre.z)), color);
}

struct ImageCorner {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
};

// Depth is one over the distance up to a factor, which makes it one over the w that keeps the image straight.
@vertex
fn image_vertex(@location(0) place: vec3<f32>, @location(1) uv: vec2<f32>) -> ImageCorner {
    return ImageCorner(clip_position(place) / place.z, uv);
}

@fragment
fn image_fragment(in: ImageCorner) -> @location(0) vec4<f32> {
    let grey = textureSample(image, image_sampler, in.uv).r;
    return vec4<f32>(grey, grey, grey, 1.0);
}
