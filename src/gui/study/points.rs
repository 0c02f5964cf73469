//! Many points as one mesh, and a search for the point under the pointer.

use std::sync::Arc;

use egui::epaint::Mesh;
use egui::{Color32, Painter, Pos2, Rect, Shape, Stroke, Vec2};

/// Half of the side of a point, in points of the screen.
const HALF: f32 = 1.5;
/// Distance in points within which the pointer hits a point.
const REACH: f32 = 6.0;

/// Points with the rows that they represent.
#[derive(Debug, Default)]
pub(super) struct Points {
    mesh: Arc<Mesh>,
    /// Sorted by ascending x.
    places: Vec<(Pos2, usize)>,
}

impl Points {
    /// Points of one colour, given as position and row.
    pub(super) fn new(mut places: Vec<(Pos2, usize)>, color: Color32) -> Self {
        let mut mesh = Mesh::default();
        mesh.reserve_vertices(4 * places.len());
        mesh.reserve_triangles(2 * places.len());
        for (place, _) in &places {
            mesh.add_colored_rect(Rect::from_center_size(*place, Vec2::splat(2.0 * HALF)), color);
        }
        places.sort_by(|(a, row_a), (b, row_b)| a.x.total_cmp(&b.x).then(row_a.cmp(row_b)));
        Self { mesh: Arc::new(mesh), places }
    }

    pub(super) fn paint(&self, painter: &Painter) {
        if !self.places.is_empty() {
            painter.add(Shape::Mesh(Arc::clone(&self.mesh)));
        }
    }

    /// Row of the point nearest to the pointer, with its distance; `None` if none is within [`REACH`].
    pub(super) fn at(&self, pointer: Pos2) -> Option<(usize, f32)> {
        let from = self.places.partition_point(|(place, _)| place.x < pointer.x - REACH);
        let near = self.places[from..].iter().take_while(|(place, _)| place.x <= pointer.x + REACH);
        let near = near.map(|(place, row)| (*row, place.distance(pointer)));
        near.filter(|(_, distance)| *distance <= REACH).min_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    pub(super) fn mark(&self, painter: &Painter, row: usize, color: Color32) {
        for (place, _) in self.places.iter().filter(|(_, of)| *of == row) {
            painter.circle_stroke(*place, 5.0, Stroke::new(2.0, color));
        }
    }

    #[cfg(test)]
    pub(super) fn places(&self) -> &[(Pos2, usize)] {
        &self.places
    }
}
