//! Values of curves at a time: under the pointer, and at the reading cursors with their differences.

use std::collections::BTreeSet;

use egui::{Align2, Color32, Painter, Pos2, Rangef, Rect, Shape, Stroke, StrokeKind, Ui, pos2, vec2};

use super::area::PlotArea;
use super::axes::{TIME_GUTTER, VALUE_GUTTER};
use super::axis::decimals_of_step;
use crate::gui::PanelContext;
use crate::gui::derived::reading::{EventLineKind, ReadingCursor};
use crate::gui::events::look_of;
use crate::gui::theme::{Theme, number_font};
use crate::gui::units::{fixed, seconds};

/// Time after the last value of a curve in nanoseconds up to which it is read there.
const MAX_AGE_NS: i64 = 500_000_000;
/// Height of a tag in points.
const TAG_HEIGHT: f32 = 13.0;
/// Width of a plot in points from which its reading cursors have their times beside their names.
const MIN_WIDTH_WITH_TIMES: f32 = 600.0;
/// Distance of a tag from its line in points.
const TAG_GAP: f32 = 5.0;

/// A curve whose values can be read.
pub(crate) struct ReadLine<'a> {
    pub(crate) color: Color32,
    /// Stamps of the values in ascending order, in nanoseconds since the log began.
    pub(crate) stamps_ns: &'a [i64],
    pub(crate) values: &'a [f64],
}

impl ReadLine<'_> {
    /// The last value at or before a stamp; `None` if it is not finite, and after the end of the curve.
    fn at(&self, stamp_ns: i64) -> Option<f64> {
        let row = self.stamps_ns.partition_point(|stamp| *stamp <= stamp_ns).checked_sub(1)?;
        let last = row + 1 == self.stamps_ns.len();
        if last && stamp_ns - self.stamps_ns[row] > MAX_AGE_NS {
            return None;
        }
        self.values.get(row).copied().filter(|value| value.is_finite())
    }
}

/// Curves of the runs in their order, each with stamps and values.
pub(crate) fn read_lines<'a>(theme: &Theme, runs: impl Iterator<Item = (&'a [i64], &'a [f64])>) -> Vec<ReadLine<'a>> {
    let line = |(run, (stamps_ns, values))| ReadLine { color: theme.run(run).color, stamps_ns, values };
    runs.enumerate().map(line).collect()
}

/// Curves of a plot with the conversion of their values to texts.
pub(crate) struct Readout<'a> {
    /// Key of the plot's value axis, unique in the window; empty if its range cannot be changed.
    pub(crate) key: &'a str,
    pub(crate) lines: &'a [ReadLine<'a>],
    /// Shown value per stored value.
    pub(crate) factor: f64,
    /// Shown unit with its leading space.
    pub(crate) unit: &'a str,
    /// True for counts, which are shown without decimals.
    pub(crate) whole: bool,
}

impl Readout<'_> {
    fn text(&self, area: &PlotArea, stored: f64) -> String {
        // Three digits of the axis.
        let [from, to] = area.middle.unwrap_or([area.low, area.high]);
        let step = (to - from).abs() * self.factor / 500.0;
        let decimals = if self.whole { 0 } else { decimals_of_step(step) };
        format!("{}{}", fixed(stored * self.factor, decimals), self.unit)
    }

    fn difference_text(&self, area: &PlotArea, stored: f64) -> String {
        let text = self.text(area, stored);
        let sign = if text.starts_with('-') { "" } else { "+" };
        format!("Δ {sign}{text}")
    }

    fn tags_at(&self, area: &PlotArea, stamp_ns: i64) -> Vec<Tag> {
        let tag = |line: &ReadLine<'_>| {
            let value = line.at(stamp_ns)?;
            Some(Tag { y: area.y(value), color: line.color, text: self.text(area, value) })
        };
        self.lines.iter().filter_map(tag).collect()
    }

    /// Tags at B: the differences from the values at A.
    fn difference_tags(&self, area: &PlotArea, [a_ns, b_ns]: [i64; 2]) -> Vec<Tag> {
        let tag = |line: &ReadLine<'_>| {
            let (from, to) = (line.at(a_ns)?, line.at(b_ns)?);
            Some(Tag { y: area.y(to), color: line.color, text: self.difference_text(area, to - from) })
        };
        self.lines.iter().filter_map(tag).collect()
    }
}

