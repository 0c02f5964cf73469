use std::sync::Arc;

use egui::epaint::textures::TextureOptions;
use egui::epaint::{ClippedPrimitive, ImageDelta, Mesh, Primitive, Tessellator, Vertex};
use egui::{Color32, ColorImage, Pos2, Rect, Shape, Stroke, TextureId, TexturesDelta, pos2, vec2};
use image::{Rgba, RgbaImage};

use super::Painter;
use crate::chunks::Chunk;

const GROUND: Color32 = Color32::from_rgb(20, 30, 40);

/// A painter with a white font texture and an image as texture 1.
fn painter_with(image: Option<(ColorImage, TextureOptions)>) -> Painter {
    let mut delta = TexturesDelta::default();
    let white = ColorImage::filled([2, 2], Color32::WHITE);
    delta.push(TextureId::default(), ImageDelta::full(white, TextureOptions::LINEAR));
    if let Some((image, options)) = image {
        delta.push(TextureId::Managed(1), ImageDelta::full(image, options));
    }
    let mut painter = Painter::new();
    painter.set_textures(&delta);
    delta.clear();
    painter
}

fn everything() -> Rect {
    Rect::from_min_max(pos2(-1e4, -1e4), pos2(1e4, 1e4))
}

fn chunk(mesh: Mesh, clip_rect: Rect) -> Arc<Chunk> {
    Arc::new(Chunk::new(vec![ClippedPrimitive { clip_rect, primitive: Primitive::Mesh(mesh) }]))
}

fn paint_mesh(painter: &mut Painter, mesh: Mesh, clip_rect: Rect, size_px: [u32; 2], scale: f32) -> RgbaImage {
    painter.paint(&[chunk(mesh, clip_rect)], size_px, scale, GROUND)
}

fn paint_shape(shape: impl Into<Shape>, size_px: [u32; 2]) -> RgbaImage {
    let mut mesh = Mesh::default();
    Tessellator::new(1.0, Default::default(), [2, 2], Vec::new()).tessellate_shape(shape.into(), &mut mesh);
    paint_mesh(&mut painter_with(None), mesh, everything(), size_px, 1.0)
}

fn triangles(corners: &[(f32, f32)], color: Color32) -> Mesh {
    let mut mesh = Mesh::default();
    for (index, &(x, y)) in corners.iter().enumerate() {
        mesh.vertices.push(Vertex::untextured(pos2(x, y), color));
        mesh.indices.push(index as u32);
    }
    mesh
}

fn rgb(image: &RgbaImage, x: u32, y: u32) -> [u8; 3] {
    let Rgba([red, green, blue, alpha]) = *image.get_pixel(x, y);
    assert_eq!(alpha, 255, "the image is opaque");
    [red, green, blue]
}

/// Pixels that differ from the background.
fn touched(image: &RgbaImage) -> Vec<(u32, u32)> {
    image
        .enumerate_pixels()
        .filter(|(_, _, pixel)| pixel.0 != GROUND.to_array())
        .map(|(column, row, _)| (column, row))
        .collect()
}

#[test]
fn a_rectangle_covers_the_pixels_whose_centres_it_contains() {
    let check = |left: f32, top: f32, right: f32, bottom: f32, expected: [u32; 4]| {
        let mut mesh = Mesh::default();
        mesh.add_colored_rect(Rect::from_min_max(pos2(left, top), pos2(right, bottom)), Color32::RED);
        let image = paint_mesh(&mut painter_with(None), mesh, everything(), [12, 10], 1.0);
        let [x0, y0, x1, y1] = expected;
        let inside: Vec<_> = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))).collect();
        assert_eq!(touched(&image), inside, "{left} {top} {right} {bottom}");
    };
    check(2.0, 3.0, 5.0, 7.0, [2, 3, 5, 7]);
    // A centre on the left or upper edge is inside, on the right or lower edge outside.
    check(2.5, 3.5, 5.5, 7.5, [2, 3, 5, 7]);
    check(2.51, 3.49, 5.51, 7.49, [3, 3, 6, 7]);
    check(-50.0, -50.0, 500.0, 500.0, [0, 0, 12, 10]);
    check(2.6, 3.0, 3.4, 7.0, [0, 0, 0, 0]);
}

