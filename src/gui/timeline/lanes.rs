//! Painting of the lanes.

use std::collections::BTreeSet;

use egui::text::{LayoutJob, TextWrapping};
use egui::{Align2, Color32, Painter, Pos2, Rect, Stroke, Ui, pos2, vec2};

use super::model::{FEATURES, INFORMED, RMS, RunLanes, STRUCTURAL};
use crate::gui::PanelContext;
use crate::gui::events::{EventSymbol, look_of, paint_mark};
use crate::gui::plot::{
    Curve, PlotArea, Readout, paint_curve, paint_hatch, paint_steps, paint_value_axis, paint_values, read_lines,
    visible_segments,
};
use crate::gui::theme::{self, RunStyle, Theme};
use crate::gui::units::fixed;
use crate::gui::widgets::plated_text;
use crate::sensors::{NEAREST_POSE_NS, PoseTrack};

/// Maximum height of the bar of a run in points.
const MAX_BAR_HEIGHT: f32 = 24.0;
/// Minimum height of a lane with a scale in points.
const MIN_HEIGHT_WITH_SCALE: f32 = 28.0;
/// Width of the scale of a lane in points.
const SCALE_WIDTH: f32 = 34.0;

/// Width of the scales of lanes of a height, in points; zero if they have none.
pub(super) fn scale_width(height: f32) -> f32 {
    if height >= MIN_HEIGHT_WITH_SCALE { SCALE_WIDTH } else { 0.0 }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Lane {
    /// Findings about the selected run.
    Findings,
    /// Phases and keyframes of a run.
    Run(usize),
    /// Time range of a trajectory of another program.
    Trajectory(usize),
    Breakpoints,
    /// Infrequent events of all runs.
    Events,
    Rank,
    /// Number of tracked features.
    Features,
    Reprojection,
    Outliers,
    /// σ over prior σ of each parameter of the selected run.
    Parameters,
    /// Warnings about the log (gaps etc.) and of steps.
    Warnings,
}

impl Lane {
    pub(crate) fn name(self, ctx: &PanelContext<'_>) -> String {
        match self {
            Self::Findings => "findings".to_owned(),
            Self::Run(run) => ctx.recording.runs.get(run).map_or_else(String::new, |run| run.spec.label.clone()),
            Self::Trajectory(number) => {
                ctx.recording.trajectories.get(number).map_or_else(String::new, |lane| lane.label.clone())
            }
            Self::Breakpoints => "breakpoints".to_owned(),
            Self::Events => "events".to_owned(),
            Self::Rank => "informed rank".to_owned(),
            Self::Features => "features".to_owned(),
            Self::Reprojection => "reprojection, px".to_owned(),
            Self::Outliers => "outliers".to_owned(),
            Self::Parameters => "parameters".to_owned(),
            Self::Warnings => "warnings".to_owned(),
        }
    }

    /// Tooltip of the lane: content, unit and file column.
    pub(super) const fn meaning(self) -> &'static str {
        match self {
            Self::Findings => {
                "Reasons to doubt the selected run, the one with the largest effect first; red: not usable; click: move the \
                 cursor to the start and show what it is about"
            }
            Self::Run(_) => "Phases of the run: hatched while initializing, filled while tracking; ticks: keyframes",
            Self::Trajectory(_) => {
                "Time with poses of a trajectory of another program; it has poses only, so that the lanes of rank, features \
                 and reprojection do not show it"
            }
            Self::Breakpoints => "Breakpoint hits of all runs",
            Self::Events => "Events of all runs (column events of frames.csv)",
            Self::Rank => "Informed rank of the calibration (rank.csv)",
            Self::Features => "Number of features in the image",
            Self::Reprojection => {
                "Reprojection RMS after the solve, px (column reprojection_rms_after_px of frames.csv)"
            }
            Self::Outliers => "Number of features that the estimator rejects as outliers",
            Self::Parameters => {
                "σ over prior σ of each parameter of the selected run over time, coloured by the verdict; click: open or \
                 close the rows; drag on open rows: effect of a stretch on every σ"
            }
            Self::Warnings => "Warnings of the log (squares) and of the runs' steps; list: W",
        }
    }

    pub(crate) fn value(self, lanes: &RunLanes, cursor_ns: i64) -> Option<String> {
        let decimals = if self == Self::Reprojection { 2 } else { 0 };
        lanes.at(self.column()?, cursor_ns).map(|value| fixed(value, decimals))
    }

    /// Plotted column of the runs' tables; `None` for lanes without a curve.
    pub(crate) fn column(self) -> Option<usize> {
        match self {
            Self::Rank => Some(INFORMED),
            Self::Features => Some(FEATURES),
            Self::Reprojection => Some(RMS),
            Self::Findings
            | Self::Run(_)
            | Self::Trajectory(_)
            | Self::Breakpoints
            | Self::Events
            | Self::Outliers
            | Self::Parameters
            | Self::Warnings => None,
        }
    }
}

