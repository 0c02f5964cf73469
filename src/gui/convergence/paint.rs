//! One small plot: a parameter's value with its ±3σ band, the truth, and where nothing informs it.

use std::collections::BTreeMap;

use egui::{Align2, Color32, FontFamily, FontId, Pos2, Rect, Stroke, StrokeKind, Ui, pos2, vec2};

use super::ParameterCurves;
use super::model::{CalibrationHistory, Knowledge, ParameterHistory};
use super::names::{ChainPart, heading_of, meaning_of};
use crate::gui::PanelContext;
use crate::gui::plot::{
    Clicks, PlotArea, navigate, paint_band, paint_cursor, paint_curve, paint_ground, paint_hatch, paint_value_grid,
    stretches_where, visible_range,
};
use crate::gui::theme::{self, CURVE_WIDTH};
use crate::gui::units::{Shown, fixed};

/// Height of the line with name and value.
const TITLE_HEIGHT: f32 = 15.0;

/// The name of a part of the chain beside its row.
pub(super) fn heading(ui: &Ui, ctx: &PanelContext<'_>, part: ChainPart, rect: Rect) {
    let painter = ui.painter();
    let theme = ctx.theme;
    painter.vline(rect.right(), rect.y_range(), Stroke::new(1.0, theme.outline));
    let place = pos2(rect.left(), rect.top() + 1.0);
    painter.text(place, Align2::LEFT_TOP, heading_of(part, &ctx.recording.rig), theme::label_font(), theme.text_weak);
}

/// Draws the plot of one parameter and lets the pointer select it.
pub(super) fn cell_ui(
    ui: &Ui,
    ctx: &mut PanelContext<'_>,
    histories: &[CalibrationHistory],
    curves: &mut BTreeMap<(usize, String), ParameterCurves>,
    shown_run: usize,
    name: &str,
    rect: Rect,
) {
    let Some(history) = histories.get(shown_run) else { return };
    let Some(parameter) = history.parameter(name) else { return };
    let shown = Shown::of(parameter.unit);
    let theme = *ctx.theme;
    let (begin_ns, end_ns) = visible_range(ctx);
    let plot = Rect::from_min_max(pos2(rect.left(), rect.top() + TITLE_HEIGHT), rect.max);
    let mut area = PlotArea { rect: plot, begin_ns, end_ns, low: 0.0, high: 1.0 };

    // Runs whose chart has the same parameter are laid over each other.
    let same_chart = |run: usize| {
        let chart = |run: usize| {
            let steps = &ctx.recording.runs.get(run)?.steps;
            steps.last().map(|step| step.report.calibration.parameterization.as_str())
        };
        run == shown_run || chart(run) == chart(shown_run)
    };
    let overlaid: Vec<usize> =
        (0..histories.len()).filter(|run| same_chart(*run) && histories[*run].parameter(name).is_some()).collect();
    for run in &overlaid {
        let Some(parameter) = histories[*run].parameter(name) else { continue };
        let (epoch, stamps_ns) = (histories[*run].epoch, &histories[*run].stamps_ns);
        let curves = curves.entry((*run, name.to_owned())).or_default();
        curves.value.update(&area, epoch, stamps_ns, &parameter.values);
        if *run == shown_run {
            curves.lower.update(&area, epoch, stamps_ns, &parameter.lower);
            curves.upper.update(&area, epoch, stamps_ns, &parameter.upper);
        }
    }
    let curve_of = |run: usize| curves.get(&(run, name.to_owned()));
    let extents = overlaid.iter().filter_map(|run| curve_of(*run)?.value.extent);
    let (low, high) = value_range(extents, parameter);
    area = area.with_values(low, high);

    let painter = ui.painter_at(rect.expand(1.0));
    let inner = painter.with_clip_rect(plot);
    paint_ground(&painter, &theme, plot);
    paint_knowledge(&inner, &theme, &area, history, parameter);
    paint_value_grid(&inner, &theme, &area, shown.factor, (plot.height() / 22.0) as usize + 1);
    if let Some(curves) = curve_of(shown_run) {
        let fill = theme.run(shown_run).color.gamma_multiply(0.22);
        paint_band(&inner, &area, &curves.lower, &curves.upper, fill);
    }
    // The shown run comes last, on top.
    for run in overlaid.iter().filter(|run| **run != shown_run).chain([&shown_run]) {
        if let Some(curves) = curve_of(*run) {
            paint_curve(&inner, &area, &curves.value, theme.run(*run), CURVE_WIDTH);
        }
    }
    paint_cursor(&inner, &theme, &area, ctx.cursor_ns);

    let selected = ctx.selection.parameter.as_deref() == Some(name);
    let border = if selected { Stroke::new(2.0, theme.accent) } else { Stroke::new(1.0, theme.outline) };
    painter.rect_stroke(plot, 0.0, border, StrokeKind::Inside);

    let row = history.row_at(ctx.cursor_ns);
    let state = row.map_or(Knowledge::Waiting, |row| parameter.knowledge[row]);
    let value = row.map(|row| (parameter.values[row], parameter.sigmas[row]));
    title(&painter, ctx, rect, name, shown, value, state, selected);
    if !state.tag().is_empty() {
        let place = plot.right_top() + vec2(-3.0, 1.0);
        boxed_text(&inner, &theme, place, Align2::RIGHT_TOP, state.tag(), state_color(&theme, state));
    }

    let text = value
        .map_or_else(String::new, |(value, sigma)| format!("{} ± {}", shown.value(value, sigma), shown.sigma(sigma)));
    let label = format!("{name} {text} {}", state.tag());
    let id = ui.unique_id().with(("parameter", name));
    let response = navigate(ui, ctx, &area, id, label.trim_end(), Clicks::Select, false);
    if response.clicked() {
        ctx.selection.parameter = if selected { None } else { Some(name.to_owned()) };
    }
    let meaning = meaning_of(name, &ctx.recording.rig);
    response.on_hover_text_at_pointer(format!("{name}: {meaning}\n{text}"));
}

