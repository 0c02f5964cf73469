//! Residuals panel: fit of the window as a histogram, over time, and by kind of factor.

mod csv;
mod histogram;
mod image_plane;

use std::sync::Arc;

use egui::text::{LayoutJob, TextFormat};
use egui::{
    Align2, Grid, Label, Rect, RichText, Role, ScrollArea, Sense, Stroke, TextStyle, TextWrapMode, Ui, UiBuilder, Vec2,
    WidgetInfo, pos2, vec2,
};

use self::image_plane::ImagePlane;
use super::derived::follow::RunTables;
use super::help::terms::{Term, factors, window};
use super::plot::{
    Clicks, Curve, Interaction, PlotArea, Readout, TIME_GUTTER, Wheel, decimals_of_step, overflows, paint_curve,
    paint_ground, paint_time_axis, paint_value_axis, plot_ui, read_lines, run_legend_ui, ticks, value_range_of,
    visible_range, within_gutters,
};
use super::theme::{CURVE_WIDTH, ROW_HEIGHT, Theme, label_font, number_font};
use super::units::{fixed, significant};
use super::widgets::{describe, empty_ui};
use super::{Panel, PanelContext};
use crate::estimator::{FactorKind, ResidualSummary, StepReport};
use crate::gui::residuals::histogram::ResidualHistogram;
use crate::session::StepRecord;

/// Panel size in points from which both views are shown.
const MIN_SIZE_FOR_BOTH: Vec2 = vec2(1000.0, 360.0);

/// Width in points from which a low panel has histogram, RMS over time and factors side by side.
const MIN_WIDTH_FOR_THREE: f32 = 780.0;
/// Height in points from which the RMS over time is below the histogram, without scrolling.
const MIN_HEIGHT_FOR_BOTH_PLOTS: f32 = 240.0;
/// Width in points of the table of factors, and gap between the columns.
const FACTORS_WIDTH: f32 = 356.0;
const COLUMN_GAP: f32 = 10.0;
/// Minimum heights of the plots in points.
const MIN_HISTOGRAM_HEIGHT: f32 = 58.0;
const MIN_OVER_TIME_HEIGHT: f32 = 74.0;
/// Height of the legend above the bars of the histogram, in points.
const LEGEND_HEIGHT: f32 = 18.0;

/// View that a panel shows if it is too small for both views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum ResidualView {
    /// Histogram, RMS over time, χ² by factor.
    #[default]
    Distribution,
    /// Means over the image.
    ImagePlane,
}

/// State of the residuals panel: RMS of all runs over time, the histogram of the step, and means over the image.
#[derive(Debug, Default)]
pub struct ResidualsPanel {
    tables: RunTables,
    curves: Vec<Curve>,
    counted: Option<(Arc<StepRecord>, ResidualHistogram)>,
    view: ResidualView,
    image_plane: ImagePlane,
    /// True if the content is higher than the panel, so that the wheel scrolls.
    overflows: bool,
}

impl Panel for ResidualsPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let Some((run, step)) = ctx.selected_step() else {
            empty_ui(ui, "No step at the cursor");
            return;
        };
        if !self.counted.as_ref().is_some_and(|(counted, _)| Arc::ptr_eq(counted, step)) {
            self.counted = Some((Arc::clone(step), ResidualHistogram::of(&step.report)));
        }
        let room = ui.available_size();
        if room.x >= MIN_SIZE_FOR_BOTH.x && room.y >= MIN_SIZE_FOR_BOTH.y {
            ui.columns(2, |columns| {
                self.distribution_ui(&mut columns[0], ctx, step);
                self.image_plane.ui(&mut columns[1], ctx, run, step, room.y - 4.0);
            });
            return;
        }
        if !ctx.presentation.is_figure() {
            ui.horizontal(|ui| {
                ui.selectable_value(&mut self.view, ResidualView::Distribution, "Distribution")
                    .on_hover_text("Histogram, over time, and χ² by factor");
                ui.selectable_value(&mut self.view, ResidualView::ImagePlane, "Image plane")
                    .on_hover_text(window::IMAGE_PLANE.meaning);
            });
        }
        match self.view {
            ResidualView::Distribution => self.distribution_ui(ui, ctx, step),
            ResidualView::ImagePlane => {
                let height = ui.available_height() - 4.0;
                self.image_plane.ui(ui, ctx, run, step, height);
            }
        }
    }

    fn view_copy(&self) -> Self {
        Self { view: self.view, ..Self::default() }
    }
}