/// Draws the phases of a run as a bar, with keyframes as ticks; steps that are not computed yet stay empty.
pub(super) fn run(painter: &Painter, theme: &Theme, area: &PlotArea, lanes: &RunLanes, style: RunStyle) {
    let bar = area.rect.shrink2(vec2(0.0, (0.5 * (area.rect.height() - MAX_BAR_HEIGHT)).max(4.0)));
    for segment in visible_segments(area, &lanes.stamps_ns, |row| !lanes.tracking[row]) {
        let rect = Rect::from_x_y_ranges(segment, bar.y_range());
        painter.rect_filled(rect, 0.0, style.color.gamma_multiply(0.12));
        paint_hatch(painter, rect, style.color.gamma_multiply(0.5));
        if rect.width() > 70.0 {
            let galley = painter.layout_no_wrap("initializing".to_owned(), theme::label_font(), theme.text_strong);
            let plate = (theme.plot_background.gamma_multiply(0.85), vec2(2.0, -1.0));
            let at = rect.left_center() + vec2(4.0, 0.0);
            plated_text(painter, at, Align2::LEFT_CENTER, (galley, theme.text_strong), plate);
        }
    }
    for segment in visible_segments(area, &lanes.stamps_ns, |row| lanes.tracking[row]) {
        let rect = Rect::from_x_y_ranges(segment, bar.y_range());
        painter.rect_filled(rect, 0.0, style.color.gamma_multiply(0.4));
    }
    let tick = Stroke::new(1.0, style.color);
    each_pixel(area, lanes.keyframes_ns.iter().copied(), |x| {
        painter.vline(x, bar.bottom() - 4.0..=bar.bottom(), tick);
    });
}

/// Draws the time of a trajectory as a bar, interrupted where its poses are too far apart to be interpolated.
pub(super) fn trajectory(painter: &Painter, area: &PlotArea, track: &PoseTrack, style: RunStyle) {
    let bar = area.rect.shrink2(vec2(0.0, (0.5 * (area.rect.height() - MAX_BAR_HEIGHT)).max(4.0)));
    let stamps_ns: Vec<i64> = track.samples().iter().map(|sample| sample.stamp_ns).collect();
    let goes_on = |row: usize| stamps_ns.get(row + 1).is_some_and(|next| next - stamps_ns[row] <= 2 * NEAREST_POSE_NS);
    for segment in visible_segments(area, &stamps_ns, goes_on) {
        painter.rect_filled(Rect::from_x_y_ranges(segment, bar.y_range()), 0.0, style.color.gamma_multiply(0.4));
    }
}

/// Calls `paint` for each stamp in range, once per pixel column.
fn each_pixel(area: &PlotArea, stamps_ns: impl Iterator<Item = i64>, mut paint: impl FnMut(f32)) {
    let mut last = f32::NEG_INFINITY;
    for stamp_ns in stamps_ns.filter(|stamp_ns| (area.begin_ns..=area.end_ns).contains(stamp_ns)) {
        let x = area.x(stamp_ns).round() + 0.5;
        if x > last {
            paint(x);
            last = x;
        }
    }
}

/// Positions of painted symbols: symbols at the same pixel are painted once.
#[derive(Default)]
struct Covered {
    places: BTreeSet<(i32, i32, u8)>,
}

impl Covered {
    /// True for a new position; `kind` separates symbols that must all be visible.
    fn is_new(&mut self, place: Pos2, kind: u8) -> bool {
        self.places.insert((place.x.round() as i32, place.y.round() as i32, kind))
    }
}

