//! Figure of the calibration of one mechanism over its flights: one plot per parameter, each flight with its σ, the sum of
//! the flights between two changes with the required accuracy about it.

use egui::{Align2, Color32, FontFamily, FontId, Painter, Pos2, Rect, Stroke, Ui, pos2, vec2};

use crate::geometry::Dimension;
use crate::gui::plot::paint_ground;
use crate::gui::theme::{CURVE_WIDTH, HAIRLINE_WIDTH, Theme, label_font, number_font};
use crate::table::Shown;

/// Space above the plots for the result, in points.
const HEAD: f32 = 58.0;
/// Space above a plot for its parameter.
const NAME: f32 = 20.0;
/// Space left of a plot for the values of its axis.
const LEFT: f32 = 62.0;
const GAP: f32 = 14.0;
/// Space below the last plots for the numbers of the flights.
const BELOW: f32 = 30.0;
const COLUMNS: usize = 3;
const MARKER: f32 = 3.5;
/// Required accuracy below which the axis is labelled by its range instead, as a ratio of half the range.
const NARROW: f64 = 0.3;
/// Labelled value as a ratio of half the range.
const WIDE: f64 = 0.75;

/// A history as numbers; by flight are all lists of a plot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HistoryFigure {
    /// Result, one line each.
    pub sentences: Vec<String>,
    /// Interval of each flight, from 0.
    pub intervals: Vec<usize>,
    /// True for a flight that is not in the sum of its interval.
    pub alone: Vec<bool>,
    pub plots: Vec<HistoryPlot>,
}

/// One parameter, in radians, metres, seconds or pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryPlot {
    pub name: String,
    pub dimension: Dimension,
    /// Standard deviation that the rig requires.
    pub required: f64,
    /// Value and standard deviation of each flight alone with its prior.
    pub flights: Vec<(f64, f64)>,
    /// The same of the sum of each interval.
    pub intervals: Vec<(f64, f64)>,
    /// Flights at which a change of this parameter explains a misfit.
    pub changed: Vec<usize>,
}

/// Draws the history into all of the available space.
pub fn history_ui(ui: &mut Ui, theme: &Theme, history: &HistoryFigure) {
    let (_, whole) = ui.allocate_space(ui.available_size());
    let painter = ui.painter_at(whole);
    painter.rect_filled(whole, 0.0, theme.background);
    for (row, sentence) in history.sentences.iter().take(2).enumerate() {
        let at = whole.min + vec2(12.0, 8.0 + 22.0 * row as f32);
        painter.text(at, Align2::LEFT_TOP, sentence, font(15.0), theme.text_strong);
    }
    let plots = Rect::from_min_max(whole.min + vec2(0.0, HEAD), whole.max - vec2(GAP, BELOW));
    let rows = history.plots.len().div_ceil(COLUMNS).max(1);
    let size = vec2(plots.width() / COLUMNS as f32, plots.height() / rows as f32);
    for (place, plot) in history.plots.iter().enumerate() {
        let (row, column) = (place % rows, place / rows);
        let min = plots.min + vec2(column as f32 * size.x, row as f32 * size.y);
        let cell = Rect::from_min_size(min, size);
        let area = Rect::from_min_max(cell.min + vec2(LEFT, NAME), cell.max - vec2(0.0, GAP));
        paint_parameter(&painter, theme, history, plot, area);
        if row + 1 == rows || place + 1 == history.plots.len() {
            for flight in 0..history.intervals.len() {
                let at = pos2(flight_x(history, area, flight as f64), area.bottom() + 2.0);
                painter.text(at, Align2::CENTER_TOP, (flight + 1).to_string(), number_font(), theme.text_weak);
            }
        }
    }
    let legend = "numbers: flights    ● flight ± σ    ○ not in the sum    line: sum of the flights with ± σ    \
                  grey: required accuracy    vertical line: change";
    painter.text(whole.left_bottom() + vec2(12.0, -4.0), Align2::LEFT_BOTTOM, legend, label_font(), theme.text_weak);
}

fn font(size: f32) -> FontId {
    FontId::new(size, FontFamily::Proportional)
}