#[test]
fn pixels_per_point_scales_and_clips_are_rounded() {
    let mut mesh = Mesh::default();
    mesh.add_colored_rect(everything(), Color32::WHITE);
    let clip = Rect::from_min_max(pos2(1.2, 2.0), pos2(3.3, 4.0));
    let image = paint_mesh(&mut painter_with(None), mesh, clip, [20, 20], 2.0);
    let inside: Vec<_> = (4..8).flat_map(|y| (2..7).map(move |x| (x, y))).collect();
    assert_eq!(touched(&image), inside);
}

#[test]
fn triangles_with_common_edges_paint_each_pixel_once() {
    let veil = Color32::from_rgba_premultiplied(60, 40, 20, 100);
    let once = {
        let mut mesh = Mesh::default();
        mesh.add_colored_rect(everything(), veil);
        rgb(&paint_mesh(&mut painter_with(None), mesh, everything(), [4, 4], 1.0), 1, 1)
    };
    // A fan of triangles with irregular corners that covers the whole image.
    for step in 0..40 {
        let centre = (13.37 + 0.61 * step as f32, 47.9 - 0.83 * step as f32);
        let rim: Vec<(f32, f32)> = (0..23)
            .map(|spoke| {
                let angle = spoke as f32 / 23.0 * std::f32::consts::TAU;
                (32.0 + 120.3 * angle.cos(), 32.0 + 120.3 * angle.sin())
            })
            .collect();
        let corners: Vec<_> = (0..23).flat_map(|spoke| [centre, rim[spoke], rim[(spoke + 1) % 23]]).collect();
        let image = paint_mesh(&mut painter_with(None), triangles(&corners, veil), everything(), [64, 64], 1.0);
        for (column, row, _) in image.enumerate_pixels() {
            assert_eq!(rgb(&image, column, row), once, "pixel {column} {row} of fan {step}");
        }
    }
}

#[test]
fn colours_blend_premultiplied_in_gamma_space() {
    let half_red = Color32::from_rgba_premultiplied(128, 0, 0, 128);
    let image = paint_mesh(
        &mut painter_with(None),
        triangles(&[(0.0, 0.0), (8.0, 0.0), (0.0, 8.0)], half_red),
        everything(),
        [8, 8],
        1.0,
    );
    assert_eq!(rgb(&image, 1, 1), [128 + 10, 15, 20]);
}

#[test]
fn corner_colours_change_linearly() {
    let mut mesh = Mesh::default();
    mesh.add_colored_rect(Rect::from_min_size(Pos2::ZERO, vec2(256.0, 16.0)), Color32::BLACK);
    for vertex in &mut mesh.vertices {
        vertex.color = Color32::from_gray(if vertex.pos.x > 0.0 { 255 } else { 0 });
    }
    let image = paint_mesh(&mut painter_with(None), mesh, everything(), [256, 16], 1.0);
    for column in 0..256 {
        let expected = (f64::from(column) + 0.5) * 255.0 / 256.0;
        for row in 0..16 {
            assert!((f64::from(rgb(&image, column, row)[0]) - expected).abs() <= 1.0, "column {column}");
        }
    }
}

#[test]
fn a_feathered_disc_has_its_area_and_no_holes() {
    let image = paint_shape(Shape::circle_filled(pos2(50.3, 49.6), 30.0, Color32::WHITE), [100, 100]);
    let mut area = 0.0;
    for (column, row, pixel) in image.enumerate_pixels() {
        area += (f64::from(pixel.0[0]) - f64::from(GROUND.r())) / (255.0 - f64::from(GROUND.r()));
        let distance = (f64::from(column) + 0.5 - 50.3).hypot(f64::from(row) + 0.5 - 49.6);
        if distance < 28.5 {
            assert_eq!(rgb(&image, column, row), [255; 3], "hole at {column} {row}");
        } else if distance > 31.5 {
            assert_eq!(rgb(&image, column, row), [20, 30, 40], "speck at {column} {row}");
        }
    }
    let exact = std::f64::consts::PI * 900.0;
    assert!((area / exact - 1.0).abs() < 0.01, "area {area}, expected {exact}");
}

