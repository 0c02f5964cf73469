//! Layout of the small plots of the parameters.

use egui::{Rect, pos2, vec2};

use crate::gimbal::{ParameterGroup, ParameterId};
use crate::gui::parameter_names::{CalibrationPart, part_of};
use crate::gui::plot::{TICKS_ONLY, TIME_GUTTER};

/// Minimum height of a legible plot in points, including its title.
const MIN_CELL_HEIGHT: f32 = 52.0;
/// Minimum width of a legible plot in points.
const MIN_CELL_WIDTH: f32 = 118.0;
/// Height in points from which a cell shows the times itself where a cell below shows them too.
const MIN_HEIGHT_WITH_TIMES: f32 = 92.0;
/// Height of the labels of times in points.
const TIMES_HEIGHT: f32 = TIME_GUTTER - TICKS_ONLY;
/// Gap between rows of plots in points.
const GAP: f32 = 5.0;
/// Gap between columns in points: the value above a plot is not read as a part of the next plot's name.
const COLUMN_GAP: f32 = 14.0;
/// Width of the headings at the left of the rows, in points.
pub(crate) const HEADING_WIDTH: f32 = 46.0;
/// Height of the headings above groups, in points.
const GROUP_HEIGHT: f32 = 17.0;

#[derive(Debug, PartialEq)]
pub(crate) struct PlotGrid {
    /// One cell per shown parameter, in order.
    pub(crate) cells: Vec<Rect>,
    /// Heading of each group in the layout by groups.
    pub(crate) groups: Vec<(ParameterGroup, Rect)>,
    /// Heading of each row, by part of the calibration; empty in the flowing layout.
    pub(crate) headings: Vec<(CalibrationPart, Rect)>,
    /// Largest free rectangle of the layout by rows.
    pub(crate) legend: Option<Rect>,
    /// Total height in points; larger than the available height if the panel has to scroll.
    pub(crate) height: f32,
}

impl PlotGrid {
    /// Heights of the gutters of times in points. A low cell shows the ticks only if there is a cell below it, whose
    /// times are the same.
    pub(crate) fn time_gutters(&self) -> Vec<f32> {
        let covered = |cell: &Rect| {
            self.cells.iter().any(|other| (other.left() - cell.left()).abs() < 1.0 && other.top() > cell.top() + 1.0)
        };
        let gutter = |cell: &Rect| {
            if cell.height() < MIN_HEIGHT_WITH_TIMES && covered(cell) { TICKS_ONLY } else { TIME_GUTTER }
        };
        self.cells.iter().map(gutter).collect()
    }

    /// Adds the height of the labels of times to the cells that are the only low ones with them.
    fn with_room_for_times(mut self) -> Self {
        let gutters = self.time_gutters();
        for (cell, gutter) in self.cells.iter_mut().zip(gutters) {
            let higher = cell.with_max_y(cell.bottom() + TIMES_HEIGHT);
            let free = self.groups.iter().all(|(_, heading)| !heading.intersects(higher));
            if gutter > TICKS_ONLY && cell.height() < MIN_HEIGHT_WITH_TIMES && free {
                *cell = higher;
            }
        }
        self.height += TIMES_HEIGHT;
        self
    }
}

/// Lays out one cell per parameter (sorted along the chain): one row per part of the chain if that fits, else flowing.
pub(crate) fn lay_out(parameters: &[ParameterId], available: Rect) -> PlotGrid {
    let available = available.with_max_y(available.bottom() - TIMES_HEIGHT);
    by_part(parameters, available).unwrap_or_else(|| flowing(parameters.len(), available)).with_room_for_times()
}

fn by_part(parameters: &[ParameterId], available: Rect) -> Option<PlotGrid> {
    let mut rows: Vec<(CalibrationPart, usize)> = Vec::new();
    for parameter in parameters {
        let part = part_of(*parameter);
        match rows.last_mut() {
            Some((last, count)) if *last == part => *count += 1,
            _ => rows.push((part, 1)),
        }
    }
    let columns = rows.iter().map(|(_, count)| *count).max()?;
    let width = (available.width() - HEADING_WIDTH - COLUMN_GAP * columns as f32) / columns as f32;
    let height = (available.height() - GAP * (rows.len() as f32 - 1.0)) / rows.len() as f32;
    // The layout by rows leaves cells free; it is used only if plots stay legible and few cells are empty.
    let empty = rows.len() * columns - parameters.len();
    if rows.len() < 2
        || width < MIN_CELL_WIDTH * 1.15
        || height < MIN_CELL_HEIGHT * 1.35
        || 3 * empty > parameters.len() + 2
    {
        return None;
    }
    let counts: Vec<usize> = rows.iter().map(|(_, count)| *count).collect();
    let legend = free_corner(&counts, columns).map(|(first, free_rows, free_columns)| {
        let size =
            vec2(free_columns as f32 * (width + COLUMN_GAP) - COLUMN_GAP, free_rows as f32 * (height + GAP) - GAP);
        let top = available.top() + first as f32 * (height + GAP);
        Rect::from_min_size(pos2(available.right() - size.x, top), size)
    });
    let mut layout =
        PlotGrid { cells: Vec::new(), groups: Vec::new(), headings: Vec::new(), legend, height: available.height() };
    for (row, (part, count)) in rows.into_iter().enumerate() {
        let top = available.top() + row as f32 * (height + GAP);
        let heading = Rect::from_min_size(pos2(available.left(), top), vec2(HEADING_WIDTH, height));
        layout.headings.push((part, heading));
        layout.cells.extend((0..count).map(|column| {
            let left = available.left() + HEADING_WIDTH + COLUMN_GAP + column as f32 * (width + COLUMN_GAP);
            Rect::from_min_size(pos2(left, top), vec2(width, height))
        }));
    }
    Some(layout)
}