/// Value of a curve at a time.
struct Tag {
    y: f32,
    color: Color32,
    text: String,
}

/// Side of a line on which tags are drawn if there is room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Left,
    Right,
}

/// Draws events, both reading cursors and the time under the pointer, with the values of the curves; `pointed` is true
/// for the plot that the pointer is over, which shows the time itself too.
pub(super) fn paint_readout(ui: &Ui, ctx: &PanelContext<'_>, area: &PlotArea, readout: &Readout<'_>, pointed: bool) {
    let gutters = [vec2(VALUE_GUTTER, 0.0), vec2(0.0, TIME_GUTTER)];
    let painter = ui.painter_at(Rect::from_min_max(area.rect.min - gutters[0], area.rect.max + gutters[1]));
    paint_times(&painter, ctx, area);
    paint_time_labels(&painter, ctx, area, area.rect.top(), pointed);
    paint_values(&painter, ctx, area, readout);
}

/// Draws the lines of events, of both reading cursors and of the time under the pointer.
pub(crate) fn paint_times(painter: &Painter, ctx: &PanelContext<'_>, area: &PlotArea) {
    paint_events(painter, ctx, area);
    let reading = &ctx.selection.reading;
    let cursors = ReadingCursor::ALL.into_iter().filter_map(|cursor| reading.cursor_ns(cursor));
    for x in cursors.filter_map(|stamp_ns| x_inside(area, stamp_ns)) {
        painter.vline(x, area.rect.y_range(), Stroke::new(1.0, ctx.theme.accent));
    }
    if let Some(x) = pointer_ns(ctx).and_then(|stamp_ns| x_inside(area, stamp_ns)) {
        let ends = [pos2(x, area.rect.top()), pos2(x, area.rect.bottom())];
        painter.extend(Shape::dashed_line(&ends, Stroke::new(1.0, ctx.theme.text_weak), 2.0, 2.0));
    }
}

/// Draws the names of the reading cursors at `top`, with their times in a wide plot, and the time under the pointer if
/// `pointed`.
pub(crate) fn paint_time_labels(painter: &Painter, ctx: &PanelContext<'_>, area: &PlotArea, top: f32, pointed: bool) {
    let theme = ctx.theme;
    let with_times = area.rect.width() > MIN_WIDTH_WITH_TIMES;
    for cursor in ReadingCursor::ALL {
        let Some(stamp_ns) = ctx.selection.reading.cursor_ns(cursor) else { continue };
        let Some(x) = x_inside(area, stamp_ns) else { continue };
        let text = name_of(cursor, stamp_ns, with_times);
        boxed_text(painter, pos2(x, top), Align2::CENTER_TOP, &text, theme.surface, theme.accent);
    }
    let pointer = pointer_ns(ctx).filter(|_| pointed);
    if let Some((stamp_ns, x)) = pointer.and_then(|stamp_ns| Some((stamp_ns, x_inside(area, stamp_ns)?))) {
        let top = area.rect.bottom() - TAG_HEIGHT;
        let text = format!("{} s", seconds(stamp_ns));
        let half = 0.5 * painter.layout_no_wrap(text.clone(), number_font(), theme.text).size().x + 2.0;
        let center = x.min(area.rect.right() - half).max(area.rect.left() + half);
        boxed_text(painter, pos2(center, top), Align2::CENTER_TOP, &text, theme.text_strong, theme.surface_raised);
    }
}