/// Draws infrequent events as symbols.
pub(super) fn events(painter: &Painter, theme: &Theme, area: &PlotArea, runs: &[RunLanes]) {
    let mut covered = Covered::default();
    for (number, lanes) in runs.iter().enumerate() {
        let rise = if runs.len() > 1 { number as f32 / (runs.len() - 1) as f32 - 0.5 } else { 0.0 };
        for event in &lanes.events {
            if (area.begin_ns..=area.end_ns).contains(&event.stamp_ns) {
                let (mark, color) = look_of(event.kind, theme);
                let center = pos2(area.x(event.stamp_ns), area.rect.center().y + rise * (area.rect.height() - 9.0));
                if covered.is_new(center, event.kind as u8) {
                    paint_mark(painter, mark, center, 9.0, color);
                }
            }
        }
    }
}

/// Draws a value of all runs as curves, integers as step curves, with a scale to the left of a high lane. Returns the
/// area with its axis, `None` for a lane without a curve.
pub(super) fn plotted_values(
    painter: &Painter,
    theme: &Theme,
    area: &PlotArea,
    lane: Lane,
    runs: &[RunLanes],
    curves: &mut Vec<Curve>,
) -> Option<PlotArea> {
    let column = lane.column()?;
    curves.resize_with(runs.len(), Curve::default);
    let mut max_value = 0.0_f64;
    for (lanes, curve) in runs.iter().zip(curves.iter_mut()) {
        curve.update(area, lanes.epoch, &lanes.stamps_ns, &lanes.columns[column]);
        max_value = max_value.max(curve.extent.map_or(0.0, |(_, max_value)| max_value));
        if lane == Lane::Rank {
            max_value =
                lanes.columns[STRUCTURAL].iter().copied().filter(|value| value.is_finite()).fold(max_value, f64::max);
        }
    }
    let area = area.with_values(0.0, if max_value > 0.0 { max_value * 1.15 } else { 1.0 });
    if scale_width(area.rect.height()) > 0.0 {
        paint_value_axis(painter, theme, &area, 1.0);
    }
    let painter = &painter.with_clip_rect(area.rect.intersect(painter.clip_rect()));
    for (run, curve) in curves.iter().enumerate() {
        let style = theme.run(run);
        if lane == Lane::Reprojection {
            paint_curve(painter, &area, curve, style, 1.2);
        } else {
            paint_steps(painter, &area, curve, style, 1.2);
        }
    }
    Some(area)
}

/// Draws the values of a lane at the reading cursors and at the pointer's time; `area` is the area of
/// [`plotted_values`].
pub(super) fn read_values(painter: &Painter, ctx: &PanelContext<'_>, lane: Lane, area: &PlotArea, runs: &[RunLanes]) {
    let Some(column) = lane.column() else { return };
    let lines = read_lines(ctx.theme, runs.iter().map(|lanes| (&*lanes.stamps_ns, &*lanes.columns[column])));
    let (unit, whole) = if lane == Lane::Reprojection { (" px", false) } else { ("", true) };
    paint_values(painter, ctx, area, &Readout { key: "", lines: &lines, factor: 1.0, unit, whole });
}

/// Draws hits of breakpoints: filled for enabled ones, in the colour of the run and in its section of the lane.
pub(super) fn breakpoints(painter: &Painter, theme: &Theme, area: &PlotArea, ctx: &PanelContext<'_>) {
    let runs = &ctx.recording.runs;
    for (number, run) in runs.iter().enumerate() {
        let fraction = (number as f32 + 0.5) / runs.len() as f32;
        let y = egui::lerp(area.rect.y_range(), fraction);
        let color = theme.run(number).color;
        for breakpoint in ctx.playback.breakpoints.list() {
            for stamp_ns in breakpoint.hits_ns(run).filter(|at| (area.begin_ns..=area.end_ns).contains(at)) {
                let center = pos2(area.x(stamp_ns), y);
                if breakpoint.enabled {
                    painter.circle_filled(center, 3.5, color);
                } else {
                    painter.circle_stroke(center, 3.0, Stroke::new(1.0, color));
                }
            }
        }
    }
}

