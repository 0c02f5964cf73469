use egui::epaint::{ClippedShape, Mesh, RectShape};
use egui::{Color32, Pos2, Rect, RichText, Shape, Stroke, Ui, pos2};

use super::super::{HeadlessOptions, svg_of};
use crate::gui::theme::ThemeName;
use crate::painting::svg::document;
use crate::painting::vector::{Drawing, Textures, elements, quad};

const SCREEN: Rect = Rect { min: Pos2::ZERO, max: pos2(100.0, 50.0) };

fn check(shapes: Vec<Shape>, expected: &[&str]) {
    let clipped: Vec<ClippedShape> = shapes.into_iter().map(|shape| clipped(SCREEN, shape)).collect();
    let svg = svg(&clipped, ["200", "100"]);
    for part in expected {
        assert!(svg.contains(part), "{part} is missing in {svg}");
    }
}

fn svg(shapes: &[ClippedShape], size: [&str; 2]) -> String {
    let drawing = Drawing {
        elements: elements(shapes, SCREEN.size()),
        textures: Textures::default(),
        size: SCREEN.size(),
        background: Color32::WHITE,
        title: "title".to_owned(),
        description: "a < b".to_owned(),
    };
    document(&drawing, &size.map(str::to_owned), "p")
}

fn clipped(clip_rect: Rect, shape: Shape) -> ClippedShape {
    ClippedShape { clip_rect, shape, transform_after_tessellation: egui::emath::TSTransform::IDENTITY }
}

#[test]
fn shapes_become_elements_of_their_kind() {
    let red = Stroke::new(1.5, Color32::RED);
    check(
        vec![Shape::circle_filled(pos2(3.0, 4.125), 2.0, Color32::from_black_alpha(51))],
        &[
            r##"<circle cx="3" cy="4.12" r="2" fill="#000000" fill-opacity="0.2"/>"##,
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="200" height="100" viewBox="0 0 100 50""#,
        ],
    );
    // Dashes of one line are one path.
    let dashes = Shape::dashed_line(&[pos2(0.0, 1.0), pos2(9.0, 1.0)], red, 3.0, 3.0);
    check(dashes, &[r##"<path d="M0 1L3 1M6 1L9 1" fill="none" stroke="#ff0000" stroke-width="1.5"/>"##]);
    let line = Shape::line(vec![pos2(0.0, 0.0), pos2(5.0, 5.0), pos2(9.0, 0.0)], red);
    check(vec![line], &[r##"d="M0 0L5 5L9 0" fill="none" stroke="#ff0000""##]);
    let inside =
        RectShape::stroke(Rect::from_min_max(pos2(1.0, 1.0), pos2(11.0, 6.0)), 2, red, egui::StrokeKind::Inside);
    check(vec![Shape::Rect(inside)], &[r#"<rect x="1.75" y="1.75" width="8.5" height="3.5" rx="2" fill="none""#]);
}

#[test]
fn shapes_are_clipped_and_shapes_outside_are_omitted() {
    let clip = Rect::from_min_max(pos2(10.0, 10.0), pos2(30.0, 30.0));
    let circle = |x: f32| clipped(clip, Shape::circle_filled(pos2(x, 20.0), 3.0, Color32::BLUE));
    let shapes = [circle(20.0), circle(29.0), circle(60.0)];
    let svg = svg(&shapes, ["30mm", "15mm"]);
    assert!(svg.contains(r#"width="30mm" height="15mm" viewBox="0 0 100 50""#), "{svg}");
    assert!(svg.contains("<title>title</title>\n<desc>a &lt; b</desc>"), "{svg}");
    assert_eq!((svg.matches("<circle").count(), svg.matches("clip-path=").count()), (2, 1));
    assert!(svg.contains(r#"<clipPath id="p0"><rect x="10" y="10" width="20" height="20"/></clipPath>"#), "{svg}");
    assert_eq!(svg.matches("<g").count(), svg.matches("</g>").count());
}

#[test]
fn meshes_become_one_path_per_colour() {
    let mut mesh = Mesh::default();
    mesh.add_colored_rect(Rect::from_min_max(pos2(0.0, 0.0), pos2(4.0, 2.0)), Color32::RED);
    mesh.add_colored_rect(Rect::from_min_max(pos2(4.0, 0.0), pos2(8.0, 2.0)), Color32::RED);
    mesh.add_colored_rect(Rect::from_min_max(pos2(8.0, 0.0), pos2(12.0, 2.0)), Color32::GREEN);
    assert!(quad(&mesh, &[0, 1, 2], &[2, 1, 3]).is_some() && quad(&mesh, &[0, 1, 2], &[4, 5, 6]).is_none());
    check(
        vec![Shape::mesh(mesh)],
        &[r##"<path d="M0 0H4V2H0ZM4 0H8V2H4Z" fill="#ff0000"/>"##, r##"<path d="M8 0H12V2H8Z" fill="#00ff00"/>"##],
    );
    let mut slanted = Mesh::default();
    for corner in [pos2(0.0, 0.0), pos2(0.0, 5.0), pos2(5.0, 0.0)] {
        slanted.colored_vertex(corner, Color32::RED);
    }
    slanted.add_triangle(0, 1, 2);
    check(vec![Shape::mesh(slanted)], &[r#"d="M0 0L5 0L0 5Z""#]);
}

#[test]
fn texts_stay_texts_with_their_fonts_colours_and_widths() {
    let options = HeadlessOptions { size_px: [400, 120], pixels_per_point: 2.0, theme: ThemeName::Print };
    let draw = || {
        svg_of(options, "p", "texts", |ui: &mut Ui| {
            ui.label("a < b & ρ = 0.25 px");
            ui.label(RichText::new("1.5").monospace().color(Color32::RED));
            ui.painter().line_segment([pos2(0.0, 0.0), pos2(1.0, 1.0)], Stroke::new(1.0, Color32::BLACK));
        })
    };
    let svg = draw();
    assert_eq!(svg, draw());
    assert!(svg.contains(">a &lt; b &amp; ρ = 0.25 px</text>"), "{svg}");
    assert!(svg.contains("monospace") && svg.contains(r##"fill="#ff0000" xml:space="preserve">1.5</text>"##), "{svg}");
    assert!(svg.contains("textLength=") && svg.contains(r#"viewBox="0 0 200 60""#), "{svg}");
}

#[test]
fn symbols_are_outlines_and_the_letters_beside_them_text() {
    let options = HeadlessOptions { size_px: [300, 60], pixels_per_point: 1.0, theme: ThemeName::Print };
    let svg = svg_of(options, "p", "t", |ui: &mut Ui| {
        ui.label("✔ full rank → done");
    });
    assert_eq!(svg.matches("scale(").count(), 2, "{svg}");
    assert!(svg.contains(">full rank</text>") && svg.contains(">done</text>"), "{svg}");
    assert!(!svg.contains('✔') && !svg.contains('→'), "{svg}");
}