/// Name of a reading cursor in a plot, with its time where there is room.
fn name_of(cursor: ReadingCursor, stamp_ns: i64, with_time: bool) -> String {
    if with_time { format!("{} {} s", cursor.letter(), seconds(stamp_ns)) } else { cursor.letter().to_owned() }
}

/// Draws the values of the curves at the time under the pointer, and where they do not overlap these the differences at
/// B and the values at the reading cursors.
pub(crate) fn paint_values(painter: &Painter, ctx: &PanelContext<'_>, area: &PlotArea, readout: &Readout<'_>) {
    let reading = &ctx.selection.reading;
    let [a_ns, b_ns] = ReadingCursor::ALL.map(|cursor| reading.cursor_ns(cursor));
    let mut placed = Vec::new();
    let mut paint = |stamp_ns: i64, tags: Vec<Tag>, side: Side| {
        if let Some(x) = x_inside(area, stamp_ns) {
            paint_tags(painter, ctx.theme, area, x, &tags, side, &mut placed);
        }
    };
    if let Some(stamp_ns) = pointer_ns(ctx) {
        // The tooltip and the pointer are on the right.
        paint(stamp_ns, readout.tags_at(area, stamp_ns), Side::Left);
    }
    // The interval between both cursors stays free.
    let sides = if a_ns > b_ns { [Side::Right, Side::Left] } else { [Side::Left, Side::Right] };
    if let Some(b_ns) = b_ns {
        let tags = a_ns.map_or_else(|| readout.tags_at(area, b_ns), |a_ns| readout.difference_tags(area, [a_ns, b_ns]));
        paint(b_ns, tags, sides[1]);
    }
    if let Some(a_ns) = a_ns {
        paint(a_ns, readout.tags_at(area, a_ns), sides[0]);
    }
}

/// Time under the pointer; a figure has no pointer.
fn pointer_ns(ctx: &PanelContext<'_>) -> Option<i64> {
    ctx.selection.reading.pointer_ns.filter(|_| !ctx.presentation.is_figure())
}

/// Screen x of a stamp, `None` outside the plot.
fn x_inside(area: &PlotArea, stamp_ns: i64) -> Option<f32> {
    let x = area.x(stamp_ns);
    area.rect.x_range().expand(0.5).contains(x).then_some(x)
}

/// Draws events as vertical lines, one per pixel column and look; rank losses are dashed.
fn paint_events(painter: &Painter, ctx: &PanelContext<'_>, area: &PlotArea) {
    let mut columns = BTreeSet::new();
    for line in ctx.selection.reading.events.iter() {
        let Some(x) = x_inside(area, line.stamp_ns) else { continue };
        let color = match line.kind {
            EventLineKind::Event(kind) => look_of(kind, ctx.theme).1,
            EventLineKind::RankLoss => ctx.theme.warn,
        };
        if !columns.insert((x.round() as i32, color.to_array())) {
            continue;
        }
        let stroke = Stroke::new(1.0, color.gamma_multiply(0.75));
        match line.kind {
            EventLineKind::Event(_) => {
                painter.vline(x, area.rect.y_range(), stroke);
            }
            EventLineKind::RankLoss => {
                let ends = [pos2(x, area.rect.top()), pos2(x, area.rect.bottom())];
                painter.extend(Shape::dashed_line(&ends, stroke, 4.0, 3.0));
            }
        }
    }
}

/// Draws a dot on every curve and its value beside the line at `x`; nothing if a value would overlap those in `placed`.
fn paint_tags(
    painter: &Painter,
    theme: &Theme,
    area: &PlotArea,
    x: f32,
    tags: &[Tag],
    side: Side,
    placed: &mut Vec<Rect>,
) {
    let width = |tag: &Tag| painter.layout_no_wrap(tag.text.clone(), number_font(), tag.color).size().x + 4.0;
    let widths: Vec<f32> = tags.iter().map(width).collect();
    let rects = tag_rects(area, x, &tags.iter().map(|tag| tag.y).collect::<Vec<_>>(), &widths, side);
    if rects.iter().any(|rect| placed.iter().any(|other| other.intersects(rect.shrink(0.5)))) {
        return;
    }
    for (tag, rect) in tags.iter().zip(&rects) {
        // A value outside the axis range has no dot.
        if area.rect.y_range().contains(tag.y) {
            painter.circle(pos2(x, tag.y), 2.5, tag.color, Stroke::new(1.0, theme.plot_background));
        }
        boxed_text(painter, rect.min, Align2::LEFT_TOP, &tag.text, tag.color, theme.plot_background);
    }
    placed.extend(rects);
}