#[test]
fn a_line_carries_its_width() {
    let stroke = Stroke::new(3.0, Color32::WHITE);
    let image = paint_shape(Shape::line_segment([pos2(10.0, 20.0), pos2(90.0, 60.0)], stroke), [100, 80]);
    let ink: f64 = image.pixels().map(|pixel| (f64::from(pixel.0[0]) - 20.0) / 235.0).sum();
    let exact = 3.0 * 80.0_f64.hypot(40.0);
    assert!((ink / exact - 1.0).abs() < 0.02, "ink {ink}, expected {exact}");
}

#[test]
fn textures_are_filtered_between_their_centres() {
    let two = ColorImage::new([2, 1], vec![Color32::from_rgb(0, 100, 200), Color32::from_rgb(200, 100, 0)]);
    let paint = |options| {
        let mut mesh = Mesh::with_texture(TextureId::Managed(1));
        let uv = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
        mesh.add_rect_with_uv(Rect::from_min_size(Pos2::ZERO, vec2(80.0, 4.0)), uv, Color32::WHITE);
        paint_mesh(&mut painter_with(Some((two.clone(), options))), mesh, everything(), [80, 4], 1.0)
    };
    let nearest = paint(TextureOptions::NEAREST);
    assert_eq!(rgb(&nearest, 39, 1), [0, 100, 200]);
    assert_eq!(rgb(&nearest, 40, 1), [200, 100, 0]);
    let linear = paint(TextureOptions::LINEAR);
    assert_eq!(rgb(&linear, 0, 1), [0, 100, 200], "clamped at the edge");
    for column in 20..60 {
        let expected = 200.0 * ((f64::from(column) + 0.5) / 80.0 * 2.0 - 0.5);
        let [red, green, blue] = rgb(&linear, column, 3);
        assert!((f64::from(red) - expected).abs() <= 1.5, "column {column}: {red}, expected {expected}");
        assert!((f64::from(blue) - (200.0 - expected)).abs() <= 1.5);
        assert_eq!(green, 100);
    }
}

#[test]
fn a_texture_that_lies_texel_on_pixel_is_copied() {
    let texels: Vec<Color32> = (0..64).map(|index| Color32::from_rgb(index * 3, 255 - index, index)).collect();
    let image = ColorImage::new([8, 8], texels.clone());
    let mut mesh = Mesh::with_texture(TextureId::Managed(1));
    let uv = Rect::from_min_max(pos2(0.25, 0.25), pos2(0.75, 0.75));
    mesh.add_rect_with_uv(Rect::from_min_size(pos2(3.0, 5.0), vec2(4.0, 4.0)), uv, Color32::WHITE);
    let painted =
        paint_mesh(&mut painter_with(Some((image, TextureOptions::LINEAR))), mesh, everything(), [16, 16], 1.0);
    for row in 0..4 {
        for column in 0..4 {
            let expected = texels[(row + 2) * 8 + column + 2];
            assert_eq!(rgb(&painted, column as u32 + 3, row as u32 + 5), [expected.r(), expected.g(), expected.b()]);
        }
    }
}

#[test]
fn a_rotated_texture_follows_its_corners() {
    let texels: Vec<Color32> = (0..16).map(|index| Color32::from_gray(index * 16)).collect();
    let image = ColorImage::new([4, 4], texels.clone());
    let mut mesh = Mesh::with_texture(TextureId::Managed(1));
    // A rotation by 90°: u runs down, v runs to the left.
    for (x, y, u, v) in [(8.0, 0.0, 0.0, 0.0), (8.0, 8.0, 1.0, 0.0), (0.0, 8.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)] {
        mesh.vertices.push(Vertex { pos: pos2(x, y), uv: pos2(u, v), color: Color32::WHITE });
    }
    mesh.indices = vec![0, 1, 2, 0, 2, 3];
    let painted =
        paint_mesh(&mut painter_with(Some((image, TextureOptions::NEAREST))), mesh, everything(), [8, 8], 1.0);
    for (column, row, pixel) in painted.enumerate_pixels() {
        let (u, v) = (row / 2, 3 - column / 2);
        assert_eq!(pixel.0[0], texels[(v * 4 + u) as usize].r(), "{column} {row}");
    }
}

