use std::sync::Arc;

use egui::epaint::{
    BandPoint, BandShape, Brush, CircleShape, ClippedPrimitive, ClippedShape, ColorMode, CubicBezierShape,
    EllipseShape, Mesh, PathShape, PathStroke, Primitive, QuadraticBezierShape, RectShape, TextShape,
};
use egui::{Color32, Context, FontId, Pos2, RawInput, Rect, Shape, Stroke, StrokeKind, TextureId, pos2};

use super::shape_hash::ShapeHasher;
use super::{Chunk, Tessellation};

/// Shapes of a window with texts, lines and a path of a thousand points; `cursor` moves a line that is painted second
/// to last.
fn shapes(context: &Context, cursor: f32, words: &[&str]) -> Vec<ClippedShape> {
    let screen_rect = Some(Rect::from_min_max(Pos2::ZERO, pos2(400.0, 1500.0)));
    let mut output = context.run_ui(RawInput { screen_rect, ..RawInput::default() }, |ui| {
        for word in words {
            ui.label(*word);
        }
        ui.group(|ui| {
            for number in 0..80 {
                ui.label(format!("value {number}"));
            }
        });
        let painter = ui.painter();
        let stroke = Stroke::new(1.0, Color32::RED);
        let wave = (0..1000).map(|index| pos2(0.4 * index as f32, 300.0 + (0.1 * index as f32).sin())).collect();
        painter.add(Shape::line(wave, stroke));
        painter.line_segment([pos2(cursor, 0.0), pos2(cursor, 1500.0)], stroke);
        painter.circle_filled(pos2(20.0, 30.0), 5.0, Color32::BLUE);
    });
    output.textures_delta.clear();
    output.shapes
}

/// All triangles in the order of painting: clip rectangle, texture and corners.
fn triangles<'a>(primitives: impl Iterator<Item = &'a ClippedPrimitive>) -> Vec<String> {
    primitives
        .flat_map(|clipped| {
            let Primitive::Mesh(mesh) = &clipped.primitive else { panic!("a mesh") };
            mesh.indices.chunks_exact(3).map(move |corners| {
                let corners: Vec<_> = corners.iter().map(|index| mesh.vertices[*index as usize]).collect();
                format!("{:?} {:?} {corners:?}", clipped.clip_rect, mesh.texture_id)
            })
        })
        .collect()
}

fn new_ones(before: &[Arc<Chunk>], after: &[Arc<Chunk>]) -> usize {
    after.iter().filter(|chunk| !before.iter().any(|old| Arc::ptr_eq(old, chunk))).count()
}

#[test]
fn chunks_paint_what_the_context_would_and_only_changed_ones_are_new() {
    let context = Context::default();
    let mut tessellation = Tessellation::default();
    let mut frame = |cursor: f32, words: &[&str]| {
        let shapes = shapes(&context, cursor, words);
        let chunks = tessellation.chunks(&context, shapes.clone(), 1.0);
        let whole = context.tessellate(shapes, 1.0);
        let parts = chunks.iter().flat_map(|chunk| &chunk.primitives);
        assert!(triangles(parts) == triangles(whole.iter()), "cursor at {cursor}");
        chunks
    };
    frame(10.0, &[]);
    let first = frame(10.0, &[]);
    assert!(first.len() > 5, "{} chunks", first.len());
    let same = frame(10.0, &[]);
    assert_eq!((new_ones(&first, &same), same.len()), (0, first.len()), "nothing changed");
    let moved = frame(11.0, &[]);
    assert_eq!(new_ones(&same, &moved), 1, "the cursor moved");
    frame(11.0, &["one more"]);
    // A label above moves the others, but not the path.
    let shifted = frame(11.0, &["one more"]);
    let path = |chunks: &[Arc<Chunk>]| {
        chunks
            .iter()
            .find(|chunk| matches!(&chunk.primitives[..], [one] if matches!(&one.primitive, Primitive::Mesh(mesh) if mesh.vertices.len() > 2000)))
            .map(Arc::as_ptr)
    };
    assert!(path(&moved).is_some());
    assert_eq!(path(&moved), path(&shifted), "the path stayed");
}

#[test]
fn another_scale_tessellates_everything_anew() {
    let context = Context::default();
    let mut tessellation = Tessellation::default();
    let shapes = shapes(&context, 10.0, &[]);
    let fine = tessellation.chunks(&context, shapes.clone(), 1.0);
    context.set_pixels_per_point(2.0);
    let coarse = tessellation.chunks(&context, shapes, 2.0);
    assert_eq!(new_ones(&fine, &coarse), coarse.len());
}

#[test]
fn chunks_end_at_the_same_shapes_in_every_context() {
    // Every context lays out its texts again, at other addresses.
    let contexts: Vec<_> = (0..20).map(|_| Context::default()).collect();
    let sizes = contexts.iter().map(|context| {
        let chunks = Tessellation::default().chunks(context, shapes(context, 10.0, &[]), 1.0);
        chunks.iter().map(|chunk| triangles(chunk.primitives.iter()).len()).collect::<Vec<_>>()
    });
    let sizes: Vec<_> = sizes.collect();
    assert!(sizes.iter().all(|other| *other == sizes[0]), "triangles per chunk: {sizes:?}");
    assert!(sizes[0].len() > 5, "triangles per chunk: {:?}", sizes[0]);
}

/// Hash of a shape; `None` if it cannot be compared.
fn hash_of(shape: &Shape) -> Option<u64> {
    let mut hasher = ShapeHasher::default();
    hasher.add(&ClippedShape::new(Rect::EVERYTHING, shape.clone()));
    hasher.hash()
}