/// Rectangles of the tags of a line at `x`: on the preferred side if there is room, one below the other, or side by side
/// in a low plot.
fn tag_rects(area: &PlotArea, x: f32, heights: &[f32], widths: &[f32], side: Side) -> Vec<Rect> {
    let centers: Vec<f32> = heights.iter().map(|y| y.clamp(area.rect.top(), area.rect.bottom())).collect();
    let tops = stacked(&centers, TAG_HEIGHT, area.rect.y_range());
    let total = match tops {
        Some(_) => widths.iter().copied().fold(0.0, f32::max),
        None => widths.iter().map(|width| width + 2.0).sum(),
    };
    let needed = total + TAG_GAP;
    let room = [x - area.rect.left(), area.rect.right() - x];
    let left = match side {
        Side::Left => room[0] >= needed || room[0] >= room[1],
        Side::Right => room[1] < needed && room[0] > room[1],
    };
    let begin = if left { x - TAG_GAP - total } else { x + TAG_GAP };
    // Over the axis rather than over the next plot.
    let begin = begin.min(area.rect.right() - total).max(area.rect.left() - VALUE_GUTTER);
    let mut next = begin;
    let rect = |(index, width): (usize, &f32)| {
        let size = vec2(*width, TAG_HEIGHT);
        let Some(tops) = &tops else {
            let place = pos2(next, area.rect.center().y - 0.5 * TAG_HEIGHT);
            next += width + 2.0;
            return Rect::from_min_size(place, size);
        };
        let left = if left { begin + total - width } else { begin };
        Rect::from_min_size(pos2(left, tops[index]), size)
    };
    widths.iter().enumerate().map(rect).collect()
}

/// Tops of tags of equal height, each as near to its center as the others allow; `None` if they do not fit into the
/// range.
fn stacked(centers: &[f32], height: f32, range: Rangef) -> Option<Vec<f32>> {
    if centers.len() as f32 * height > range.span() + 0.5 {
        return None;
    }
    let mut order: Vec<usize> = (0..centers.len()).collect();
    order.sort_by(|a, b| centers[*a].total_cmp(&centers[*b]));
    let mut tops = vec![0.0; centers.len()];
    let mut free = range.min;
    for index in &order {
        tops[*index] = (centers[*index] - 0.5 * height).max(free);
        free = tops[*index] + height;
    }
    let mut limit = range.max;
    for index in order.iter().rev() {
        tops[*index] = tops[*index].min(limit - height);
        limit = tops[*index];
    }
    Some(tops)
}