impl ResidualsPanel {
    fn distribution_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, step: &Arc<StepRecord>) {
        let (height, width) = (ui.available_height(), ui.available_width());
        let low = width > MIN_WIDTH_FOR_THREE && height < MIN_HEIGHT_FOR_BOTH_PLOTS;
        let wide = width > 1.6 * height && width > 560.0;
        let shown = ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 3.0;
            let (report, room) = (&step.report, height - 4.0);
            if low {
                self.low_ui(ui, ctx, report, room);
            } else if wide {
                ui.columns(2, |columns| {
                    self.stacked_ui(&mut columns[0], ctx, report, room);
                    factors_ui(&mut columns[1], ctx.theme, &report.residuals);
                });
            } else {
                let table = 22.0 + 19.0 * report.residuals.len() as f32;
                self.stacked_ui(ui, ctx, report, height - table - 8.0);
                factors_ui(ui, ctx.theme, &report.residuals);
            }
        });
        self.overflows = overflows(&shown);
    }

    /// Draws histogram, RMS over time and the table of factors side by side.
    fn low_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, report: &StepReport, height: f32) {
        let all = ui.available_rect_before_wrap();
        let all = all.with_max_y(all.top() + height);
        let plot = 0.5 * (all.width() - FACTORS_WIDTH) - COLUMN_GAP;
        let mut column_ui = |left: f32, width: f32, draw: &mut dyn FnMut(&mut Ui)| {
            let place = Rect::from_min_size(all.min + vec2(left, 0.0), vec2(width, all.height()));
            ui.scope_builder(UiBuilder::new().max_rect(place), |ui| draw(ui));
        };
        column_ui(0.0, plot, &mut |ui| self.left_ui(ui, ctx, report, height));
        column_ui(plot + COLUMN_GAP, plot, &mut |ui| self.over_time_ui(ui, ctx, height));
        let left = 2.0 * (plot + COLUMN_GAP);
        column_ui(left, FACTORS_WIDTH, &mut |ui| factors_ui(ui, ctx.theme, &report.residuals));
        ui.advance_cursor_after_rect(all);
    }

    /// Draws the summary above the histogram, in a height in points.
    fn left_ui(&self, ui: &mut Ui, ctx: &PanelContext<'_>, report: &StepReport, height: f32) {
        let Some((_, histogram)) = &self.counted else { return };
        let top = ui.cursor().top();
        summary_ui(ui, ctx.theme, report, histogram);
        let below = height - (ui.cursor().top() - top);
        histogram_ui(ui, ctx.theme, histogram, below.max(MIN_HISTOGRAM_HEIGHT));
    }

    /// Draws summary, histogram and RMS over time one above the other.
    fn stacked_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, report: &StepReport, height: f32) {
        let over_time = (0.3 * height).max(MIN_OVER_TIME_HEIGHT);
        self.left_ui(ui, ctx, report, height - over_time - 6.0);
        self.over_time_ui(ui, ctx, over_time);
    }

    /// Plot of the reprojection RMS after the solve over time, for all runs.
    fn over_time_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, height: f32) {
        let theme = *ctx.theme;
        let top = ui.cursor().top();
        ui.horizontal(|ui| {
            ui.label(RichText::new("reprojection RMS after the solve, px").small().color(theme.text_weak));
            run_legend_ui(ui, ctx);
        });
        let height = height - (ui.cursor().top() - top);
        let (_, outer) = ui.allocate_space(vec2(ui.available_width(), height));
        let rect = within_gutters(outer, TIME_GUTTER);
        let (begin_ns, end_ns) = visible_range(ctx);
        let mut area = PlotArea { rect, begin_ns, end_ns, low: 0.0, high: 1.0, middle: None };
        let tables = self.tables.read(&ctx.recording.runs, |step| [rms_px(&step.report)]);
        self.curves.resize_with(tables.len(), Curve::default);
        for (table, curve) in tables.iter().zip(&mut self.curves) {
            curve.update(&area, table.epoch, &table.stamps_ns, &table.columns[0]);
        }
        let max_value =
            self.curves.iter().filter_map(|curve| curve.extent).map(|(_, max_value)| max_value).fold(0.0, f64::max);
        let key = "Reprojection RMS over time";
        let (low, high) = value_range_of(ctx, key, 0.0, if max_value > 0.0 { 1.1 * max_value } else { 1.0 });
        area = area.with_values(low, high);
        let painter = ui.painter_at(outer);
        paint_ground(&painter, &theme, rect);
        paint_value_axis(&painter, &theme, &area, 1.0);
        paint_time_axis(&painter, &theme, &area, TIME_GUTTER);
        let inner = painter.with_clip_rect(rect.intersect(painter.clip_rect()));
        for (run, curve) in self.curves.iter().enumerate() {
            paint_curve(&inner, &area, curve, theme.run(run), CURVE_WIDTH);
        }
        let id = ui.unique_id().with("rms over time");
        let value = ctx.selected_run().and_then(|run| run.step_at(ctx.cursor_ns));
        let value = value.map_or_else(String::new, |step| format!("{} px", fixed(rms_px(&step.report), 2)));
        let wheel = Wheel::in_list(self.overflows);
        let plot = Interaction { id, name: key, value: &value, clicks: Clicks::Seek, wheel };
        let lines = read_lines(&theme, tables.iter().map(|table| (&*table.stamps_ns, &*table.columns[0])));
        let readout = Readout { key, lines: &lines, factor: 1.0, unit: " px", whole: false };
        plot_ui(ui, ctx, &area, &plot, &readout)
            .on_hover_text("Reprojection RMS after the solve, px (reprojection_rms_after_px in frames.csv)");
    }
}

