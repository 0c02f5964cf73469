//! Painting of one small plot: value with ±3σ band, ground truth, and the ranges in which the parameter is not
//! determined.

use std::collections::BTreeMap;

use egui::{Align2, Color32, Painter, Rangef, Rect, Stroke, StrokeKind, Ui, pos2, vec2};

use super::model::{CalibrationHistory, ConvertedHistory, ParameterCurve};
use super::range::{paint_outside, value_range};
use crate::gimbal::{ParameterId, Parameterization};
use crate::gui::PanelContext;
use crate::gui::derived::chain_values::ParameterValues;
use crate::gui::derived::flight::DeterminationHistory;
use crate::gui::determination::look_of;
use crate::gui::help::terms::window;
use crate::gui::parameter_names::{CalibrationPart, heading_of, meaning_of};
use crate::gui::plot::{
    BandCurve, Clicks, Curve, Interaction, PlotArea, ReadLine, Readout, StateCurve, Wheel, paint_band, paint_curve,
    paint_ground, paint_hatch, paint_line, paint_time_axis, paint_value_axis, plot_ui, value_range_of, visible_range,
    within_gutters,
};
use crate::gui::theme::{self, CURVE_WIDTH, Theme};
use crate::gui::under_pointer::{Item, offer, offer_item};
use crate::gui::units::{Shown, fixed};
use crate::observability::Determination;
use crate::text::Named as _;

/// Height of the strip of the verdict at the bottom of a plot, in points.
const STRIP_HEIGHT: f32 = 3.0;
/// Width of a sample in the legend, in points.
const SAMPLE_WIDTH: f32 = 26.0;
/// Height of the line with name and value, in points.
const TITLE_HEIGHT: f32 = 15.0;
/// Height of the line with verdict and error below it, in points.
const NOTE_HEIGHT: f32 = 13.0;
/// Height of a cell above its times from which on it has that line, in points.
const MIN_HEIGHT_WITH_NOTE: f32 = 70.0;

/// Verdicts with a mark in the plots.
pub(super) const MARKED: [Determination; 6] = [
    Determination::Given,
    Determination::WeaklyDetermined,
    Determination::NotDetermined,
    Determination::Redundant,
    Determination::Unknown,
    Determination::Initializing,
];

pub(super) fn heading(ui: &Ui, ctx: &PanelContext<'_>, part: CalibrationPart, rect: Rect) {
    let painter = ui.painter();
    let theme = ctx.theme;
    painter.vline(rect.right(), rect.y_range(), Stroke::new(1.0, theme.outline));
    let place = pos2(rect.left(), rect.top() + 1.0);
    painter.text(place, Align2::LEFT_TOP, heading_of(part, &ctx.recording.rig), theme::label_font(), theme.text_weak);
}

/// Draws the legend of lines and marks in a free rectangle of the layout.
pub(super) fn legend(ui: &Ui, ctx: &PanelContext<'_>, rect: Rect) {
    const LINE: f32 = 15.0;
    let painter = ui.painter_at(rect);
    let mut line = 0;
    legend_entries(ctx, &mut |text, paint| {
        let top = rect.top() + TITLE_HEIGHT + line as f32 * LINE;
        let place = Rect::from_min_size(pos2(rect.left() + 8.0, top), vec2(SAMPLE_WIDTH, LINE - 4.0));
        if place.bottom() < rect.bottom() {
            paint(&painter, place);
            let left = place.right_center() + vec2(6.0, 0.0);
            painter.text(left, Align2::LEFT_CENTER, text, theme::label_font(), ctx.theme.text);
            line += 1;
        }
    });
}

/// Height in points of a row of the legend above the plots of a figure.
const LEGEND_ROW_HEIGHT: f32 = 18.0;

/// Draws the same legend in rows at the top of a rectangle, for figures; returns their height.
pub(super) fn legend_rows(ui: &Ui, ctx: &PanelContext<'_>, rect: Rect) -> f32 {
    const HEIGHT: f32 = 11.0;
    let painter = ui.painter_at(rect);
    let mut at = rect.left_top() + vec2(0.0, 0.5 * LEGEND_ROW_HEIGHT);
    legend_entries(ctx, &mut |text, paint| {
        let galley = painter.layout_no_wrap(text.to_owned(), theme::label_font(), ctx.theme.text);
        let width = SAMPLE_WIDTH + 5.0 + galley.size().x;
        if at.x > rect.left() && at.x + width > rect.right() {
            at = pos2(rect.left(), at.y + LEGEND_ROW_HEIGHT);
        }
        let sample = Rect::from_min_size(at - vec2(0.0, 0.5 * HEIGHT), vec2(SAMPLE_WIDTH, HEIGHT));
        paint(&painter, sample);
        let left = sample.right_center() + vec2(5.0, 0.0);
        painter.galley(Align2::LEFT_CENTER.anchor_size(left, galley.size()).min, galley, ctx.theme.text);
        at.x += width + 14.0;
    });
    at.y + 0.5 * LEGEND_ROW_HEIGHT - rect.top()
}