/// First row, number of rows and number of columns of the largest free rectangle to the right of incomplete rows.
fn free_corner(counts: &[usize], columns: usize) -> Option<(usize, usize, usize)> {
    let mut best: Option<(usize, usize, usize)> = None;
    for first in 0..counts.len() {
        for end in first + 1..=counts.len() {
            let free = columns - counts[first..end].iter().copied().max().unwrap_or(columns);
            if free > 0 && best.is_none_or(|(_, rows, columns)| free * (end - first) > rows * columns) {
                best = Some((first, end - first, free));
            }
        }
    }
    best
}

fn flowing(count: usize, available: Rect) -> PlotGrid {
    const WANTED_ASPECT: f32 = 2.0;
    let max_columns =
        (((available.width() + COLUMN_GAP) / (MIN_CELL_WIDTH + COLUMN_GAP)) as usize).clamp(1, count.max(1));
    let size = |columns: usize| {
        let rows = count.div_ceil(columns).max(1);
        let width = (available.width() - COLUMN_GAP * (columns as f32 - 1.0)) / columns as f32;
        let height = (available.height() - GAP * (rows as f32 - 1.0)) / rows as f32;
        vec2(width.max(1.0), height.max(MIN_CELL_HEIGHT))
    };
    let loss = |columns: usize| {
        let size = size(columns);
        let rows = count.div_ceil(columns).max(1);
        let empty = (rows * columns - count) as f32 / count.max(1) as f32;
        let overflow = (rows as f32 * (size.y + GAP) - GAP - available.height()).max(0.0) / available.height().max(1.0);
        (size.x / size.y / WANTED_ASPECT).ln().abs() + empty + 10.0 * overflow
    };
    let columns = (1..=max_columns).min_by(|a, b| loss(*a).total_cmp(&loss(*b))).unwrap_or(1);
    let size = size(columns);
    let cells: Vec<Rect> = (0..count)
        .map(|index| {
            let corner =
                vec2((index % columns) as f32 * (size.x + COLUMN_GAP), (index / columns) as f32 * (size.y + GAP));
            Rect::from_min_size(available.min + corner, size)
        })
        .collect();
    let bottom = cells.last().map_or_else(|| available.top(), |cell| cell.bottom());
    PlotGrid { cells, groups: Vec::new(), headings: Vec::new(), legend: None, height: bottom - available.top() }
}

