//! Figure of the Allan deviation of gyroscope and accelerometer. Above each plot: the suggested rig values. In the
//! plot: the axes with their confidence, the fitted sum of terms, and the rig's densities.

use egui::{Align2, Color32, FontFamily, FontId, Painter, Pos2, Rect, Shape, Stroke, Ui, pos2, vec2};

use crate::gui::plot::{ValueAxis, ValuePlot, paint_between, paint_ground};
use crate::gui::theme::{CURVE_WIDTH, Theme, label_font};
use crate::gui::widgets::plated_text;
use crate::log_check::{AllanReport, NoiseTerm, SensorNoise};

/// Space above a plot for the result, in points.
const HEAD: f32 = 76.0;
/// Space to the left of a plot for the values of its axis.
const LEFT: f32 = 46.0;
/// Space below a plot for the averaging times.
const BELOW: f32 = 36.0;
/// A rig's value agrees with a measured one within this factor.
const AGREES: f64 = 1.5;
/// Radius of a marker in points.
const MARKER: f32 = 4.5;

/// Plot whose logarithmic axes contain all deviations of a sensor and its markers.
fn plot_of(sensor: &SensorNoise, rect: Rect) -> Option<ValuePlot> {
    let points = || sensor.axes.iter().flat_map(|axis| &axis.points);
    let axis = |values: &mut dyn Iterator<Item = f64>, room: f64| {
        let positive = values.filter(|value| *value > 0.0);
        let (low, high) = positive.fold((f64::INFINITY, 0.0), |(low, high), it| (it.min(low), it.max(high)));
        ValueAxis { logarithmic: true, low: low / 10_f64.powf(room), high: high * 10_f64.powf(room) }
    };
    let x = axis(&mut points().map(|point| point.tau_s).chain([1.0]), 0.05);
    let deviations = points().flat_map(|point| [point.low, point.deviation]);
    let y = axis(&mut deviations.chain(marks(sensor).map(|it| it.1)), 0.12);
    let several = points().any(|point| point.tau_s != 1.0);
    (several && y.low < y.high).then_some(ValuePlot { rect, x, y })
}

/// Draws decades with lines and values, and thinner lines at 2 and 5.
fn grid(painter: &Painter, theme: &Theme, plot: &ValuePlot) {
    let columns = plot.x.decade_lines(theme, |power, digit, value| match power {
        _ if digit != 1.0 => String::new(),
        -3..=4 => format!("{value}"),
        _ => format!("1e{power}"),
    });
    plot.paint_columns(painter, theme, 3.0, columns);
    let few = (plot.y.high / plot.y.low).log10() < 1.2;
    let label = |power, digit, _| if digit == 1.0 || few { format!("{digit}e{power}") } else { String::new() };
    plot.paint_rows(painter, theme, 4.0, plot.y.decade_lines(theme, label));
}