/// Draws the sample of an entry of the legend into a rectangle.
type PaintSample<'a> = &'a dyn Fn(&Painter, Rect);

/// Calls a function with every entry of the legend: its text and the function that draws its sample.
fn legend_entries(ctx: &PanelContext<'_>, add_entry: &mut dyn FnMut(&str, PaintSample<'_>)) {
    let theme = ctx.theme;
    for (number, run) in ctx.recording.runs.iter().enumerate() {
        let style = theme.run(number);
        add_entry(&run.spec.label, &|painter, place| {
            paint_line(painter, &[place.left_center(), place.right_center()], style, CURVE_WIDTH);
        });
    }
    let band = theme.run(ctx.selection.run).color.gamma_multiply(0.22);
    add_entry("±3σ", &|painter, place| {
        painter.rect_filled(place, 0.0, band);
    });
    if ctx.recording.ground_truth_rig.is_some() {
        add_entry("ground truth", &|painter, place| {
            paint_line(painter, &[place.left_center(), place.right_center()], theme.ground_truth_style(), CURVE_WIDTH);
        });
    }
    let classical = ctx.recording.runs.iter().any(|run| {
        run.steps.last().is_some_and(|last| last.report.calibration.parameterization == Parameterization::Classical)
    });
    let is_withheld = ctx.selected_run().is_some_and(|run| ctx.answer(run).withheld().is_some());
    let occurs = |verdict: &Determination| match verdict {
        Determination::Redundant => classical,
        Determination::Unknown => is_withheld,
        _ => true,
    };
    for verdict in MARKED.into_iter().filter(occurs) {
        add_entry(verdict.name(), &|painter, place| {
            if is_hatched(verdict) {
                paint_hatch(painter, place, theme.hatch);
            }
            let strip = Rect::from_min_max(pos2(place.left(), place.bottom() - STRIP_HEIGHT), place.max);
            painter.rect_filled(strip, 0.0, look_of(verdict, theme).1);
        });
    }
}

pub(super) struct PlotData<'a> {
    /// Calibration of each run in its own parameterization.
    pub(super) histories: &'a [CalibrationHistory],
    /// Runs in a parameterization other than the shown one, converted to it.
    pub(super) converted: &'a [ConvertedHistory],
    /// Ground-truth values in the shown run's parameterization.
    pub(super) ground_truth: &'a ParameterValues,
    pub(super) shown: usize,
    /// Verdicts on the parameters of the shown run at its steps.
    pub(super) verdicts: &'a DeterminationHistory,
    pub(super) wheel: Wheel,
}

impl<'a> PlotData<'a> {
    /// Epoch, stamps and values of a run's parameter.
    fn values(&self, run: usize, parameter: ParameterId) -> Option<(u64, &'a [i64], &'a [f64])> {
        let converted = self.converted.get(run).filter(|converted| !converted.stamps_ns.is_empty());
        if let Some(converted) = converted {
            let values = converted.values.get(&parameter)?;
            return Some((converted.epoch, &converted.stamps_ns, values));
        }
        let history = self.histories.get(run)?;
        Some((history.epoch, &history.stamps_ns, &history.parameter(parameter)?.values))
    }

    /// Brings the curves of the runs, and band and verdicts of the shown one, to the shown range of time.
    fn update_curves(
        &self,
        curves: &mut BTreeMap<(usize, ParameterId), ParameterCurves>,
        area: &PlotArea,
        id: ParameterId,
        parameter: &ParameterCurve,
        runs: &[usize],
    ) {
        for run in runs {
            let Some((epoch, stamps_ns, values)) = self.values(*run, id) else { continue };
            let curves = curves.entry((*run, id)).or_default();
            curves.value.update(area, epoch, stamps_ns, values);
            if *run == self.shown {
                curves.band.update(area, epoch, stamps_ns, &parameter.lower, &parameter.upper);
                let (epoch, stamps_ns) = (self.verdicts.epoch, &self.verdicts.stamps_ns);
                let verdicts = self.verdicts.verdicts(id);
                for (segments, verdict) in curves.verdicts.iter_mut().zip(MARKED) {
                    segments.update(area, epoch, stamps_ns, |row| verdicts.get(row) == Some(&verdict));
                }
            }
        }
    }