#[test]
fn a_region_of_a_texture_can_change_and_a_freed_one_is_gone() {
    let mut painter = painter_with(Some((ColorImage::filled([4, 4], Color32::RED), TextureOptions::NEAREST)));
    let mut delta = TexturesDelta::default();
    let patch = ColorImage::filled([2, 9], Color32::BLUE);
    delta.push(TextureId::Managed(1), ImageDelta::partial([1, 2], patch, TextureOptions::NEAREST));
    painter.set_textures(&delta);
    delta.clear();
    let mut mesh = Mesh::with_texture(TextureId::Managed(1));
    let uv = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
    mesh.add_rect_with_uv(Rect::from_min_size(Pos2::ZERO, vec2(4.0, 4.0)), uv, Color32::WHITE);
    let image = paint_mesh(&mut painter, mesh.clone(), everything(), [4, 4], 1.0);
    for (column, row, _) in image.enumerate_pixels() {
        let blue = (1..3).contains(&column) && row >= 2;
        assert_eq!(rgb(&image, column, row), if blue { [0, 0, 255] } else { [255, 0, 0] });
    }
    delta.free(TextureId::Managed(1));
    painter.free_textures(&delta);
    delta.clear();
    assert!(touched(&paint_mesh(&mut painter, mesh, everything(), [4, 4], 1.0)).is_empty());
}

#[test]
fn invalid_triangles_are_skipped() {
    let mut mesh = triangles(&[(0.0, 0.0), (f32::NAN, 0.0), (0.0, 8.0)], Color32::WHITE);
    mesh.append(triangles(&[(0.0, 0.0), (f32::INFINITY, 0.0), (0.0, 8.0)], Color32::WHITE));
    mesh.append(triangles(&[(3.0, 3.0), (3.0, 3.0), (3.0, 3.0)], Color32::WHITE));
    mesh.indices.extend([700, 701, 702]);
    assert!(touched(&paint_mesh(&mut painter_with(None), mesh, everything(), [8, 8], 1.0)).is_empty());
    // Very large but finite: covers everything.
    let mesh = triangles(&[(-1e9, -1e9), (1e9, -1e9), (0.0, 1e9)], Color32::WHITE);
    assert_eq!(touched(&paint_mesh(&mut painter_with(None), mesh, everything(), [8, 8], 1.0)).len(), 64);
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let paint = || {
        let shapes = (0..60).map(|index| {
            let at = pos2(7.3 * index as f32, 300.0 - 4.9 * index as f32);
            Shape::circle_filled(at, 3.0 + index as f32, Color32::from_rgba_unmultiplied(index * 4, 200, 90, 77))
        });
        paint_shape(Shape::Vec(shapes.collect()), [320, 333])
    };
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(paint);
    let many = rayon::ThreadPoolBuilder::new().num_threads(7).build().unwrap().install(paint);
    assert!(!touched(&alone).is_empty());
    assert_eq!(alone, many);
}

/// Part of the image in which the test of updates paints.
fn middle() -> Rect {
    Rect::from_min_max(pos2(5.0, 5.0), pos2(235.0, 170.0))
}

fn tessellated(shapes: impl IntoIterator<Item = Shape>) -> Arc<Chunk> {
    let mut mesh = Mesh::default();
    let mut tessellator = Tessellator::new(1.0, Default::default(), [2, 2], Vec::new());
    for shape in shapes {
        tessellator.tessellate_shape(shape, &mut mesh);
    }
    chunk(mesh, middle())
}

