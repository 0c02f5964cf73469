//! Curves over time, reduced to one value range per pixel column of a plot.

use egui::{Rangef, vec2};

use super::area::{PlotArea, visible_segments};

/// Inputs of a reduced curve; equal keys have equal curves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct CurveKey {
    epoch: u64,
    count: usize,
    begin_ns: i64,
    end_ns: i64,
    width_px: u32,
}

/// A curve reduced to pixel columns; updated only when its data, range or width changes.
#[derive(Debug, Default)]
pub(crate) struct Curve {
    key: Option<CurveKey>,
    /// Contiguous line strips of `(points to the right of the plot's left edge, value)`.
    pub(crate) segments: Vec<Vec<(f32, f64)>>,
    /// Smallest and largest value in the range, `None` without values.
    pub(crate) extent: Option<(f64, f64)>,
}

impl CurveKey {
    fn of(area: &PlotArea, epoch: u64, count: usize) -> Self {
        let (begin_ns, end_ns) = (area.begin_ns, area.end_ns);
        Self { epoch, count, begin_ns, end_ns, width_px: area.rect.width().max(1.0) as u32 }
    }
}

impl Curve {
    /// Updates the curve to `values` at `stamps_ns` (ascending); values that are not finite interrupt it.
    ///
    /// `epoch` changes when earlier rows change; while it stays the same, rows are only appended.
    pub(crate) fn update(&mut self, area: &PlotArea, epoch: u64, stamps_ns: &[i64], values: &[f64]) {
        let key = CurveKey::of(area, epoch, stamps_ns.len().min(values.len()));
        if self.key != Some(key) {
            self.key = Some(key);
            self.segments = reduce(area, &stamps_ns[..key.count], values);
            let values = || self.segments.iter().flatten().map(|(_, value)| *value);
            let extent = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            self.extent = (extent.0 <= extent.1).then_some(extent);
        }
    }
}

/// A band between two values over time, reduced to pixel columns.
///
/// Both edges are reduced together: reduced separately, they would keep different rows of a column, and the band would
/// have gaps.
#[derive(Debug, Default)]
pub(crate) struct BandCurve {
    key: Option<CurveKey>,
    /// Contiguous strips of `(points to the right of the plot's left edge, lower, upper value)`.
    pub(crate) segments: Vec<Vec<(f32, f64, f64)>>,
}

impl BandCurve {
    /// Updates the band as [`Curve::update`] does; a row without both values interrupts it.
    pub(crate) fn update(&mut self, area: &PlotArea, epoch: u64, stamps_ns: &[i64], lower: &[f64], upper: &[f64]) {
        let count = stamps_ns.len().min(lower.len()).min(upper.len());
        let key = CurveKey::of(area, epoch, count);
        if self.key != Some(key) {
            self.key = Some(key);
            self.segments = reduce_band(area, &stamps_ns[..count], lower, upper);
        }
    }
}

/// The time ranges in which a state is true, cached as a [`Curve`] is.
#[derive(Debug, Default)]
pub(crate) struct StateCurve {
    key: Option<CurveKey>,
    /// Ranges in points to the right of the plot's left edge.
    segments: Vec<Rangef>,
}

impl StateCurve {
    /// Updates the ranges as [`Curve::update`] does.
    pub(crate) fn update(&mut self, area: &PlotArea, epoch: u64, stamps_ns: &[i64], holds: impl Fn(usize) -> bool) {
        let key = CurveKey::of(area, epoch, stamps_ns.len());
        if self.key != Some(key) {
            self.key = Some(key);
            let at_zero = PlotArea { rect: area.rect.translate(vec2(-area.rect.left(), 0.0)), ..*area };
            self.segments = visible_segments(&at_zero, stamps_ns, holds);
        }
    }

    pub(crate) fn on_screen(&self, area: &PlotArea) -> impl Iterator<Item = Rangef> {
        let left = area.rect.left();
        self.segments.iter().map(move |segment| Rangef::new(left + segment.min, left + segment.max))
    }
}

/// Smallest lower and largest upper value of each pixel column.
fn reduce_band(area: &PlotArea, stamps_ns: &[i64], lower: &[f64], upper: &[f64]) -> Vec<Vec<(f32, f64, f64)>> {
    let mut segments: Vec<Vec<(f32, f64, f64)>> = vec![Vec::new()];
    for row in rows_in_range(area, stamps_ns) {
        let (x, low, high) = (area.offset_of(stamps_ns[row]), lower[row], upper[row]);
        let Some(segment) = segments.last_mut() else { break };
        if !(low.is_finite() && high.is_finite()) {
            if !segment.is_empty() {
                segments.push(Vec::new());
            }
            continue;
        }
        match segment.last_mut() {
            Some((open, lowest, highest)) if open.floor() == x.floor() => {
                (*lowest, *highest) = (lowest.min(low), highest.max(high));
            }
            _ => segment.push((x, low, high)),
        }
    }
    segments.retain(|segment| !segment.is_empty());
    segments
}

/// The rows from the one before the time range to the one after it, so that lines reach the edges.
fn rows_in_range(area: &PlotArea, stamps_ns: &[i64]) -> std::ops::Range<usize> {
    let first = stamps_ns.partition_point(|stamp| *stamp < area.begin_ns).saturating_sub(1);
    let end = (stamps_ns.partition_point(|stamp| *stamp <= area.end_ns) + 1).min(stamps_ns.len());
    first..end.max(first)
}