    /// Values of the other runs at the cursor, with a note for those outside the plot.
    fn others_lines(
        &self,
        ctx: &PanelContext<'_>,
        runs: &[usize],
        parameter: ParameterId,
        shown: Shown,
        area: &PlotArea,
    ) -> Vec<String> {
        let line = |run: usize| {
            let (_, stamps_ns, values) = self.values(run, parameter)?;
            let row = stamps_ns.partition_point(|stamp_ns| *stamp_ns <= ctx.cursor_ns).checked_sub(1)?;
            let value = values.get(row).copied().filter(|value| value.is_finite())?;
            let outside = if (area.low..=area.high).contains(&value) { "" } else { ", outside the axis range" };
            let label = &ctx.recording.runs.get(run)?.spec.label;
            let value = shown.value(value, f64::NAN);
            Some(format!("{label}: {value}{outside}"))
        };
        runs.iter().filter(|run| **run != self.shown).filter_map(|run| line(*run)).collect()
    }
}

/// Draws the plot of one parameter in a cell with the height of its gutter of times; a click selects the parameter.
pub(super) fn cell_ui(
    ui: &Ui,
    ctx: &mut PanelContext<'_>,
    data: &PlotData<'_>,
    curves: &mut BTreeMap<(usize, ParameterId), ParameterCurves>,
    id: ParameterId,
    (rect, below): (Rect, f32),
) {
    let shown_run = data.shown;
    let Some(history) = data.histories.get(shown_run) else { return };
    let Some(parameter) = history.parameter(id) else { return };
    let shown = id.shown();
    let name = &ctx.names().name(id);
    let theme = *ctx.theme;
    let (begin_ns, end_ns) = visible_range(ctx);
    let has_note = rect.height() - below >= MIN_HEIGHT_WITH_NOTE;
    let above = TITLE_HEIGHT + if has_note { NOTE_HEIGHT } else { 0.0 };
    let plot = within_gutters(rect.with_min_y(rect.top() + above), below);
    let area = PlotArea { rect: plot, begin_ns, end_ns, low: 0.0, high: 1.0, middle: None };

    let overlaid: Vec<usize> = (0..data.histories.len()).filter(|run| data.values(*run, id).is_some()).collect();
    data.update_curves(curves, &area, id, parameter, &overlaid);
    let curve_of = |run: usize| curves.get(&(run, id));
    let ground_truth = data.ground_truth.get(&id).map(|truth| parameter.unwrap_near(id, *truth));
    let key = format!("convergence {name}");
    let area = {
        let extent_of = |run: usize| curve_of(run)?.value.extent;
        let others = overlaid.iter().filter(|run| **run != shown_run).filter_map(|run| extent_of(*run));
        with_range(ctx, &key, area, value_range(extent_of(shown_run), ground_truth, others, parameter))
    };

    let painter = ui.painter_at(rect.expand(1.0));
    let inner = painter.with_clip_rect(plot);
    paint_ground(&painter, &theme, plot);
    paint_value_axis(&painter, &theme, &area, shown.factor);
    paint_time_axis(&painter, &theme, &area, below);
    if let Some(curves) = curve_of(shown_run) {
        paint_verdicts(&inner, &theme, &area, curves);
        let fill = theme.run(shown_run).color.gamma_multiply(0.22);
        paint_band(&inner, &area, &curves.band, fill);
    }
    if let Some(ground_truth) = ground_truth {
        let y = area.y(ground_truth);
        let line = [pos2(plot.left(), y), pos2(plot.right(), y)];
        paint_line(&inner, &line, theme.ground_truth_style(), CURVE_WIDTH);
    }
    paint_runs(&inner, &theme, &area, &overlaid, shown_run, curve_of);
    let selected = ctx.selection.parameter == Some(id);
    let border = if selected { Stroke::new(2.0, theme.accent) } else { Stroke::new(1.0, theme.outline) };
    painter.rect_stroke(plot, 0.0, border, StrokeKind::Inside);

    let row = history.row_at(ctx.cursor_ns);
    let verdict = data.verdicts.verdict(id, data.verdicts.row_at(ctx.cursor_ns));
    let value = row.map(|row| (parameter.values[row], parameter.sigmas[row]));
    title(&painter, ctx, rect, name, shown, value, (verdict, !has_note), selected);
    let error =
        value.zip(ground_truth).map(|((value, sigma), ground_truth)| (id.principal_value(value - ground_truth), sigma));
    if has_note {
        let error = error.map(|(error, sigma)| {
            let color = if error.abs() > 3.0 * sigma { theme.error } else { theme.text_weak };
            (format!("Δ {}", error_text(shown, error, sigma)), color)
        });
        let line = Rect::from_x_y_ranges(rect.x_range(), Rangef::new(rect.top() + TITLE_HEIGHT, plot.top()));
        note(&painter, &theme, line, verdict, error);
    }

    let text = value_text(shown, value, error);
    let label = format!("{name} {text} {}", verdict.name());
    let widget = ui.unique_id().with(("parameter", name));
    let plot = Interaction { id: widget, name: label.trim_end(), value: "", clicks: Clicks::Select, wheel: data.wheel };
    let read_line = |run: usize| {
        let (_, stamps_ns, values) = data.values(run, id)?;
        Some(ReadLine { color: theme.run(run).color, stamps_ns, values })
    };
    let readout = Readout {
        key: &key,
        lines: &overlaid.iter().filter_map(|run| read_line(*run)).collect::<Vec<_>>(),
        factor: shown.factor,
        unit: shown.unit,
        whole: false,
    };
    let response = plot_ui(ui, ctx, &area, &plot, &readout);
    if response.hovered() {
        offer(ui, format!("{name} {text}"));
        offer_item(ui, Item::Parameter(id));
    }
    if response.clicked() {
        ctx.selection.parameter = if selected { None } else { Some(id) };
    }
    let meaning = meaning_of(id, &ctx.recording.rig);
    response.on_hover_ui_at_pointer(|ui| {
        let column = format!("calibration.csv: {name}_{}", id.dimension().unit());
        let mut lines = vec![format!("{name}: {meaning}"), text, window::CONVERGENCE.meaning.to_owned(), column];
        lines.extend(data.others_lines(ctx, &overlaid, id, shown, &area));
        ui.label(lines.join("\n"));
    });
}