/// Points at which the terms of a sensor are read, with their letters: white noise at 1 s, the minimum, the random walk
/// at 3 s.
fn marks(sensor: &SensorNoise) -> impl Iterator<Item = (f64, f64, char)> + '_ {
    let white = sensor.terms.white.value.map(|white| (1.0, white, 'N'));
    let walk = sensor.terms.random_walk.value.map(|walk| (3.0, walk, 'K'));
    let model = sensor.axes.first().map(|axis| &axis.points).into_iter().flatten();
    let lowest = model
        .filter_map(|point| Some((point.tau_s, point.model?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(tau_s, _)| tau_s);
    let bias = sensor.terms.bias_instability.value.zip(lowest).map(|(bias, tau_s)| (tau_s, 0.664 * bias, 'B'));
    [white, bias, walk].into_iter().flatten()
}

/// Draws the report into all of the available space.
pub fn allan_ui(ui: &mut Ui, theme: &Theme, report: &AllanReport) {
    let (_, whole) = ui.allocate_space(ui.available_size());
    let painter = ui.painter_at(whole);
    painter.rect_filled(whole, 0.0, theme.background);
    let name = report.log.rsplit(['/', '\\']).next().unwrap_or_default();
    let title = format!(
        "{name}: Allan deviation of {} while stationary, {:.0} s (longest stretch {:.0} s)",
        report.topic,
        report.stationary_s,
        report.longest_s()
    );
    painter.text(whole.min + vec2(12.0, 8.0), Align2::LEFT_TOP, title, font(13.0), theme.text_weak);
    let plots = Rect::from_min_max(whole.min + vec2(0.0, 26.0), whole.max - vec2(0.0, 24.0));
    let width = plots.width() / report.sensors.len().max(1) as f32;
    for (index, sensor) in report.sensors.iter().enumerate() {
        let left = plots.left() + index as f32 * width;
        let rect = Rect::from_min_max(pos2(left, plots.top()), pos2(left + width, plots.bottom()));
        sensor_ui(&painter, theme, sensor, rect);
    }
    legend(&painter, theme, pos2(whole.left() + 12.0, whole.bottom() - 13.0));
}

fn font(size: f32) -> FontId {
    FontId::new(size, FontFamily::Proportional)
}

fn sensor_ui(painter: &Painter, theme: &Theme, sensor: &SensorNoise, rect: Rect) {
    head(painter, theme, sensor, rect);
    let plot = Rect::from_min_max(rect.min + vec2(LEFT + 8.0, HEAD), rect.max - vec2(14.0, BELOW));
    paint_ground(painter, theme, plot);
    let Some(axes) = plot_of(sensor, plot) else { return };
    grid(painter, theme, &axes);
    let below = pos2(plot.center().x, plot.bottom() + 18.0);
    painter.text(below, Align2::CENTER_TOP, "averaging time τ, s", label_font(), theme.text_weak);
    painter.text(
        pos2(plot.left(), plot.top() - 3.0),
        Align2::LEFT_BOTTOM,
        format!("deviation, {}", sensor.unit),
        label_font(),
        theme.text_weak,
    );
    let inside = painter.with_clip_rect(plot);
    let colors = [theme.axis_x, theme.axis_y, theme.axis_z];
    for (axis, color) in sensor.axes.iter().zip(colors) {
        let band = axis.points.iter().map(|point| [point.low, point.high].map(|value| axes.at(point.tau_s, value)));
        paint_between(&inside, band, color.gamma_multiply(0.22));
    }
    for (axis, color) in sensor.axes.iter().zip(colors) {
        let line: Vec<Pos2> = axis.points.iter().map(|point| axes.at(point.tau_s, point.deviation)).collect();
        inside.add(Shape::line(line, Stroke::new(CURVE_WIDTH, color)));
        for point in axis.points.iter().filter(|point| point.vibration) {
            inside.circle_stroke(axes.at(point.tau_s, point.deviation), 2.5, Stroke::new(1.0, theme.text_weak));
        }
    }
    asymptotes(&inside, theme, sensor, &axes);
    given_line(&inside, theme, sensor, &axes);
    model_line(&inside, theme, sensor, &axes);
    for (tau_s, value, letter) in marks(sensor) {
        let at = axes.at(tau_s, value);
        inside.circle_filled(at, MARKER, theme.text_strong);
        inside.circle_stroke(at, MARKER, Stroke::new(1.5, theme.plot_background));
        let galley = inside.layout_no_wrap(letter.to_string(), font(14.0), theme.text_strong);
        let plate = (theme.plot_background.gamma_multiply(0.8), vec2(3.0, 0.0));
        plated_text(&inside, at + vec2(0.0, -9.0), Align2::CENTER_BOTTOM, (galley, theme.text_strong), plate);
    }
}

/// The slopes on which white noise and random walk are read.
fn asymptotes(painter: &Painter, theme: &Theme, sensor: &SensorNoise, axes: &ValuePlot) {
    let terms = [(&sensor.terms.white, -0.5, 1.0), (&sensor.terms.random_walk, 0.5, 3.0)];
    for (value, slope, read_at_s) in terms.into_iter().filter_map(|(term, slope, at)| Some((term.value?, slope, at))) {
        let ends = [axes.x.low, axes.x.high].map(|tau_s| axes.at(tau_s, value * (tau_s / read_at_s).powf(slope)));
        painter.extend(Shape::dotted_line(&ends, theme.text_weak, 4.0, 0.8));
    }
}

/// The deviation of the rig's densities: `√(N²/τ + K² τ/3)`.
fn given_line(painter: &Painter, theme: &Theme, sensor: &SensorNoise, axes: &ValuePlot) {
    let Some(given) = sensor.given else { return };
    let steps = 80;
    let line: Vec<Pos2> = (0..=steps)
        .map(|step| {
            let tau_s = axes.x.low * (axes.x.high / axes.x.low).powf(f64::from(step) / f64::from(steps));
            axes.at(tau_s, (given.white.powi(2) / tau_s + given.random_walk.powi(2) * tau_s / 3.0).sqrt())
        })
        .collect();
    painter.extend(Shape::dashed_line(&line, Stroke::new(CURVE_WIDTH + 0.5, theme.warn), 7.0, 4.0));
}

/// The mean of the fitted axes.
fn model_line(painter: &Painter, theme: &Theme, sensor: &SensorNoise, axes: &ValuePlot) {
    let Some(first) = sensor.axes.first() else { return };
    let line: Option<Vec<Pos2>> = (0..first.points.len())
        .map(|index| {
            let models = sensor.axes.iter().map(|axis| Some(axis.points.get(index)?.model?.powi(2)));
            let sum: f64 = models.sum::<Option<f64>>()?;
            Some(axes.at(first.points[index].tau_s, (sum / sensor.axes.len() as f64).sqrt()))
        })
        .collect();
    if let Some(line) = line {
        painter.add(Shape::line(line, Stroke::new(CURVE_WIDTH, theme.text_strong)));
    }
}

/// Writes the suggested rig values and their comparison with the rig's present values.
fn head(painter: &Painter, theme: &Theme, sensor: &SensorNoise, rect: Rect) {
    let mut name = sensor.sensor.to_owned();
    name[..1].make_ascii_uppercase();
    let left = rect.left() + LEFT + 8.0;
    painter.text(pos2(left, rect.top() + 2.0), Align2::LEFT_TOP, name, font(15.0), theme.text_strong);
    let rows: [(&str, &NoiseTerm, Option<f64>, String); 2] = [
        ("N  noise density", &sensor.terms.white, sensor.given.map(|given| given.white), sensor.density_unit()),
        (
            "K  random walk",
            &sensor.terms.random_walk,
            sensor.given.map(|given| given.random_walk),
            sensor.walk_unit().to_owned(),
        ),
    ];
    for (row, (name, term, given, unit)) in rows.into_iter().enumerate() {
        let y = rect.top() + 22.0 + 18.0 * row as f32;
        painter.text(pos2(left, y), Align2::LEFT_TOP, name, font(13.0), theme.text);
        let value = match (term.value, term.sigma, term.limit) {
            (Some(value), Some(sigma), _) => {
                format!("{value:.2e} ± {:.0} % {unit}", 100.0 * sigma / value)
            }
            (.., Some(limit)) => format!("< {limit:.1e} {unit}, not detected"),
            _ => "not identified".to_owned(),
        };
        let end = painter.text(pos2(left + 118.0, y), Align2::LEFT_TOP, value, font(13.0), theme.text_strong);
        let Some((text, color)) = given.and_then(|given| verdict(theme, term, given)) else { continue };
        painter.text(pos2(end.right() + 14.0, y), Align2::LEFT_TOP, text, font(13.0), color);
    }
}

/// Comparison of a rig's value with the measured one.
fn verdict(theme: &Theme, term: &NoiseTerm, given: f64) -> Option<(String, Color32)> {
    let Some(value) = term.value else {
        let limit = term.limit?;
        return (given > limit).then(|| (format!("rig {given:.1e} is too large"), theme.warn));
    };
    let ratio = given / value;
    Some(if ratio > 1.0 / AGREES && ratio < AGREES {
        (format!("rig {given:.2e} agrees"), theme.ok)
    } else if ratio < 1.0 {
        (format!("rig {given:.2e} is {:.1} × too small", 1.0 / ratio), theme.error)
    } else {
        (format!("rig {given:.2e} is {ratio:.1} × too large"), theme.warn)
    })
}

fn legend(painter: &Painter, theme: &Theme, at: Pos2) {
    let entries = [
        ("x", theme.axis_x, false),
        ("y", theme.axis_y, false),
        ("z (bands 68 %)", theme.axis_z, false),
        ("fitted terms", theme.text_strong, false),
        ("rig", theme.warn, true),
    ];
    let mut x = at.x;
    for (name, color, dashed) in entries {
        let line = [pos2(x, at.y), pos2(x + 24.0, at.y)];
        if dashed {
            painter.extend(Shape::dashed_line(&line, Stroke::new(CURVE_WIDTH + 0.5, color), 7.0, 4.0));
        } else {
            painter.line_segment(line, Stroke::new(CURVE_WIDTH + 0.5, color));
        }
        let text = painter.text(pos2(x + 30.0, at.y), Align2::LEFT_CENTER, name, font(12.0), theme.text);
        x = text.right() + 18.0;
    }
    painter.text(
        pos2(x, at.y),
        Align2::LEFT_CENTER,
        "N: white noise, read at 1 s    B: minimum / 0.664    K: random walk, read at 3 s    ○ vibration, not fitted",
        label_font(),
        theme.text_weak,
    );
}