/// First, smallest, largest and last value of each pixel column, in the order of their rows.
fn reduce(area: &PlotArea, stamps_ns: &[i64], values: &[f64]) -> Vec<Vec<(f32, f64)>> {
    let rows = rows_in_range(area, stamps_ns);
    let columns = area.rect.width().max(1.0) as usize;
    let thin = rows.len() <= 2 * columns;
    let mut segments = Vec::new();
    let mut segment: Vec<(f32, f64)> = Vec::new();
    let mut column: Option<PixelColumn> = None;
    for row in rows {
        let x = area.offset_of(stamps_ns[row]);
        let value = values[row];
        if !value.is_finite() {
            flush(&mut segment, &mut column);
            if !segment.is_empty() {
                segments.push(std::mem::take(&mut segment));
            }
        } else if thin {
            segment.push((x, value));
        } else {
            match &mut column {
                Some(open) if open.x.floor() == x.floor() => open.take(row, value),
                _ => {
                    flush(&mut segment, &mut column);
                    column = Some(PixelColumn {
                        x,
                        first: (row, value),
                        lowest: (row, value),
                        highest: (row, value),
                        last: (row, value),
                    });
                }
            }
        }
    }
    flush(&mut segment, &mut column);
    if !segment.is_empty() {
        segments.push(segment);
    }
    segments
}

/// Rows and values of the extremes of one pixel column.
struct PixelColumn {
    x: f32,
    first: (usize, f64),
    lowest: (usize, f64),
    highest: (usize, f64),
    last: (usize, f64),
}

impl PixelColumn {
    fn take(&mut self, row: usize, value: f64) {
        if value < self.lowest.1 {
            self.lowest = (row, value);
        }
        if value > self.highest.1 {
            self.highest = (row, value);
        }
        self.last = (row, value);
    }
}

fn flush(segment: &mut Vec<(f32, f64)>, column: &mut Option<PixelColumn>) {
    if let Some(PixelColumn { x, first, lowest, highest, last }) = column.take() {
        let mut points = [first, lowest, highest, last];
        points.sort_by_key(|(row, _)| *row);
        let mut before = None;
        for (row, value) in points {
            if before != Some(row) {
                segment.push((x, value));
            }
            before = Some(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Rect, pos2};

    fn area(width: f32) -> PlotArea {
        PlotArea {
            rect: Rect::from_min_max(pos2(10.0, 0.0), pos2(10.0 + width, 50.0)),
            begin_ns: 0,
            end_ns: 10_000,
            low: 0.0,
            high: 1.0,
            middle: None,
        }
    }

    #[test]
    fn a_spike_survives_and_points_stay_few() {
        let stamps: Vec<i64> = (0..10_000).collect();
        let mut values = vec![0.5; 10_000];
        values[4321] = 9.0;
        let mut curve = Curve::default();
        curve.update(&area(100.0), 0, &stamps, &values);
        assert_eq!(curve.extent, Some((0.5, 9.0)));
        assert_eq!(curve.segments.len(), 1);
        assert!(curve.segments[0].len() <= 400);
        assert!(curve.segments[0].is_sorted_by(|a, b| a.0 <= b.0));
    }

    #[test]
    fn gaps_break_the_line() {
        let mut curve = Curve::default();
        curve.update(&area(100.0), 0, &[0, 10, 20, 30, 40], &[1.0, 2.0, f64::NAN, 3.0, 4.0]);
        assert_eq!(curve.segments.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2]);
        curve.update(&area(100.0), 1, &[], &[]);
        assert_eq!((curve.segments.len(), curve.extent), (0, None));
    }

    #[test]
    fn a_band_keeps_both_edges_of_a_column_together() {
        // Each edge has its extremes at different rows, and in one place both are missing.
        let stamps: Vec<i64> = (0..10_000).collect();
        let lower: Vec<f64> = stamps.iter().map(|row| -1.0 - f64::from((row * 7 % 13) as i32)).collect();
        let mut upper: Vec<f64> = stamps.iter().map(|row| 1.0 + f64::from((row * 5 % 11) as i32)).collect();
        upper[5000] = f64::NAN;
        let mut band = BandCurve::default();
        band.update(&area(100.0), 0, &stamps, &lower, &upper);
        assert_eq!(band.segments.len(), 2);
        for segment in &band.segments {
            assert!(segment.is_sorted_by(|a, b| a.0.floor() < b.0.floor()), "one entry per column");
            assert!(segment.iter().all(|(_, low, high)| (*low, *high) == (-13.0, 11.0)), "the whole reach of a column");
        }
        assert!(band.segments.iter().map(Vec::len).sum::<usize>() <= 102);
        band.update(&area(100.0), 1, &[0, 5000], &[1.0, 2.0], &[3.0, 4.0]);
        assert_eq!(band.segments, [[(0.0, 1.0, 3.0), (50.0, 2.0, 4.0)]]);
    }

    #[test]
    fn it_is_updated_only_for_a_new_key() {
        let mut curve = Curve::default();
        curve.update(&area(100.0), 0, &[0, 10], &[1.0, 2.0]);
        curve.update(&area(100.0), 0, &[0, 10], &[5.0, 6.0]);
        assert_eq!(curve.extent, Some((1.0, 2.0)), "same key, same curve");
        curve.update(&area(100.0), 0, &[0, 10, 20], &[5.0, 6.0, 7.0]);
        assert_eq!(curve.extent, Some((5.0, 7.0)));
    }
}