/// The plot with the range that was set by hand, else the automatic one with its broken scale.
fn with_range(
    ctx: &PanelContext<'_>,
    key: &str,
    area: PlotArea,
    (automatic, middle): ((f64, f64), Option<[f64; 2]>),
) -> PlotArea {
    let (low, high) = value_range_of(ctx, key, automatic.0, automatic.1);
    let area = area.with_values(low, high);
    match middle.filter(|_| (low, high) == automatic) {
        Some(middle) => area.broken(middle),
        None => area,
    }
}

/// Curves of all runs: the shown run last, on top; marks for those outside the plot.
fn paint_runs<'c>(
    painter: &Painter,
    theme: &Theme,
    area: &PlotArea,
    overlaid: &[usize],
    shown_run: usize,
    curve_of: impl Fn(usize) -> Option<&'c ParameterCurves>,
) {
    let others = || overlaid.iter().filter(|run| **run != shown_run);
    for run in others().chain([&shown_run]) {
        if let Some(curves) = curve_of(*run) {
            paint_curve(painter, area, &curves.value, theme.run(*run), CURVE_WIDTH);
        }
    }
    for (level, run) in others().enumerate() {
        if let Some(curves) = curve_of(*run) {
            paint_outside(painter, area, &curves.value, theme.run(*run), level);
        }
    }
}

/// Draws verdict and error against the ground truth in the line above a plot, in as many words as fit.
fn note(painter: &Painter, theme: &Theme, line: Rect, verdict: Determination, error: Option<(String, Color32)>) {
    let width = |text: &str| painter.layout_no_wrap(text.to_owned(), theme::label_font(), theme.text).size().x;
    let mut room = line.width();
    if let Some((text, color)) = error.filter(|(text, _)| width(text) <= line.width()) {
        painter.text(line.right_top(), Align2::RIGHT_TOP, &text, theme::label_font(), color);
        room -= width(&text) + 8.0;
    }
    if MARKED.contains(&verdict) {
        let (mark, color) = look_of(verdict, theme);
        if let Some(text) = [verdict.name(), mark].into_iter().find(|text| width(text) <= room) {
            painter.text(line.left_top(), Align2::LEFT_TOP, text, theme::label_font(), color);
        }
    }
}

