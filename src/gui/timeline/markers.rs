//! Markers on the timeline: flags with their names in the ruler.

use egui::text::{LayoutJob, TextWrapping};
use egui::{Painter, Rangef, Rect, Shape, Stroke, pos2, vec2};

use crate::gui::plot::PlotArea;
use crate::gui::theme::{Theme, label_font};
use crate::session::{Marker, Markers};

/// Width of a flag in points.
const FLAG: f32 = 8.0;
/// Height of a name in points.
const NAME_HEIGHT: f32 = 14.0;
/// Gaps between flag, name and the next flag in points.
const GAP: f32 = 3.0;
/// Width of a name in points, at least and at most.
const NAME_WIDTH: Rangef = Rangef { min: 18.0, max: 160.0 };

/// Distance in points within which the pointer is at a marker.
const REACH: f32 = 5.0;

/// Markers in the visible range, each with its screen x and the room for its name in points.
fn shown<'a>(area: &PlotArea, markers: &'a Markers) -> Vec<(&'a Marker, f32, f32)> {
    let inside = |marker: &&Marker| (area.begin_ns..=area.end_ns).contains(&marker.stamp_ns);
    let places: Vec<(&Marker, f32)> =
        markers.iter().filter(inside).map(|marker| (marker, area.x(marker.stamp_ns))).collect();
    let ends = places.iter().skip(1).map(|(_, x)| *x - GAP).chain([area.rect.right()]);
    let room = places.iter().zip(ends).map(|((marker, x), end)| (*marker, *x, end - x - FLAG - GAP));
    room.collect()
}

/// Ranges of screen x in the ruler that flags and names cover.
pub(super) fn covered(painter: &Painter, theme: &Theme, area: &PlotArea, markers: &Markers) -> Vec<Rangef> {
    let covered = |(marker, x, room): &(&Marker, f32, f32)| {
        let name = name_of(painter, theme, marker, *room).map_or(0.0, |galley| galley.size().x + GAP);
        Rangef::new(*x, x + FLAG + name)
    };
    shown(area, markers).iter().map(covered).collect()
}

/// The name of a marker, cut to its room; `None` without a name or room.
fn name_of(painter: &Painter, theme: &Theme, marker: &Marker, room: f32) -> Option<std::sync::Arc<egui::Galley>> {
    if marker.name.is_empty() || room < NAME_WIDTH.min {
        return None;
    }
    let mut job = LayoutJob::simple_singleline(marker.name.clone(), label_font(), theme.ok);
    job.wrap = TextWrapping::truncate_at_width(room.min(NAME_WIDTH.max));
    Some(painter.layout_job(job))
}

/// Draws a line, a flag and the name of each marker.
pub(super) fn paint(painter: &Painter, theme: &Theme, area: &PlotArea, markers: &Markers) {
    for (marker, x, room) in shown(area, markers) {
        let top = area.rect.top();
        painter.vline(x, area.rect.y_range(), Stroke::new(1.0, theme.ok.gamma_multiply(0.7)));
        let flag = vec![pos2(x, top), pos2(x + FLAG, top + 4.0), pos2(x, top + 8.0)];
        painter.add(Shape::convex_polygon(flag, theme.ok, Stroke::NONE));
        if let Some(galley) = name_of(painter, theme, marker, room) {
            let place = pos2(x + FLAG + GAP, top);
            let ground = Rect::from_min_size(place, vec2(galley.size().x, NAME_HEIGHT)).expand2(vec2(1.0, 0.0));
            painter.rect_filled(ground, 2.0, theme.surface);
            painter.galley(place, galley, theme.ok);
        }
    }
}

/// The marker at a screen x.
pub(super) fn at<'a>(area: &PlotArea, markers: &'a Markers, x: f32) -> Option<&'a Marker> {
    let distance = |marker: &Marker| (area.x(marker.stamp_ns) - x).abs();
    let near = markers.iter().filter(|marker| distance(marker) <= REACH);
    near.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_end_before_the_next_marker_and_the_nearest_one_is_under_the_pointer() {
        let rect = Rect::from_min_max(pos2(100.0, 0.0), pos2(1100.0, 200.0));
        let area = PlotArea { rect, begin_ns: 0, end_ns: 1000, low: 0.0, high: 1.0, middle: None };
        let markers =
            Markers::new([(100, "a"), (104, "b"), (500, "c"), (2000, "d")].map(|(at, it)| Marker::new(at, it)).into());
        let shown = shown(&area, &markers);
        let rooms: Vec<f32> = shown.iter().map(|(_, _, room)| room.round()).collect();
        assert_eq!(rooms, [-10.0, 382.0, 489.0], "up to the next marker and to the edge");
        let name_at = |x: f32| at(&area, &markers, x).map(|marker| marker.name.as_str());
        assert_eq!(
            [name_at(201.0), name_at(203.0), name_at(598.0), name_at(620.0)],
            [Some("a"), Some("b"), Some("c"), None]
        );
    }
}
