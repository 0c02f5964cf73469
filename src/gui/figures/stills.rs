//! Figure of a calibration from stills. Above: errors in pixels of each set with the angles as read. Below: one strip per
//! joint with the corrections of its readings and the σ of its encoder.

use egui::{Align2, Color32, FontFamily, FontId, Painter, Pos2, Rect, Stroke, Ui, pos2, vec2};

use crate::calibration::stills::{AngleModel, ScoredChain, SetReport, StillsOutcome, ViewReport};
use crate::gui::plot::{ValueAxis, ValuePlot, paint_ground};
use crate::gui::theme::{HAIRLINE_WIDTH, Theme, label_font, number_font};

/// Space left of a plot for the values of its axis, in points.
const LEFT: f32 = 64.0;
const RIGHT: f32 = 16.0;
/// Space above the first plot for result and legend.
const HEAD: f32 = 74.0;
/// Space between two plots.
const GAP: f32 = 22.0;
/// Space below the last plot for the ids of the sets.
const BELOW: f32 = 34.0;
/// Ratio of the first plot's height to the height of all plots.
const FIRST: f32 = 0.46;
const MARKER: f32 = 3.5;
/// Half height of a strip, in standard deviations of the encoder.
const STRIP_SIGMAS: f64 = 4.5;
/// Half height of a strip of angles without a standard deviation, in root mean squares of the corrections.
const FREE_STRIP: f64 = 2.5;

/// Draws the outcome into all of the available space.
pub fn stills_ui(ui: &mut Ui, theme: &Theme, outcome: &StillsOutcome) {
    let (_, whole) = ui.allocate_space(ui.available_size());
    let painter = ui.painter_at(whole);
    painter.rect_filled(whole, 0.0, theme.background);
    head(&painter, theme, outcome, whole);
    let plots = Rect::from_min_max(whole.min + vec2(LEFT, HEAD), whole.max - vec2(RIGHT, BELOW));
    let first_height = plots.height() * FIRST;
    let first = Rect::from_min_size(plots.min, vec2(plots.width(), first_height - GAP));
    errors(&painter, theme, outcome, first);
    let joints = outcome.joints.len().max(1);
    let strip_height = (plots.height() - first_height) / joints as f32;
    for joint in 0..outcome.joints.len() {
        let top = plots.top() + first_height + joint as f32 * strip_height;
        let strip = Rect::from_min_size(pos2(plots.left(), top), vec2(plots.width(), strip_height - GAP * 0.5));
        corrections(&painter, theme, outcome, joint, strip);
    }
    for (place, set) in outcome.sets.iter().enumerate() {
        let at = pos2(set_x(outcome, plots, place), plots.bottom());
        painter.text(at, Align2::CENTER_TOP, set.id.to_string(), number_font(), theme.text_weak);
    }
    let below = pos2(plots.center().x, whole.bottom() - 3.0);
    painter.text(below, Align2::CENTER_BOTTOM, "set", label_font(), theme.text_weak);
}

fn font(size: f32) -> FontId {
    FontId::new(size, FontFamily::Proportional)
}

/// Horizontal position of a set.
fn set_x(outcome: &StillsOutcome, plot: Rect, place: usize) -> f32 {
    plot.left() + plot.width() * (place as f32 + 0.5) / outcome.sets.len().max(1) as f32
}

