//! Value range of a small plot, and marks where another run's curve leaves it.

use egui::{Painter, Rangef, Shape, Stroke, pos2};

use super::model::ParameterCurve;
use crate::gui::plot::{Curve, PlotArea};
use crate::gui::theme::RunStyle;

/// Largest extension of the range on either side by other runs, as a ratio of the shown run's range.
const WIDENING: f64 = 0.5;
/// Ratio of the whole range to the middle part from which on the scale is broken.
const BROKEN_FROM: f64 = 3.0;
/// Half the height of the middle part of a broken scale, in standard deviations of the last value.
const MIDDLE_SIGMAS: f64 = 4.5;

/// Smallest and largest value; `None` without values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Extent(Option<(f64, f64)>);

impl Extent {
    fn of(values: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self(values.into_iter().reduce(|(low, high), (lowest, highest)| (low.min(lowest), high.max(highest))))
    }
}

/// Value range of the plot, and the middle part of a broken scale.
///
/// It contains the shown run's curve (`own`) with its ±3σ band and the ground truth. Where the first bands are so wide
/// that they would flatten the last one, the scale is broken: the middle part shows the last band. A run that was
/// converted from another parameterization can be far away, so the other runs extend the range only slightly.
pub(super) fn value_range(
    own: Option<(f64, f64)>,
    ground_truth: Option<f64>,
    others: impl Iterator<Item = (f64, f64)>,
    parameter: &ParameterCurve,
) -> ((f64, f64), Option<[f64; 2]>) {
    let last = parameter
        .values
        .iter()
        .zip(&parameter.sigmas)
        .rev()
        .find(|(value, sigma)| value.is_finite() && sigma.is_finite())
        .map(|(value, sigma)| (value - MIDDLE_SIGMAS * sigma, value + MIDDLE_SIGMAS * sigma));
    let bands = parameter.lower.iter().copied().zip(parameter.upper.iter().copied());
    let bands = bands.filter(|(lower, upper)| lower.is_finite() && upper.is_finite());
    let ground_truth =
        ground_truth.filter(|ground_truth| ground_truth.is_finite()).map(|ground_truth| (ground_truth, ground_truth));
    let own = Extent::of(own.into_iter().chain(ground_truth).chain(last).chain(bands));
    let (mut low, mut high) = own.0.unwrap_or((f64::INFINITY, f64::NEG_INFINITY));
    let span = high - low;
    // A constant value gives no range; then the others determine it.
    let room = if span > 0.0 { WIDENING * span } else { f64::INFINITY };
    let (lowest, highest) = (low - room, high + room);
    if let Extent(Some((others_low, others_high))) = Extent::of(others) {
        low = low.min(others_low.max(lowest));
        high = high.max(others_high.min(highest));
    }
    let margin = 0.06 * (high - low);
    let (low, high) = (low - margin, high + margin);
    let middle = last.map(|(from, to)| [from, to]).filter(|[from, to]| high - low > BROKEN_FROM * (to - from));
    ((low, high), middle)
}

/// Horizontal ranges in which a curve lies above the plot, and in which it lies below.
fn outside(area: &PlotArea, curve: &Curve) -> [Vec<Rangef>; 2] {
    let mut found = [Vec::new(), Vec::new()];
    for segment in &curve.segments {
        let mut open: [Option<Rangef>; 2] = [None, None];
        for (offset, value) in segment {
            let x = (area.rect.left() + offset).clamp(area.rect.left(), area.rect.right());
            for (side, is_out) in [*value > area.high, *value < area.low].into_iter().enumerate() {
                if is_out {
                    open[side].get_or_insert_with(|| Rangef::point(x)).max = x;
                } else {
                    found[side].extend(open[side].take());
                }
            }
        }
        for (side, open) in open.into_iter().enumerate() {
            found[side].extend(open);
        }
    }
    found
}

