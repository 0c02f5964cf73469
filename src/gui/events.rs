//! Names and symbols of events.

use egui::{Color32, Painter, Pos2, Shape, Stroke, pos2};

use super::theme::Theme;
use crate::estimator::EventKind;

/// Symbol of an event. Kinds differ in shape, not only in colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EventSymbol {
    /// A line over the whole height of the lane.
    Line,
    Triangle,
    Cross,
    Rhombus,
    Disc,
    Square,
}

pub(crate) fn name_of(kind: EventKind) -> &'static str {
    match kind {
        EventKind::InitializationWaits => "waiting for initialization",
        EventKind::InitializedFromMotion => "initialized from motion",
        EventKind::InitializedFromStationary => "initialized while stationary",
        EventKind::KeyframeChosen => "keyframe",
        EventKind::OldestMarginalized => "oldest frame marginalized",
        EventKind::SecondNewestDropped => "second-newest frame dropped",
        EventKind::OutliersRejected => "outliers rejected",
        EventKind::Stationary => "stationary",
        EventKind::Failure => "failure",
        EventKind::ParameterizationSwitched => "parameterization switched",
        EventKind::MeasurementMissing => "measurement missing",
    }
}

pub(crate) fn look_of(kind: EventKind, theme: &Theme) -> (EventSymbol, Color32) {
    match kind {
        EventKind::InitializedFromMotion | EventKind::InitializedFromStationary => (EventSymbol::Triangle, theme.ok),
        EventKind::Failure => (EventSymbol::Cross, theme.error),
        EventKind::ParameterizationSwitched => (EventSymbol::Rhombus, theme.accent),
        EventKind::MeasurementMissing => (EventSymbol::Square, theme.warn),
        EventKind::Stationary | EventKind::InitializationWaits => (EventSymbol::Disc, theme.text_weak),
        EventKind::OutliersRejected => (EventSymbol::Cross, theme.warn),
        EventKind::KeyframeChosen | EventKind::OldestMarginalized | EventKind::SecondNewestDropped => {
            (EventSymbol::Line, theme.text_weak)
        }
    }
}

/// Paints a symbol of `size` points.
pub(crate) fn paint_mark(painter: &Painter, mark: EventSymbol, center: Pos2, size: f32, color: Color32) {
    let half = size / 2.0;
    let at = |x: f32, y: f32| pos2(center.x + x * half, center.y + y * half);
    match mark {
        EventSymbol::Line => {
            painter.vline(center.x, center.y - half..=center.y + half, Stroke::new(1.0, color));
        }
        EventSymbol::Disc => {
            painter.circle_filled(center, half * 0.8, color);
        }
        EventSymbol::Cross => {
            painter.line_segment([at(-0.8, -0.8), at(0.8, 0.8)], Stroke::new(2.0, color));
            painter.line_segment([at(-0.8, 0.8), at(0.8, -0.8)], Stroke::new(2.0, color));
        }
        EventSymbol::Triangle => fill(painter, vec![at(0.0, -1.0), at(1.0, 0.8), at(-1.0, 0.8)], color),
        EventSymbol::Rhombus => fill(painter, vec![at(0.0, -1.0), at(1.0, 0.0), at(0.0, 1.0), at(-1.0, 0.0)], color),
        EventSymbol::Square => fill(painter, vec![at(-0.8, -0.8), at(0.8, -0.8), at(0.8, 0.8), at(-0.8, 0.8)], color),
    }
}

fn fill(painter: &Painter, corners: Vec<Pos2>, color: Color32) {
    painter.add(Shape::convex_polygon(corners, color, Stroke::NONE));
}