/// A disc and lines of one colour.
fn lines(color: Color32) -> Arc<Chunk> {
    let disc = Shape::circle_filled(pos2(150.0, 90.0), 70.0, Color32::DARK_GREEN);
    let lines = (0..30).map(|line| {
        let from = pos2(7.0 * line as f32, 3.0);
        Shape::line_segment([from, from + vec2(90.0, 140.0)], Stroke::new(1.5, color))
    });
    tessellated(std::iter::once(disc).chain(lines))
}

/// A line over the whole height.
fn cursor(x: f32) -> Arc<Chunk> {
    tessellated([Shape::line_segment([pos2(x, 0.0), pos2(x, 180.0)], Stroke::new(1.0, Color32::WHITE))])
}

/// A rectangle with the image, tinted.
fn textured() -> Arc<Chunk> {
    let mut image = Mesh::with_texture(TextureId::Managed(1));
    let uv = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
    image.add_rect_with_uv(Rect::from_min_size(pos2(60.0, 20.0), vec2(170.0, 130.0)), uv, Color32::from_gray(200));
    chunk(image, middle())
}

#[test]
fn an_updated_image_equals_one_painted_again() {
    const SIZE: [u32; 2] = [241, 187];
    let texels = |shade: u8| ColorImage::new([3, 40], vec![Color32::from_rgb(shade, 90, 10); 120]);
    let mut kept = painter_with(Some((texels(30), TextureOptions::LINEAR)));
    // Most chunks do not change between images. Every image has another cursor, some have lines of another colour below
    // it, and the texture changes twice.
    let [orange, blue] = [[250, 120, 30], [20, 60, 250]]
        .map(|[red, green, blue]| lines(Color32::from_rgba_unmultiplied(red, green, blue, 180)));
    let image = textured();
    let chunks = |moved: u8| {
        let lines = if moved % 7 == 3 { &blue } else { &orange };
        [Arc::clone(lines), Arc::clone(&image), cursor(40.0 + f32::from(moved) * 3.7)]
    };
    kept.update(&chunks(0), SIZE, 1.0, GROUND);
    assert_eq!(kept.changes().count(), 6, "at first every row of tiles is new");
    kept.update(&chunks(0), SIZE, 1.0, GROUND);
    assert_eq!(kept.changes().count(), 0, "nothing changed");
    let mut shown = kept.paint(&chunks(0), SIZE, 1.0, GROUND);
    for moved in 0_u8..40 {
        let mut delta = TexturesDelta::default();
        if moved == 20 {
            delta.push(
                TextureId::Managed(1),
                ImageDelta::partial([0, 39], ColorImage::filled([3, 1], Color32::WHITE), TextureOptions::LINEAR),
            );
        } else if moved == 30 {
            delta.push(TextureId::Managed(1), ImageDelta::full(texels(moved), TextureOptions::NEAREST));
        }
        kept.set_textures(&delta);
        let image = kept.paint(&chunks(moved), SIZE, 1.0, GROUND);
        let mut fresh = painter_with(Some((texels(30), TextureOptions::LINEAR)));
        if moved >= 20 {
            let patch = ColorImage::filled([3, 1], Color32::WHITE);
            delta.push(TextureId::Managed(1), ImageDelta::partial([0, 39], patch, TextureOptions::LINEAR));
        }
        if moved >= 30 {
            delta.push(TextureId::Managed(1), ImageDelta::full(texels(30), TextureOptions::NEAREST));
        }
        fresh.set_textures(&delta);
        delta.clear();
        assert!(image == fresh.paint(&chunks(moved), SIZE, 1.0, GROUND), "image {moved}");
        // The reported rectangles contain all differences.
        for (rect, part) in kept.changes() {
            for (index, color) in part.pixels.iter().enumerate() {
                let (column, row) = (rect.at[0] + index % rect.size[0], rect.at[1] + index / rect.size[0]);
                shown.put_pixel(column as u32, row as u32, Rgba(color.to_array()));
            }
        }
        assert!(shown == image, "changes of image {moved}");
    }
}