/// Lays out groups below each other, each with a heading and cells on one common grid; a folded group, of no cells, is its
/// heading only.
pub(crate) fn by_group(groups: &[(ParameterGroup, usize)], available: Rect) -> PlotGrid {
    let largest = groups.iter().map(|(_, count)| *count).max().unwrap_or(0).max(1);
    let max_columns = (((available.width() + COLUMN_GAP) / (MIN_CELL_WIDTH + COLUMN_GAP)) as usize).clamp(1, largest);
    let rows_of = |columns: usize| groups.iter().map(|(_, count)| count.div_ceil(columns)).sum::<usize>();
    // The fewest columns that give the smallest number of rows, so that the plots are as wide as possible.
    let fewest = rows_of(max_columns);
    let columns = (1..=max_columns).find(|columns| rows_of(*columns) == fewest).unwrap_or(max_columns);
    let width = (available.width() - COLUMN_GAP * (columns as f32 - 1.0)) / columns as f32;
    let room = available.height() - groups.len() as f32 * GROUP_HEIGHT - TIMES_HEIGHT;
    let height = (room / fewest.max(1) as f32 - GAP).max(MIN_CELL_HEIGHT);
    let mut layout = PlotGrid {
        cells: Vec::new(),
        groups: Vec::new(),
        headings: Vec::new(),
        legend: None,
        height: available.height(),
    };
    let mut top = available.top();
    for (group, count) in groups {
        let heading = Rect::from_min_size(pos2(available.left(), top), vec2(available.width(), GROUP_HEIGHT));
        layout.groups.push((*group, heading));
        top += GROUP_HEIGHT;
        layout.cells.extend((0..*count).map(|index| {
            let corner =
                vec2((index % columns) as f32 * (width + COLUMN_GAP), (index / columns) as f32 * (height + GAP));
            Rect::from_min_size(pos2(available.left(), top) + corner, vec2(width.max(1.0), height))
        }));
        top += count.div_ceil(columns) as f32 * (height + GAP);
    }
    layout.height = top - available.top();
    layout.with_room_for_times()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::{ParameterPart, Quantity};

    fn parameters(counts: &[(ParameterPart, usize)]) -> Vec<ParameterId> {
        let of = |part: ParameterPart, count| {
            Quantity::TRANSFORM.into_iter().take(count).map(move |quantity| ParameterId { part, quantity })
        };
        counts.iter().flat_map(|(part, count)| of(*part, *count)).collect()
    }

    fn check(names: &[ParameterId], width: f32, height: f32) -> PlotGrid {
        let available = Rect::from_min_size(pos2(20.0, 30.0), vec2(width, height));
        let layout = lay_out(names, available);
        assert_eq!(layout.cells.len(), names.len());
        for (index, cell) in layout.cells.iter().enumerate() {
            assert!(cell.height() >= MIN_CELL_HEIGHT - 0.5, "{cell:?}");
            assert!(cell.left() >= available.left() - 0.5 && cell.right() <= available.right() + 0.5, "{cell:?}");
            assert!(layout.cells[..index].iter().all(|other| !other.shrink(0.1).intersects(cell.shrink(0.1))));
        }
        layout
    }

    #[test]
    fn groups_follow_each_other_and_folded_ones_leave_their_room() {
        use ParameterGroup::{Camera, Chain, Clocks, Imu};
        let available = Rect::from_min_size(pos2(20.0, 30.0), vec2(1340.0, 560.0));
        let check = |groups: &[(ParameterGroup, usize)]| {
            let layout = by_group(groups, available);
            assert_eq!(layout.cells.len(), groups.iter().map(|(_, count)| count).sum::<usize>());
            let headings: Vec<_> = layout.groups.iter().map(|(_, heading)| *heading).collect();
            let all: Vec<Rect> = layout.cells.iter().chain(&headings).map(|rect| rect.shrink(0.1)).collect();
            for (index, rect) in all.iter().enumerate() {
                assert!(all[..index].iter().all(|other| !other.intersects(*rect)), "{rect:?}");
                assert!(available.expand(0.5).x_range().contains(rect.right()), "{rect:?}");
            }
            let mut before = 0;
            for ((_, count), pair) in groups.iter().zip(layout.groups.windows(2)) {
                let cells = &layout.cells[before..before + count];
                before += count;
                assert!(cells.iter().all(|cell| cell.top() > pair[0].1.top() && cell.bottom() < pair[1].1.bottom()));
            }
            layout
        };
        let all = check(&[(Chain, 24), (Camera, 6), (Imu, 15), (Clocks, 2)]);
        assert!(all.height <= 560.5 && all.cells[0].height() >= 60.0, "{} {:?}", all.height, all.cells[0]);
        let folded = check(&[(Chain, 0), (Camera, 6), (Imu, 0), (Clocks, 2)]);
        assert!(folded.height <= 560.5 && folded.cells[0].height() > 2.0 * all.cells[0].height());
        let narrow = Rect::from_min_size(pos2(0.0, 0.0), vec2(300.0, 200.0));
        assert!(by_group(&[(Chain, 24), (Imu, 15)], narrow).height > 900.0);
        assert!(by_group(&[], narrow).cells.is_empty());
    }

    #[test]
    fn plots_never_overlap_and_scroll_rather_than_shrink() {
        let links = [0, 1, 2].map(ParameterPart::Link);
        let minimal = parameters(&[(ParameterPart::Base, 4), (links[0], 4), (links[1], 4), (links[2], 6)]);
        let (base, end) = (ParameterPart::ImuFromBase, ParameterPart::EffectorFromCamera);
        let classical = parameters(&[(base, 6), (links[0], 4), (links[1], 4), (links[2], 4), (end, 6)]);
        assert!(!check(&minimal, 1400.0, 420.0).headings.is_empty());
        assert!(check(&minimal, 900.0, 260.0).height <= 260.5);
        assert!(check(&classical, 1000.0, 330.0).height <= 330.5);
        assert!(check(&classical, 300.0, 200.0).height > 200.0);
        check(&[], 300.0, 200.0);
        check(&minimal[..1], 40.0, 10.0);
    }
}