/// Value ± 1 σ at the cursor and its error with the multiple of σ, empty without an estimate.
fn value_text(shown: Shown, value: Option<(f64, f64)>, error: Option<(f64, f64)>) -> String {
    let value = value.map(|(value, sigma)| format!("{} ± {}", shown.value(value, sigma), shown.sigma(sigma)));
    let error = error.map(|(error, sigma)| format!(", error {}", error_text(shown, error, sigma)));
    [value, error].into_iter().flatten().collect()
}

/// Signed error against the ground truth.
fn signed(shown: Shown, error: f64, sigma: f64) -> String {
    let value = shown.value(error, sigma);
    if value.starts_with('-') { value } else { format!("+{value}") }
}

/// Signed error against the ground truth, with its multiple of σ.
fn error_text(shown: Shown, error: f64, sigma: f64) -> String {
    let times = error.abs() / sigma;
    let text = signed(shown, error, sigma);
    if times.is_finite() { format!("{text} ({times:.1}σ)") } else { text }
}

/// True for a verdict in which the value is not worth much.
fn is_hatched(verdict: Determination) -> bool {
    !matches!(verdict, Determination::Given | Determination::WeaklyDetermined)
}

/// Hatches the ranges in which the flight has not determined the parameter; a strip at the bottom shows the verdict.
fn paint_verdicts(painter: &Painter, theme: &Theme, area: &PlotArea, curves: &ParameterCurves) {
    for (segments, verdict) in curves.verdicts.iter().zip(MARKED) {
        for segment in segments.on_screen(area) {
            let segment = Rect::from_x_y_ranges(segment, area.rect.y_range());
            if is_hatched(verdict) {
                paint_hatch(painter, segment, theme.hatch);
            }
            let strip = Rect::from_min_max(pos2(segment.left(), segment.bottom() - STRIP_HEIGHT), segment.max);
            painter.rect_filled(strip, 0.0, look_of(verdict, theme).1);
        }
    }
}

/// Draws the name on the left, with the mark of a verdict that has no line of its own, and value and σ on the right as far
/// as they fit.
#[expect(clippy::too_many_arguments, reason = "one line of text has that many inputs")]
fn title(
    painter: &Painter,
    ctx: &PanelContext<'_>,
    rect: Rect,
    name: &str,
    shown: Shown,
    value: Option<(f64, f64)>,
    (verdict, marks_verdict): (Determination, bool),
    selected: bool,
) {
    let theme = ctx.theme;
    let name_color = if selected { theme.accent } else { theme.text_strong };
    let mut end = painter.text(rect.left_top(), Align2::LEFT_TOP, name, theme::label_font(), name_color).right();
    if marks_verdict && MARKED.contains(&verdict) {
        let (mark, color) = look_of(verdict, theme);
        let place = pos2(end + 4.0, rect.top());
        end = painter.text(place, Align2::LEFT_TOP, mark, theme::label_font(), color).right();
    }
    let Some((value, sigma)) = value else { return };
    let color = if verdict.is_met() { theme.text_strong } else { theme.text_weak };
    let font = theme::number_font();
    let with_sigma = format!("{} ±{}", fixed_value(shown, value, sigma), shown.sigma(sigma));
    let texts = [with_sigma, shown.value(value, sigma)];
    for text in texts.into_iter().skip(usize::from(!sigma.is_finite())) {
        let galley = painter.layout_no_wrap(text, font.clone(), color);
        if galley.size().x + 6.0 < rect.right() - end {
            painter.galley(rect.right_top() - vec2(galley.size().x, 0.0), galley, color);
            return;
        }
    }
}

/// The value without its unit, which follows after the σ.
fn fixed_value(shown: Shown, value: f64, sigma: f64) -> String {
    let text = shown.value(value, sigma);
    text.strip_suffix(shown.unit).map_or_else(|| fixed(value, 2), str::to_owned)
}

/// The cached curves of one parameter of one run.
#[derive(Debug, Default)]
pub(super) struct ParameterCurves {
    pub(super) value: Curve,
    pub(super) band: BandCurve,
    /// Ranges of the marked verdicts.
    pub(super) verdicts: [StateCurve; MARKED.len()],
}