fn flight_x(history: &HistoryFigure, area: Rect, flight: f64) -> f32 {
    area.left() + area.width() * ((flight + 0.5) / history.intervals.len().max(1) as f64) as f32
}

fn paint_parameter(painter: &Painter, theme: &Theme, history: &HistoryFigure, plot: &HistoryPlot, area: Rect) {
    let HistoryPlot { name, dimension, required, flights, intervals, changed } = plot;
    paint_ground(painter, theme, area);
    let Some(newest) = intervals.last().copied() else { return };
    let shown = Shown::of(*dimension);
    let met = newest.1 <= *required;
    let value = shown.value_with_sigma(newest.0, newest.1);
    let head = painter.text(area.left_top() - vec2(0.0, 3.0), Align2::LEFT_BOTTOM, name, font(13.0), theme.text_strong);
    let color = if met { theme.text } else { theme.warn };
    painter.text(head.right_bottom() + vec2(10.0, 0.0), Align2::LEFT_BOTTOM, value, font(13.0), color);

    // Angles may lie on both sides of half a turn.
    let relative = |value: f64| dimension.difference(value, newest.0);
    let ends = flights.iter().map(|(value, sigma)| relative(*value).abs() + sigma);
    let range = ends.chain([1.2 * required]).fold(0.0, f64::max) * 1.08;
    let y = |value: f64| area.center().y - (relative(value) / range) as f32 * area.height() / 2.0;
    let inside = painter.with_clip_rect(area);
    for (interval, (value, sigma)) in intervals.iter().enumerate() {
        let of_interval =
            history.intervals.iter().enumerate().filter(|(_, it)| **it == interval).map(|(flight, _)| flight);
        let (Some(first), Some(last)) = (of_interval.clone().min(), of_interval.max()) else { continue };
        let columns = flight_x(history, area, first as f64 - 0.5)..=flight_x(history, area, last as f64 + 0.5);
        let band = |half: f64| {
            let rows = y(newest.0 + relative(*value) + half)..=y(newest.0 + relative(*value) - half);
            Rect::from_x_y_ranges(columns.clone(), rows)
        };
        inside.rect_filled(band(*required), 0.0, theme.hatch.gamma_multiply(0.35));
        inside.rect_filled(band(*sigma), 0.0, theme.axis_z.gamma_multiply(0.35));
        inside.hline(columns.clone(), band(0.0).center().y, Stroke::new(CURVE_WIDTH, theme.axis_z));
    }
    for (flight, _) in history.intervals.windows(2).enumerate().filter(|(_, pair)| pair[0] != pair[1]) {
        let x = flight_x(history, area, flight as f64 + 0.5);
        let explains = changed.contains(&(flight + 1));
        let (width, color) = if explains { (2.0, theme.error) } else { (HAIRLINE_WIDTH, theme.text_weak) };
        inside.vline(x, area.y_range(), Stroke::new(width, color));
    }
    for (flight, (value, sigma)) in flights.iter().enumerate() {
        let x = flight_x(history, area, flight as f64);
        let color = if changed.contains(&flight) { theme.error } else { theme.text_strong };
        inside.line_segment([pos2(x, y(value + sigma)), pos2(x, y(value - sigma))], Stroke::new(1.2, color));
        let alone = history.alone.get(flight).copied().unwrap_or_default();
        paint_marker(&inside, theme, pos2(x, y(*value)), color, alone);
    }
    // In a wide range the required accuracy is too narrow for labels.
    let step = if *required > NARROW * range { *required } else { WIDE * range };
    for offset in [-step, 0.0, step] {
        let sign = if offset > 0.0 { "+" } else { "" };
        let text = format!("{sign}{}", shown.value(offset, *required));
        let at = pos2(area.left() - 5.0, y(newest.0 + offset));
        painter.text(at, Align2::RIGHT_CENTER, text, number_font(), theme.text_weak);
    }
}

fn paint_marker(painter: &Painter, theme: &Theme, at: Pos2, color: Color32, hollow: bool) {
    if hollow {
        painter.circle_filled(at, MARKER, theme.plot_background);
        painter.circle_stroke(at, MARKER, Stroke::new(1.4, color));
    } else {
        painter.circle_filled(at, MARKER, color);
    }
}