/// Draws a text on an opaque ground.
fn boxed_text(painter: &Painter, place: Pos2, align: Align2, text: &str, color: Color32, ground: Color32) {
    let galley = painter.layout_no_wrap(text.to_owned(), number_font(), color);
    let size = vec2(galley.size().x + 4.0, TAG_HEIGHT - 1.0);
    let rect = align.anchor_size(place, size);
    painter.rect(rect, 2.0, ground, Stroke::new(0.5, color), StrokeKind::Inside);
    painter.galley(pos2(rect.left() + 2.0, rect.center().y - 0.5 * galley.size().y), galley, color);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line<'a>(stamps_ns: &'a [i64], values: &'a [f64]) -> ReadLine<'a> {
        ReadLine { color: Color32::WHITE, stamps_ns, values }
    }

    #[test]
    fn a_line_has_the_last_value_at_or_before_a_time() {
        let stamps = [0, 1_000_000_000, 2_000_000_000];
        let line = line(&stamps, &[1.0, f64::NAN, 3.0]);
        let at = |time_s: f64| line.at((time_s * 1e9) as i64);
        assert_eq!(
            [at(-0.1), at(0.0), at(0.9), at(1.5), at(2.0), at(2.4)],
            [None, Some(1.0), Some(1.0), None, Some(3.0), Some(3.0)]
        );
        assert_eq!(at(2.6), None, "the curve has ended");
    }

    #[test]
    fn differences_have_a_sign_and_the_precision_of_the_axis() {
        let stamps = [0, 1_000_000_000];
        let (first, second) = ([0.010, 0.0125], [0.020, 0.0195]);
        let lines = [line(&stamps, &first), line(&stamps, &second)];
        let rect = Rect::from_min_max(pos2(0.0, 0.0), pos2(100.0, 100.0));
        let area = PlotArea { rect, begin_ns: 0, end_ns: 1_000_000_000, low: 0.0, high: 0.025, middle: None };
        let readout = Readout { key: "", lines: &lines, factor: 1e3, unit: " mm", whole: false };
        let texts = |tags: Vec<Tag>| tags.into_iter().map(|tag| tag.text).collect::<Vec<_>>();
        assert_eq!(texts(readout.tags_at(&area, 0)), ["10.00 mm", "20.00 mm"]);
        assert_eq!(texts(readout.difference_tags(&area, [0, 1_000_000_000])), ["Δ +2.50 mm", "Δ -0.50 mm"]);
        // The direction is from A to B, not from left to right.
        assert_eq!(texts(readout.difference_tags(&area, [1_000_000_000, 0])), ["Δ -2.50 mm", "Δ +0.50 mm"]);
    }

    #[test]
    fn tags_are_beside_their_line_and_turn_at_the_edges() {
        let rect = Rect::from_min_max(pos2(50.0, 0.0), pos2(250.0, 60.0));
        let area = PlotArea { rect, begin_ns: 0, end_ns: 1, low: 0.0, high: 1.0, middle: None };
        let at = |x: f32, side: Side| tag_rects(&area, x, &[20.0, 22.0], &[60.0, 50.0], side);
        for (x, side, expected) in [
            (150.0, Side::Left, 145.0),
            (150.0, Side::Right, 215.0),
            (60.0, Side::Left, 125.0),
            (240.0, Side::Right, 235.0),
        ] {
            let rects = at(x, side);
            assert_eq!(rects[0].right(), expected, "{x} {side:?}");
            assert!(!rects[0].shrink(0.1).intersects(rects[1].shrink(0.1)), "{rects:?}");
        }
        // A low plot has them side by side.
        let low = PlotArea { rect: rect.with_max_y(16.0), ..area };
        let rects = tag_rects(&low, 200.0, &[8.0, 8.0], &[60.0, 50.0], Side::Left);
        assert!(rects[0].right() < rects[1].left() && rects[1].right() < 200.0, "{rects:?}");
    }

    #[test]
    fn tags_do_not_overlap_and_stay_inside() {
        let range = Rangef::new(0.0, 60.0);
        let check = |centers: &[f32]| {
            let tops = stacked(centers, 13.0, range).unwrap();
            let mut sorted = tops.clone();
            sorted.sort_by(f32::total_cmp);
            assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] >= 12.99), "{tops:?}");
            assert!(sorted.iter().all(|top| (0.0..=47.01).contains(top)), "{tops:?}");
            tops
        };
        assert_eq!(check(&[30.0]), [23.5]);
        check(&[59.0, 58.0, 57.0, 60.0]);
        check(&[0.0, 1.0, 30.0, 31.0]);
        let order = check(&[40.0, 10.0]);
        assert!(order[0] > order[1], "a tag follows its curve: {order:?}");
        assert!(stacked(&[1.0, 2.0], 13.0, Rangef::new(0.0, 14.0)).is_none());
    }
}