/// The values to show: all curves, and three standard deviations around the last one, which keeps the wide bands of the
/// beginning from flattening everything.
fn value_range(extents: impl Iterator<Item = (f64, f64)>, parameter: &ParameterHistory) -> (f64, f64) {
    let (mut low, mut high) =
        extents.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (least, most)| (low.min(least), high.max(most)));
    let last = parameter
        .values
        .iter()
        .zip(&parameter.sigmas)
        .rev()
        .find(|(value, sigma)| value.is_finite() && sigma.is_finite());
    if let Some((value, sigma)) = last {
        low = low.min(value - 4.5 * sigma);
        high = high.max(value + 4.5 * sigma);
    }
    let margin = 0.06 * (high - low);
    (low - margin, high + margin)
}

/// Grey where the window informs the parameter too weakly, hatched where it cannot see it at all.
fn paint_knowledge(
    painter: &egui::Painter,
    theme: &theme::Theme,
    area: &PlotArea,
    history: &CalibrationHistory,
    parameter: &ParameterHistory,
) {
    for state in [Knowledge::Weak, Knowledge::Unobservable, Knowledge::Waiting] {
        for (begin_ns, end_ns) in stretches_where(&history.stamps_ns, |row| parameter.knowledge[row] == state) {
            let stretch = Rect::from_x_y_ranges(area.x(begin_ns)..=area.x(end_ns), area.rect.y_range());
            let stretch = stretch.intersect(area.rect);
            if stretch.width() <= 0.0 {
                continue;
            }
            painter.rect_filled(stretch, 0.0, theme.hatch.gamma_multiply(0.35));
            if state == Knowledge::Unobservable {
                paint_hatch(painter, stretch, theme.hatch);
            }
        }
    }
}

fn state_color(theme: &theme::Theme, state: Knowledge) -> Color32 {
    match state {
        Knowledge::Informed => theme.ok,
        Knowledge::Weak => theme.warn,
        Knowledge::Unobservable => theme.error,
        Knowledge::Waiting => theme.text_weak,
    }
}

/// Name on the left, value and σ on the right as far as they fit.
#[expect(clippy::too_many_arguments, reason = "one line of text has that many inputs")]
fn title(
    painter: &egui::Painter,
    ctx: &PanelContext<'_>,
    rect: Rect,
    name: &str,
    shown: Shown,
    value: Option<(f64, f64)>,
    state: Knowledge,
    selected: bool,
) {
    let theme = ctx.theme;
    let name_color = if selected { theme.accent } else { theme.text_strong };
    let end = painter.text(rect.left_top(), Align2::LEFT_TOP, name, theme::label_font(), name_color).right();
    let Some((value, sigma)) = value else { return };
    let color = if state == Knowledge::Informed { theme.text_strong } else { theme.text_weak };
    let font = FontId::new(10.5, FontFamily::Monospace);
    let with_sigma = format!("{} ±{}", fixed_value(shown, value, sigma), shown.sigma(sigma));
    for text in [with_sigma, shown.value(value, sigma)] {
        let galley = painter.layout_no_wrap(text, font.clone(), color);
        if galley.size().x + 6.0 < rect.right() - end {
            painter.galley(rect.right_top() - vec2(galley.size().x, 0.0), galley, color);
            return;
        }
    }
}

/// The value without its unit, which follows the σ.
fn fixed_value(shown: Shown, value: f64, sigma: f64) -> String {
    let text = shown.value(value, sigma);
    text.strip_suffix(shown.unit).map_or_else(|| fixed(value, 2), str::to_owned)
}

/// Text on a ground of its own, so that it can be read over curves.
fn boxed_text(painter: &egui::Painter, theme: &theme::Theme, place: Pos2, align: Align2, text: &str, color: Color32) {
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::new(9.5, FontFamily::Proportional), color);
    let rect = align.anchor_size(place, galley.size());
    painter.rect_filled(rect.expand2(vec2(2.0, 0.0)), 2.0, theme.plot_background.gamma_multiply(0.85));
    painter.galley(rect.min, galley, color);
}