/// Mean over the rigid cameras of a set, `None` if no camera has the value.
fn mean(set: &SetReport, of: fn(&ViewReport) -> Option<f64>) -> Option<f64> {
    let values: Vec<f64> = set.views.iter().filter_map(of).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// A series of the first plot.
struct ErrorSeries {
    name: &'static str,
    of: fn(&ViewReport) -> Option<f64>,
    color: Color32,
    filled: bool,
}

/// Series of a calibration, or of the judgement of a chain.
fn series(theme: &Theme, outcome: &StillsOutcome) -> Vec<ErrorSeries> {
    let judged = outcome.angles.is_none();
    let initial = ErrorSeries {
        name: "initial chain, angles as read",
        of: |view| view.initial_px,
        color: theme.text_weak,
        filled: false,
    };
    let floor = ErrorSeries {
        name: "floor: pose of the image alone",
        of: |view| Some(view.floor_px),
        color: theme.hatch,
        filled: true,
    };
    let (as_read, estimated) = if judged {
        let as_read: fn(&ViewReport) -> Option<f64> = |view| view.as_read_px;
        let estimated: fn(&ViewReport) -> Option<f64> = |view| view.estimated_px;
        (("given chain, angles as read", as_read), ("given chain, angles estimated", estimated))
    } else {
        let as_read: fn(&ViewReport) -> Option<f64> = |view| view.hold_out_as_read_px.or(view.as_read_px);
        let estimated: fn(&ViewReport) -> Option<f64> = |view| view.hold_out_estimated_px.or(view.estimated_px);
        (("calibrated without this set, angles as read", as_read), ("the same, angles estimated", estimated))
    };
    let as_read = ErrorSeries { name: as_read.0, of: as_read.1, color: theme.axis_x, filled: true };
    let estimated = ErrorSeries { name: estimated.0, of: estimated.1, color: theme.axis_z, filled: true };
    vec![floor, initial, estimated, as_read]
}

fn head(painter: &Painter, theme: &Theme, outcome: &StillsOutcome, whole: Rect) {
    let chain = if outcome.angles.is_some() { ScoredChain::HoldOut } else { ScoredChain::Given };
    let errors: Vec<String> = outcome
        .scores
        .iter()
        .filter(|score| score.chain == chain)
        .filter_map(|score| Some(format!("{} {:.1} px", score.camera, score.as_read?.mean_px)))
        .collect();
    let wrong = outcome.sets.iter().filter(|set| set.wrong).count();
    let model = match outcome.angles {
        Some(AngleModel::Encoder) => "",
        Some(AngleModel::Free) => " calibrated with free angles",
        None => ", given chain",
    };
    let title = format!(
        "{}{model}: {} with the angles as read; {wrong} of {} sets with wrong readings",
        outcome.configuration,
        errors.join(", "),
        outcome.sets.len()
    );
    painter.text(whole.min + vec2(12.0, 8.0), Align2::LEFT_TOP, title, font(16.0), theme.text_strong);
    let mut x = whole.left() + LEFT;
    let y = whole.top() + 42.0;
    for series in series(theme, outcome).into_iter().rev() {
        marker(painter, pos2(x + MARKER, y), series.color, series.filled);
        let text = painter.text(pos2(x + 12.0, y), Align2::LEFT_CENTER, series.name, font(12.5), theme.text);
        x = text.right() + 20.0;
    }
}

fn marker(painter: &Painter, at: Pos2, color: Color32, filled: bool) {
    if filled {
        painter.circle_filled(at, MARKER, color);
    } else {
        painter.circle_stroke(at, MARKER, Stroke::new(1.2, color));
    }
}

/// Shades the sets with wrong readings.
fn shade_wrong(painter: &Painter, theme: &Theme, outcome: &StillsOutcome, plot: Rect) {
    let half = plot.width() / outcome.sets.len().max(1) as f32 / 2.0;
    for (place, _) in outcome.sets.iter().enumerate().filter(|(_, set)| set.wrong) {
        let x = set_x(outcome, plot, place);
        let column = Rect::from_x_y_ranges(x - half..=x + half, plot.y_range());
        painter.rect_filled(column, 0.0, theme.warn.gamma_multiply(0.15));
    }
}

/// Errors of all sets over a logarithmic axis.
fn errors(painter: &Painter, theme: &Theme, outcome: &StillsOutcome, plot: Rect) {
    paint_ground(painter, theme, plot);
    shade_wrong(painter, theme, outcome, plot);
    let all = series(theme, outcome);
    let values = outcome.sets.iter().flat_map(|set| all.iter().filter_map(|series| mean(set, series.of)));
    let (low, high) = values
        .filter(|value| *value > 0.0)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if !(low <= high && high.is_finite()) {
        return;
    }
    let sets = ValueAxis { logarithmic: false, low: -0.5, high: outcome.sets.len() as f64 - 0.5 };
    let errors_px = ValueAxis { logarithmic: true, low: low / 1.3, high: high * 1.3 };
    let axes = ValuePlot { rect: plot, x: sets, y: errors_px };
    axes.paint_rows(painter, theme, 6.0, errors_px.decade_lines(theme, |_, _, value| format!("{value}")));
    let above = pos2(plot.left() - 44.0, plot.top() - 5.0);
    painter.text(above, Align2::LEFT_BOTTOM, "error in the rigid cameras, px", label_font(), theme.text_weak);
    for (place, set) in outcome.sets.iter().enumerate() {
        for series in &all {
            if let Some(value) = mean(set, series.of).filter(|value| *value > 0.0) {
                marker(painter, axes.at(place as f64, value), series.color, series.filled);
            }
        }
    }
}

/// Strip of one joint: corrections with ± σ, and the σ of the encoder as a band.
fn corrections(painter: &Painter, theme: &Theme, outcome: &StillsOutcome, joint: usize, plot: Rect) {
    paint_ground(painter, theme, plot);
    shade_wrong(painter, theme, outcome, plot);
    let rms_deg = outcome.rms_correction_deg(joint);
    let free = outcome.angles == Some(AngleModel::Free);
    let sigma_deg = outcome.noise.encoder_rad.get(joint).map(|sigma| sigma.to_degrees()).filter(|_| !free);
    let range = sigma_deg.map_or(FREE_STRIP * rms_deg, |sigma| STRIP_SIGMAS * sigma).max(0.01);
    let y = |value_deg: f64| plot.center().y - (value_deg / range).clamp(-1.0, 1.0) as f32 * plot.height() / 2.0;
    if let Some(sigma_deg) = sigma_deg {
        let band = Rect::from_x_y_ranges(plot.x_range(), y(sigma_deg)..=y(-sigma_deg));
        painter.rect_filled(band, 0.0, theme.ok.gamma_multiply(0.18));
    }
    painter.hline(plot.x_range(), y(0.0), Stroke::new(HAIRLINE_WIDTH, theme.hatch));
    for (value_deg, align) in [(-range, Align2::RIGHT_BOTTOM), (0.0, Align2::RIGHT_CENTER), (range, Align2::RIGHT_TOP)]
    {
        let at = pos2(plot.left() - 6.0, y(value_deg));
        painter.text(at, align, format!("{value_deg:.1}°"), number_font(), theme.text_weak);
    }
    let name = match sigma_deg {
        Some(sigma_deg) => format!("{}: correction of the reading; band: σ {sigma_deg:.2}°", outcome.joints[joint]),
        None => format!("{}: correction of the reading, {rms_deg:.1}° rms; every angle is free", outcome.joints[joint]),
    };
    let colors = [theme.axis_x, theme.axis_y, theme.axis_z];
    let color = colors[joint % colors.len()];
    for (place, set) in outcome.sets.iter().enumerate() {
        let (x, value_deg) = (set_x(outcome, plot, place), set.corrections_deg[joint]);
        let sigma = set.sigmas_deg.get(joint).copied().filter(|sigma| sigma.is_finite()).unwrap_or(0.0);
        let ends = [pos2(x, y(value_deg - sigma)), pos2(x, y(value_deg + sigma))];
        painter.line_segment(ends, Stroke::new(1.2, color));
        marker(painter, pos2(x, y(value_deg)), color, true);
        if value_deg.abs() > range {
            let (side, align) = if value_deg > 0.0 { (1.0, Align2::CENTER_TOP) } else { (-1.0, Align2::CENTER_BOTTOM) };
            // Values of neighbouring sets stand above one another.
            let shift = if place % 2 == 0 { 8.0 } else { 20.0 };
            let at = pos2(x, y(value_deg) + side * shift);
            painter.text(at, align, format!("{value_deg:.1}°"), number_font(), theme.text_strong);
        }
    }
    let galley = painter.layout_no_wrap(name, font(12.5), theme.text);
    let ground = Rect::from_min_size(plot.min, galley.size() + vec2(12.0, 5.0));
    painter.rect_filled(ground, 0.0, theme.plot_background);
    painter.galley(plot.min + vec2(6.0, 3.0), galley, theme.text);
}