/// Reprojection RMS of the step after the solve in pixels; NaN without a solve.
pub(crate) fn rms_px(report: &StepReport) -> f64 {
    if report.window.is_empty() { f64::NAN } else { report.reprojection_rms_after_px }
}

/// Height of a line of the summary in points.
const SUMMARY_LINE: f32 = 14.0;

fn summary_ui(ui: &mut Ui, theme: &Theme, report: &StepReport, histogram: &ResidualHistogram) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = vec2(12.0, 2.0);
        ui.spacing_mut().interact_size.y = SUMMARY_LINE;
        let mut pair = |name: &str, value: String, hover: &str| {
            // Name and value stay on one line.
            let mut job = LayoutJob::default();
            let (body, monospace) = (TextStyle::Body.resolve(ui.style()), TextStyle::Monospace.resolve(ui.style()));
            job.append(&format!("{name} "), 0.0, TextFormat::simple(body, theme.text_weak));
            job.append(&value, 0.0, TextFormat::simple(monospace, theme.text_strong));
            ui.add(Label::new(job).wrap_mode(TextWrapMode::Extend)).on_hover_text(hover);
        };
        let before = fixed(report.reprojection_rms_before_px, 2);
        pair(
            "RMS",
            format!("{before} → {} px", fixed(report.reprojection_rms_after_px, 2)),
            "Reprojection RMS before and after the solve",
        );
        pair(
            "median",
            format!("{} px", fixed(histogram.median_px, 2)),
            "Median norm of the reprojection residuals after the solve",
        );
        pair("95 %", format!("{} px", fixed(histogram.p95_px, 2)), "95th percentile of the norm after the solve");
        pair(
            "mean u, v",
            format!("{}, {} px", fixed(histogram.mean_px[0], 2), fixed(histogram.mean_px[1], 2)),
            "Mean residual (bias) along the image axes u and v, prediction − measurement",
        );
        let hover = "Observations in the window with a residual after the solve";
        pair("observations", histogram.observations.to_string(), hover);
        let scales = report.loss_scales_px.iter().map(|scale_px| fixed(*scale_px, 2)).collect::<Vec<_>>().join(", ");
        let hover = "Scale of the robust loss for each camera: an observation with this residual has half weight. It \
                     follows the median of the residuals, and the assumed noise of an observation follows it, too, \
                     within 0.125 and 0.25 px";
        pair("loss scale", format!("{scales} px"), hover);
        let hover = "Observations with a robust weight below 0.5";
        pair("downweighted", histogram.downweighted.to_string(), hover);
        pair("rejected", histogram.rejected.to_string(), "Features rejected as outliers");
    });
}

