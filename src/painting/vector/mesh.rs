//! Triangle meshes as areas of one colour each.

use std::collections::BTreeSet;

use egui::epaint::{Mesh, Vertex};
use egui::{Color32, Pos2, Rect};

use super::element::{Element, FilledArea};

/// A mesh without a texture. Consecutive triangles of the same colour become one element, so that no seams are visible.
///
/// A triangle with different corner colours gets their mean.
pub(super) fn add_mesh(elements: &mut Vec<Element>, mesh: &Mesh) {
    let mut fill = Color32::TRANSPARENT;
    let mut areas: Vec<FilledArea> = Vec::new();
    let mut finish = |areas: &mut Vec<FilledArea>, fill: Color32| {
        let areas = std::mem::take(areas);
        if !areas.is_empty() && fill.a() > 0 {
            elements.push(Element::Areas { areas, fill });
        }
    };
    let corner = |index: &u32| mesh.vertices.get(*index as usize);
    let mut indices = mesh.indices.as_slice();
    while let [first, second, third, rest @ ..] = indices {
        indices = rest;
        let [Some(a), Some(b), Some(c)] = [corner(first), corner(second), corner(third)] else { continue };
        let shown = mean_color([a, b, c]);
        if shown != fill {
            finish(&mut areas, fill);
            fill = shown;
        }
        let next = rest.first_chunk::<3>().filter(|next| {
            let corners = next.iter().filter_map(corner);
            corners.filter(|vertex| vertex.color == shown).count() == 3
        });
        if let Some(rect) = next.and_then(|next| quad(mesh, &[*first, *second, *third], next)) {
            indices = &rest[3..];
            areas.push(FilledArea::Rect(rect));
        } else {
            areas.push(FilledArea::Triangle(clockwise([a.pos, b.pos, c.pos])));
        }
    }
    finish(&mut areas, fill);
}

/// The corners clockwise on the screen, so that triangles of one element never cancel each other.
fn clockwise([a, b, c]: [Pos2; 3]) -> [Pos2; 3] {
    let turns_right = (b - a).x * (c - a).y - (b - a).y * (c - a).x >= 0.0;
    if turns_right { [a, b, c] } else { [a, c, b] }
}

fn mean_color(corners: [&Vertex; 3]) -> Color32 {
    let channel = |of: fn(&Color32) -> u8| {
        let sum: u32 = corners.iter().map(|vertex| u32::from(of(&vertex.color))).sum();
        ((sum + 1) / 3) as u8
    };
    Color32::from_rgba_premultiplied(channel(Color32::r), channel(Color32::g), channel(Color32::b), channel(Color32::a))
}

/// The axis-aligned rectangle that two triangles form.
pub fn quad(mesh: &Mesh, one: &[u32; 3], other: &[u32; 3]) -> Option<Rect> {
    let corners: BTreeSet<u32> = one.iter().chain(other).copied().collect();
    let shared = one.iter().filter(|index| other.contains(index)).count();
    if corners.len() != 4 || shared != 2 {
        return None;
    }
    let places: Vec<Pos2> =
        corners.iter().map(|index| mesh.vertices.get(*index as usize).map(|it| it.pos)).collect::<Option<_>>()?;
    let rect = Rect::from_points(&places);
    let all = [rect.left_top(), rect.right_top(), rect.left_bottom(), rect.right_bottom()];
    all.iter().all(|corner| places.contains(corner)).then_some(rect)
}