/// Marks where a curve lies outside the plot: a line along that edge with an arrowhead, `level` lines from it.
pub(super) fn paint_outside(painter: &Painter, area: &PlotArea, curve: &Curve, style: RunStyle, level: usize) {
    /// Distance between the lines of two runs, and half the width of an arrowhead, in points.
    const PITCH: f32 = 2.5;
    const HALF: f32 = 3.5;
    let inset = 1.5 + level as f32 * PITCH;
    let edges = [(area.rect.top() + inset, 1.0), (area.rect.bottom() - inset, -1.0)];
    for (segments, (y, inwards)) in outside(area, curve).into_iter().zip(edges) {
        for segment in segments {
            painter.hline(segment, y, Stroke::new(1.5, style.color));
            let x = segment.center().clamp(area.rect.left() + HALF, area.rect.right() - HALF);
            let foot = y + inwards * 1.5 * HALF;
            let head = vec![pos2(x, y), pos2(x + inwards * HALF, foot), pos2(x - inwards * HALF, foot)];
            painter.add(Shape::convex_polygon(head, style.color, Stroke::NONE));
        }
    }
}

#[cfg(test)]
mod tests {
    use egui::Rect;

    use super::*;

    fn history(values: &[f64], sigma: f64) -> ParameterCurve {
        history_of(values, &vec![sigma; values.len()])
    }

    fn history_of(values: &[f64], sigmas: &[f64]) -> ParameterCurve {
        let edge = |side: f64| values.iter().zip(sigmas).map(|(value, sigma)| value + side * sigma).collect();
        let (lower, upper) = (edge(-3.0), edge(3.0));
        ParameterCurve { values: values.to_vec(), sigmas: sigmas.to_vec(), lower, upper }
    }

    #[test]
    fn the_axis_follows_the_shown_run() {
        let own = history(&[0.0, 1.0, 1.0], 0.1);
        let range = |others: &[(f64, f64)], ground_truth| {
            value_range(Some((0.0, 1.0)), ground_truth, others.iter().copied(), &own).0
        };
        let (low, high) = range(&[], None);
        assert!(low < -0.3 && low > -0.5 && high > 1.45 && high < 1.6, "{low} {high}");
        // A nearby run is completely visible; a distant one extends the range by at most half its height.
        assert!(range(&[(-0.2, 1.0)], None).0 < -0.2);
        let (lowest, highest) = range(&[(-90.0, 400.0)], None);
        assert!(lowest > -1.5 && highest < 2.6, "{lowest} {highest}");
        // The ground truth is always visible.
        assert!(range(&[], Some(-9.0)).0 < -9.0);
        // A fixed value gives no range.
        let constant = history(&[2.0, 2.0], f64::NAN);
        let ((low, high), middle) = value_range(Some((2.0, 2.0)), None, [(1.0, 3.0)].into_iter(), &constant);
        assert!(low < 1.0 && high > 3.0 && middle.is_none());
    }

    #[test]
    fn the_whole_band_is_shown_and_the_scale_is_broken_where_it_would_flatten_the_last_one() {
        let of = |sigmas: [f64; 3]| {
            value_range(Some((0.9, 1.1)), None, std::iter::empty(), &history_of(&[0.9, 1.1, 1.0], &sigmas))
        };
        let ((low, high), middle) = of([0.2, 0.15, 0.1]);
        assert!(low < 0.9 - 0.6 && high > 1.1 + 0.45 && middle.is_none(), "{low} {high}");
        let ((low, high), middle) = of([20.0, 1.0, 0.1]);
        assert!(low < -59.0 && high > 60.0, "{low} {high}");
        assert_eq!(middle.map(|ends| ends.map(|value| (100.0 * value).round())), Some([55.0, 145.0]));
    }

    #[test]
    fn curves_outside_the_plot_are_found() {
        let rect = Rect::from_min_max(pos2(10.0, 0.0), pos2(110.0, 20.0));
        let area = PlotArea { rect, begin_ns: 0, end_ns: 100, low: 0.0, high: 1.0, middle: None };
        let stamps: Vec<i64> = (0..=10).map(|row| row * 10).collect();
        let values = [0.5, 3.0, 3.0, 0.5, -1.0, -1.0, -1.0, 0.5, 0.5, f64::NAN, 7.0];
        let mut curve = Curve::default();
        curve.update(&area, 0, &stamps, &values);
        let [above, below] = outside(&area, &curve);
        assert_eq!(above, [Rangef::new(20.0, 30.0), Rangef::point(110.0)]);
        assert_eq!(below, [Rangef::new(50.0, 70.0)]);
    }
}