fn histogram_ui(ui: &mut Ui, theme: &Theme, histogram: &ResidualHistogram, height: f32) {
    let (_, rect) = ui.allocate_space(vec2(ui.available_width(), height));
    let painter = ui.painter_at(rect);
    paint_ground(&painter, theme, rect);
    // The legend is above the bars.
    let plot = Rect::from_min_max(rect.min + vec2(2.0, LEGEND_HEIGHT), rect.max - vec2(2.0, 15.0));
    let reach = histogram.reach_px;
    let x = |value: f64| plot.center().x + (value / reach) as f32 * plot.width() / 2.0;
    let font = number_font();
    let (marks, step) = ticks(-reach, reach, (plot.width() / 60.0) as usize);
    for mark in marks {
        painter.vline(x(mark), plot.y_range(), Stroke::new(1.0, theme.grid));
        let text = fixed(mark, decimals_of_step(step));
        let align = if x(mark) < plot.left() + 16.0 {
            Align2::LEFT_TOP
        } else if x(mark) > plot.right() - 16.0 {
            Align2::RIGHT_TOP
        } else {
            Align2::CENTER_TOP
        };
        painter.text(pos2(x(mark), plot.bottom() + 1.0), align, text, font.clone(), theme.text_weak);
    }
    let max_value = histogram.after.iter().chain(&histogram.before).copied().max().unwrap_or(0).max(1) as f32;
    let pitch = plot.width() / histogram.after.len().max(1) as f32;
    let y = |count: usize| plot.bottom() - count as f32 / max_value * plot.height();
    for (bin, count) in histogram.after.iter().enumerate() {
        let left = plot.left() + bin as f32 * pitch;
        let bar = Rect::from_min_max(pos2(left + 0.5, y(*count)), pos2(left + pitch - 0.5, plot.bottom()));
        painter.rect_filled(bar, 0.0, theme.accent.gamma_multiply(0.75));
    }
    let outline: Vec<_> = histogram
        .before
        .iter()
        .enumerate()
        .flat_map(|(bin, count)| {
            let left = plot.left() + bin as f32 * pitch;
            [pos2(left, y(*count)), pos2(left + pitch, y(*count))]
        })
        .collect();
    painter.add(egui::Shape::line(outline, Stroke::new(1.0, theme.warn)));
    painter.vline(x(0.0), plot.y_range(), Stroke::new(1.0, theme.text_weak));

    let key = rect.left_top() + vec2(5.0, 2.0);
    let end = painter.text(key, Align2::LEFT_TOP, "■ after", label_font(), theme.accent);
    let next = pos2(end.right() + 8.0, key.y);
    let end = painter.text(next, Align2::LEFT_TOP, "— before the solve", label_font(), theme.warn);
    let unit = "prediction − measurement, px";
    let outside = histogram.outside;
    let texts = if outside > 0 {
        [format!("{outside} outside · {unit}"), format!("{outside} outside")]
    } else {
        [unit.to_owned(), "px".to_owned()]
    };
    // A text that would overlap the legend is replaced by a shorter one.
    let galleys = texts.map(|text| painter.layout_no_wrap(text, label_font(), theme.text_weak));
    let right = rect.right_top() + vec2(-5.0, 2.0);
    if let Some(galley) = galleys.into_iter().find(|galley| end.right() + 10.0 + galley.size().x < right.x) {
        painter.galley(right - vec2(galley.size().x, 0.0), galley, theme.text_weak);
    }
    let response = ui.interact(rect, ui.unique_id().with("histogram"), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Histogram of reprojection residuals"));
    let (median, p95) = (fixed(histogram.median_px, 2), fixed(histogram.p95_px, 2));
    describe(&response, &format!("median {median} px, 95 % below {p95} px, {} observations", histogram.observations));
    response.on_hover_text("Components u and v of the reprojection residuals in the window, px");
}

/// Table of χ² by kind of factor: before, after, and per residual, which is expected to be about 1.
fn factors_ui(ui: &mut Ui, theme: &Theme, residuals: &[ResidualSummary]) {
    if residuals.is_empty() {
        ui.label(RichText::new("No solve in this step").color(theme.text_weak));
        return;
    }
    let grid = Grid::new("chi2 by factor").num_columns(5).min_row_height(ROW_HEIGHT).spacing(vec2(10.0, 2.0));
    grid.striped(true).show(ui, |ui| {
        ui.spacing_mut().interact_size.y = ROW_HEIGHT;
        for term in [factors::FACTOR, factors::COUNT, factors::CHI2_BEFORE, factors::CHI2_AFTER, factors::RATIO] {
            ui.label(RichText::new(term.name).small().color(theme.text_weak)).on_hover_text(term.meaning);
        }
        ui.end_row();
        for summary in residuals {
            let name = ui.label(RichText::new(summary.factor.label()).color(theme.text));
            name.on_hover_text(term_of(summary.factor).meaning);
            let number = |ui: &mut Ui, text: String, term: Term| {
                ui.label(RichText::new(text).monospace().color(theme.text_strong)).on_hover_text(term.meaning);
            };
            number(ui, summary.count.to_string(), factors::COUNT);
            number(ui, significant(summary.chi2_before), factors::CHI2_BEFORE);
            number(ui, significant(summary.chi2_after), factors::CHI2_AFTER);
            ratio_ui(ui, theme, summary.mean_square().unwrap_or(f64::NAN));
            ui.end_row();
        }
    });
}

const fn term_of(factor: FactorKind) -> Term {
    match factor {
        FactorKind::Visual => factors::VISUAL,
        FactorKind::Imu => factors::IMU,
        FactorKind::Encoder => factors::ENCODER,
        FactorKind::CalibrationPrior => factors::CALIBRATION_PRIOR,
        FactorKind::MarginalizationPrior => factors::MARGINALIZATION_PRIOR,
        FactorKind::ZeroVelocity => factors::ZERO_VELOCITY,
        FactorKind::GimbalImu => factors::GIMBAL_IMU,
    }
}

/// Draws χ² per residual with a bar around 1.
fn ratio_ui(ui: &mut Ui, theme: &Theme, ratio: f64) {
    let (color, meaning) = if !ratio.is_finite() {
        (theme.text_weak, "")
    } else if ratio > 2.0 {
        (theme.error, "χ² per residual above 2: residuals larger than the noise model")
    } else if ratio < 0.3 {
        (theme.warn, "χ² per residual below 0.3: residuals smaller than the noise model")
    } else {
        (theme.ok, "χ² per residual, expected value 1: consistent with the noise model")
    };
    let response = ui
        .horizontal(|ui| {
            ui.label(RichText::new(fixed(ratio, 2)).monospace().color(color));
            let (_, rect) = ui.allocate_space(vec2(48.0, 10.0));
            let painter = ui.painter();
            painter.rect_filled(rect, 1.0, theme.surface_raised);
            if ratio.is_finite() {
                let ratio_of_width = (ratio / 3.0).clamp(0.0, 1.0) as f32;
                let bar = Rect::from_min_size(rect.min, vec2(rect.width() * ratio_of_width, rect.height()));
                painter.rect_filled(bar, 1.0, color);
            }
            painter.vline(rect.left() + rect.width() / 3.0, rect.y_range().expand(1.0), Stroke::new(1.0, theme.text));
        })
        .response;
    if !meaning.is_empty() {
        response.on_hover_text(meaning);
    }
}