#[test]
fn every_field_of_a_shape_counts() {
    let stroke = Stroke::new(1.0, Color32::RED);
    let path_stroke = PathStroke::new(1.0, Color32::RED);
    let [a, b, c, d] = [[1.0, 2.0], [3.0, 5.0], [8.0, 4.0], [6.0, 7.0]].map(|[x, y]| pos2(x, y));
    let area = Rect::from_min_max(a, b);
    let rect = || RectShape::filled(area, 2, Color32::RED);
    let path = || PathShape { points: vec![a, b, c], closed: true, fill: Color32::RED, stroke: path_stroke.clone() };
    let band = || BandShape {
        points: [a, b].map(|point| BandPoint::from_pos_and_width(point, 1.0)).to_vec(),
        fill: Color32::RED,
        stroke,
        stroke_kind: StrokeKind::Middle,
        angle: 0.0,
    };
    let context = Context::default();
    // Fonts are available after a first frame.
    shapes(&context, 0.0, &[]);
    let galley =
        |text: &str| context.fonts_mut(|fonts| fonts.layout_no_wrap(text.to_owned(), FontId::default(), Color32::RED));
    let text = || TextShape::new(a, galley("one"), Color32::RED);
    let mesh = |texture: u64, uv: Rect| {
        let mut mesh = Mesh::with_texture(TextureId::Managed(texture));
        mesh.add_rect_with_uv(area, uv, Color32::RED);
        Shape::mesh(mesh)
    };
    let brush = |texture: u64| Some(Arc::new(Brush { fill_texture_id: TextureId::User(texture), uv: area }));
    let shapes: Vec<Shape> = vec![
        Shape::Noop,
        Shape::Vec(vec![]),
        Shape::Vec(vec![Shape::Noop]),
        CircleShape::filled(a, 2.0, Color32::RED).into(),
        CircleShape::filled(b, 2.0, Color32::RED).into(),
        CircleShape::filled(a, 3.0, Color32::RED).into(),
        CircleShape::filled(a, 2.0, Color32::BLUE).into(),
        CircleShape::stroke(a, 2.0, stroke).into(),
        EllipseShape::filled(a, b.to_vec2(), Color32::RED).into(),
        EllipseShape { angle: 1.0, ..EllipseShape::filled(a, b.to_vec2(), Color32::RED) }.into(),
        Shape::line_segment([a, b], stroke),
        Shape::line_segment([a, b], Stroke::new(2.0, Color32::RED)),
        Shape::line_segment([a, c], stroke),
        path().into(),
        PathShape { closed: false, ..path() }.into(),
        PathShape { fill: Color32::BLUE, ..path() }.into(),
        PathShape { points: vec![a, b], ..path() }.into(),
        PathShape { stroke: path_stroke.clone().inside(), ..path() }.into(),
        band().into(),
        BandShape { angle: 1.0, ..band() }.into(),
        BandShape { stroke_kind: StrokeKind::Inside, ..band() }.into(),
        rect().into(),
        RectShape { rect: Rect::from_min_max(a, c), ..rect() }.into(),
        RectShape { corner_radius: 3.into(), ..rect() }.into(),
        RectShape { fill: Color32::BLUE, ..rect() }.into(),
        RectShape { stroke, ..rect() }.into(),
        RectShape { stroke_kind: StrokeKind::Inside, ..rect() }.into(),
        RectShape { round_to_pixels: Some(true), ..rect() }.into(),
        RectShape { round_to_pixels: Some(false), ..rect() }.into(),
        RectShape { blur_width: 1.0, ..rect() }.into(),
        RectShape { angle: 1.0, ..rect() }.into(),
        RectShape { brush: brush(1), ..rect() }.into(),
        RectShape { brush: brush(2), ..rect() }.into(),
        text().into(),
        TextShape { pos: b, ..text() }.into(),
        TextShape { galley: galley("two"), ..text() }.into(),
        TextShape { underline: stroke, ..text() }.into(),
        TextShape { fallback_color: Color32::BLUE, ..text() }.into(),
        TextShape { override_text_color: Some(Color32::BLUE), ..text() }.into(),
        TextShape { opacity_factor: 0.5, ..text() }.into(),
        TextShape { angle: 1.0, ..text() }.into(),
        mesh(1, area),
        mesh(2, area),
        mesh(1, Rect::ZERO),
        QuadraticBezierShape::from_points_stroke([a, b, c], false, Color32::RED, stroke).into(),
        QuadraticBezierShape::from_points_stroke([a, b, d], false, Color32::RED, stroke).into(),
        CubicBezierShape::from_points_stroke([a, b, c, d], false, Color32::RED, stroke).into(),
        CubicBezierShape::from_points_stroke([a, b, d, c], false, Color32::RED, stroke).into(),
    ];
    let hashes: Vec<u64> = shapes.iter().map(|shape| hash_of(shape).unwrap()).collect();
    for (number, hash) in hashes.iter().enumerate() {
        assert_eq!(hashes.iter().position(|other| other == hash), Some(number), "{:?}", shapes[number]);
        assert_eq!(hash_of(&shapes[number]), Some(*hash), "a hash is repeatable");
    }
    let coded = PathStroke { color: ColorMode::UV(Arc::new(|_, _| Color32::RED)), ..path_stroke };
    assert_eq!(hash_of(&PathShape { stroke: coded, ..path() }.into()), None, "code cannot be compared");
}