/// Draws rejected outliers as lines; the height is their number.
pub(super) fn outliers(painter: &Painter, theme: &Theme, area: &PlotArea, runs: &[RunLanes]) {
    let max_value = runs.iter().flat_map(|lanes| &lanes.rejected).map(|(_, count)| *count).max().unwrap_or(1);
    for (run, lanes) in runs.iter().enumerate() {
        let line = Stroke::new(1.0, theme.run(run).color);
        let foot = area.rect.bottom() - 1.0;
        for (x, count) in highest_by_column(area, &lanes.rejected) {
            let height = (area.rect.height() - 3.0) * count as f32 / max_value as f32;
            painter.vline(x, foot - height..=foot, line);
        }
    }
}

/// The highest count of each pixel column in range, with its screen x; stamps are ascending.
fn highest_by_column(area: &PlotArea, counts: &[(i64, usize)]) -> Vec<(f32, usize)> {
    let mut columns: Vec<(f32, usize)> = Vec::new();
    for (stamp_ns, count) in counts.iter().filter(|(at, _)| (area.begin_ns..=area.end_ns).contains(at)) {
        let x = area.x(*stamp_ns);
        match columns.last_mut() {
            Some((open, max_value)) if open.floor() == x.floor() => {
                if count > max_value {
                    (*open, *max_value) = (x, *count);
                }
            }
            _ => columns.push((x, *count)),
        }
    }
    columns
}

/// Draws warnings about the log and of the steps.
pub(super) fn warnings(painter: &Painter, theme: &Theme, area: &PlotArea, log_ns: &[i64], runs: &[RunLanes]) {
    let step_ns = runs.iter().flat_map(|lanes| &lanes.warnings).map(|(stamp_ns, _)| *stamp_ns);
    let mut covered = Covered::default();
    let mut place = |stamp_ns: i64, mark: EventSymbol, color: Color32| {
        let center = pos2(area.x(stamp_ns), area.rect.center().y);
        if (area.begin_ns..=area.end_ns).contains(&stamp_ns) && covered.is_new(center, mark as u8) {
            paint_mark(painter, mark, center, 9.0, color);
        }
    };
    for stamp_ns in step_ns {
        place(stamp_ns, EventSymbol::Disc, theme.warn);
    }
    for stamp_ns in log_ns {
        place(*stamp_ns, EventSymbol::Square, theme.warn);
    }
}

/// Draws the name of a lane with its value at the cursor.
pub(super) fn label(painter: &Painter, theme: &Theme, rect: Rect, name: &str, value: Option<String>, color: Color32) {
    let clipped = painter.with_clip_rect(rect.intersect(painter.clip_rect()));
    let mut right = rect.right() - 4.0;
    if let Some(value) = value {
        let place = pos2(right, rect.center().y);
        right = painter.text(place, Align2::RIGHT_CENTER, value, theme::number_font(), theme.text_strong).left() - 4.0;
    }
    let mut job = LayoutJob::simple_singleline(name.to_owned(), theme::label_font(), color);
    job.wrap = TextWrapping::truncate_at_width(right - rect.left() - 2.0);
    let galley = clipped.layout_job(job);
    let place = pos2(rect.left() + 2.0, rect.center().y - galley.size().y / 2.0);
    clipped.galley(place, galley, color);
}

pub(super) fn name_width(ui: &Ui, ctx: &PanelContext<'_>, lane: Lane) -> f32 {
    ui.painter().layout_no_wrap(lane.name(ctx), theme::label_font(), ctx.theme.text).size().x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lane_paints_at_most_one_symbol_per_column() {
        let rect = Rect::from_min_max(pos2(0.0, 0.0), pos2(100.0, 20.0));
        let area = PlotArea { rect, begin_ns: 0, end_ns: 12_000, low: 0.0, high: 1.0, middle: None };
        let counts: Vec<(i64, usize)> = (0..12_000).map(|row| (row, if row == 4321 { 40 } else { 3 })).collect();
        let columns = highest_by_column(&area, &counts);
        assert!(columns.len() <= 101 && columns.is_sorted_by(|a, b| a.0.floor() < b.0.floor()));
        assert_eq!(columns.iter().filter(|(x, count)| *count == 40 && (*x - 36.008).abs() < 0.01).count(), 1);
        let mut covered = Covered::default();
        assert!(covered.is_new(pos2(3.1, 5.0), 0) && covered.is_new(pos2(3.1, 5.0), 1));
        assert!(!covered.is_new(pos2(3.2, 5.0), 0) && covered.is_new(pos2(4.0, 5.0), 0));
    }
}
