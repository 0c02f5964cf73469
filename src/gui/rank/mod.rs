//! Rank panel: observability of the calibration as a verdict, as a spectrum and by parameter name.

mod advice;
pub(super) mod columns;
mod compare;
mod flight;
mod heat_map;
mod information;
mod sections;
mod slider;
mod spectrum;
pub(crate) mod verdict;

pub(super) use self::compare::ui as all_runs_ui;

use std::sync::Arc;

use egui::{RichText, ScrollArea, Ui, UiBuilder, vec2};

use self::advice::AdviceUi;
use self::information::InformationUi;
use self::sections::{MIN_HEIGHT_WITH_CAUSE, fact_at_ui, headline_ui, section_ui};
use self::slider::SliderUi;
use self::spectrum::ranks_text;
use self::verdict::{Level, RankVerdict};
use super::derived::follow::RunTables;
use super::help::terms::window;
use super::plot::{
    Clicks, Curve, Interaction, PlotArea, Readout, TIME_GUTTER, Wheel, overflows, paint_ground, paint_steps,
    paint_time_axis, paint_value_axis, plot_ui, read_lines, run_legend_ui, value_range_of, visible_range,
    within_gutters,
};
use super::theme::{CURVE_WIDTH, RunStyle, Theme};
use super::widgets::empty_ui;
use super::{CsvTable, Panel, PanelContext, Presentation};
use crate::gimbal::ParameterNames;
use crate::observability::{CalibrationDirection, RankReport};
use crate::session::{LostSince, RunRecord, StepRecord};
use crate::table::{Column, csv};

/// Columns of the tables over time.
const STRUCTURAL: usize = 0;
const INFORMED: usize = 1;
const PARAMETERS: usize = 2;

/// Width in points of the lines about one run.
const RUN_WIDTH: f32 = 480.0;

/// Width in points from which the details are to the right of the heat map instead of below it.
const MIN_WIDTH_WITH_DETAILS_BESIDE: f32 = 760.0;

/// Height in points reserved for the details below the heat map before its rows grow.
const DETAILS_HEIGHT: f32 = 210.0;

/// The same in a figure, which cannot be scrolled: singular values and ranks over time with their headings, in points.
const FIGURE_DETAILS_HEIGHT: f32 = 320.0;

/// Height of the ranks over time in points.
const OVER_TIME_HEIGHT: f32 = 78.0;

/// Height in points below the heat map in which its slider and the first heading stay visible.
const HEAD_OF_DETAILS: f32 = 26.0;

#[derive(Debug, Default)]
pub struct RankPanel {
    tables: RunTables,
    /// Informed and structural rank by run.
    curves: Vec<[Curve; 2]>,
    /// True if advice is computed on another thread, as in the window; screenshots wait for it.
    pub in_background: bool,
    advice: AdviceUi,
    information: InformationUi,
    slider: SliderUi,
    /// Show all runs side by side, in a panel too small for both views.
    all_runs: bool,
    /// True if the content is higher than the panel, so that the wheel scrolls.
    overflows: bool,
}

impl CsvTable for RankPanel {
    /// Singular values of the step at the cursor, one per row, and each null or uninformed direction as weights by
    /// parameter name.
    fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        /// Row of an index in descending order.
        type ValueColumn<'a> = Column<'a, usize>;
        let Some(run) = ctx.selected_run() else { return String::new() };
        let Some(rank) = run.step_at(ctx.cursor_ns).and_then(|step| step.rank.as_ref()) else { return String::new() };
        let count = rank.singular_values.len();
        // Directions start with the least observable one, singular values with the largest.
        let direction = |index: usize| rank.directions.get(count - 1 - index);
        let mut columns = vec![
            ValueColumn::new("number", |index| index + 1),
            ValueColumn::new("singular_value", |index| rank.singular_values[*index]),
            ValueColumn::new("singular_value_with_priors", |index| {
                rank.singular_values_with_priors.get(*index).copied()
            }),
            ValueColumn::new("kind", |index| direction(*index).map_or("informed", CalibrationDirection::kind)),
        ];
        let names = ctx.names();
        columns.extend(ValueColumn::each(
            rank.parameters.iter().enumerate(),
            |(_, parameter)| names.name(**parameter),
            |index, (column, _)| direction(*index)?.weights.get(*column).copied(),
        ));
        csv(&columns, 0..count)
    }
}

impl Panel for RankPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let Some(run) = ctx.selected_run() else {
            empty_ui(ui, "No runs");
            return;
        };
        let Some(step) = run.step_at(ctx.cursor_ns) else {
            empty_ui(ui, "No step at the cursor");
            return;
        };
        let height = ui.available_height();
        let count = compare::comparable(ctx);
        let width = ui.available_width();
        if count > 1 && width >= RUN_WIDTH + compare::WIDTH_OF_A_RUN * count as f32 {
            let fraction = (RUN_WIDTH / width).max(1.0 / (count + 1) as f32);
            let [own, all] = halves(ui.available_rect_before_wrap(), fraction);
            ui.scope_builder(UiBuilder::new().max_rect(own), |ui| self.run_ui(ui, ctx, run, step, height));
            ui.scope_builder(UiBuilder::new().max_rect(all), |ui| compare::ui(ui, ctx));
            return;
        }
        if count > 1 && ctx.presentation.is_figure() {
            let number = ctx.run_number();
            ui.horizontal(|ui| {
                ui.label(RichText::new(format!("Run {}", run.spec.label)).strong().color(ctx.theme.run(number).color));
                ui.add_space(16.0);
                run_legend_ui(ui, ctx);
            });
        } else if count > 1 {
            ui.horizontal(|ui| {
                ui.selectable_value(&mut self.all_runs, false, "This run");
                ui.selectable_value(&mut self.all_runs, true, "All runs").on_hover_text("Side by side");
            });
            if self.all_runs {
                compare::ui(ui, ctx);
                return;
            }
        }
        self.run_ui(ui, ctx, run, step, ui.available_height());
    }
}

impl RankPanel {
    /// Suggested excitation for a step of a run; `None` until the panel has computed it.
    pub(in crate::gui) fn suggested_excitation(&self, run: u64, step: &StepRecord) -> Option<String> {
        self.advice.sentence(run, step)
    }

    /// Draws one run: summary and heat map visible without scrolling, details below or to the right.
    fn run_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        height: f32,
    ) {
        let all = ui.available_rect_before_wrap();
        if all.width() < MIN_WIDTH_WITH_DETAILS_BESIDE {
            let shown = ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                let bottom = ui.cursor().top() + height;
                let figure = ctx.presentation.is_figure();
                let details = if figure { [FIGURE_DETAILS_HEIGHT; 2] } else { [DETAILS_HEIGHT, HEAD_OF_DETAILS] };
                if self.answers_ui(ui, ctx, run, step, bottom, details) {
                    self.details_ui(ui, ctx, run, step);
                }
            });
            self.overflows = overflows(&shown);
            return;
        }
        let [left, right] = halves(all, 0.5);
        let mut ranked = false;
        ui.scope_builder(UiBuilder::new().max_rect(left), |ui| {
            ScrollArea::vertical().id_salt("answers").auto_shrink(false).show(ui, |ui| {
                let bottom = ui.cursor().top() + height;
                ranked = self.answers_ui(ui, ctx, run, step, bottom, [0.0; 2]);
            });
        });
        ui.scope_builder(UiBuilder::new().max_rect(right), |ui| {
            let shown = ScrollArea::vertical().id_salt("details").auto_shrink(false).show(ui, |ui| {
                if ranked {
                    self.details_ui(ui, ctx, run, step);
                }
            });
            self.overflows = overflows(&shown);
        });
    }

    /// Draws the verdict of the whole flight, then that at the cursor: least observable direction with its start and its
    /// reason, suggested excitation and heat map. Returns true if the step has a rank.
    ///
    /// The heat map leaves the first of the `details` heights above `bottom` free if all its rows fit, else the second.
    fn answers_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        bottom: f32,
        details: [f32; 2],
    ) -> bool {
        self.advice.update(ui, ctx, run, step, self.in_background);
        let height = bottom - ui.cursor().top();
        ui.spacing_mut().item_spacing.y = if height < MIN_HEIGHT_WITH_CAUSE { 1.0 } else { 3.0 };
        let with_sentences = ctx.presentation != Presentation::FigureOfReport;
        if with_sentences {
            flight::ui(ui, ctx, run, height);
            let verdict = verdict::verdict(step, &ctx.names());
            let since = self.advice.since(step);
            verdict_ui(ui, ctx, &verdict, since, height >= MIN_HEIGHT_WITH_CAUSE);
        }
        let Some(rank) = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty()) else {
            self.over_time_ui(ui, ctx);
            return false;
        };
        // No motion helps a run that is not trusted.
        let is_trusted = || ctx.answer(run).withheld().is_none_or(|it| step.report.stamp_ns < it.from_ns);
        if with_sentences && is_trusted() {
            self.advice.ui(ui, ctx, step);
        }
        let left = bottom - ui.cursor().top();
        let report = ctx.flight(ui, run);
        let worst = heat_map::important_rows(rank, &report.rows);
        heat_map::ui(ui, ctx, rank, &worst, details.map(|below| left - below));
        true
    }

    /// Draws the details behind the summary in sections; a section is initially open if it fits.
    fn details_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord, step: &Arc<StepRecord>) {
        let Some(rank) = &step.rank else { return };
        let (theme, names, presentation) = (*ctx.theme, ctx.names(), ctx.presentation);
        ui.spacing_mut().item_spacing.y = 3.0;
        self.slider.ui(ui, ctx, step);
        for note in verdict::verdict(step, &names).notes {
            let line = ui.add(egui::Label::new(RichText::new(note.text).color(theme.warn)).wrap());
            line.on_hover_text(note.term.meaning);
        }
        let height = (0.2 * ui.clip_rect().height()).clamp(70.0, 150.0);
        section_ui(ui, &theme, presentation, "Singular values", height, |ui| {
            spectrum::ui(ui, &theme, &names, rank, height);
        });
        self.information.ui(ui, ctx, run, step);
        let number = ctx.run_number();
        compare::singularity_ui(ui, ctx, number, run, step);
        section_ui(ui, &theme, presentation, "Ranks over time", OVER_TIME_HEIGHT, |ui| self.over_time_ui(ui, ctx));
        self.advice.alternatives_ui(ui, ctx);
        structure_ui(ui, ctx, &names, rank);
    }

    /// Structural and informed rank of all runs over time.
    fn over_time_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        /// Height of the caption in points.
        const CAPTION: f32 = 14.0;
        let theme = *ctx.theme;
        let tables = self.tables.read(&ctx.recording.runs, rank_row);
        let max_rank = tables.iter().flat_map(|table| &table.columns[PARAMETERS]).copied().fold(0.0, f64::max);
        if max_rank == 0.0 {
            return;
        }
        let (_, all) = ui.allocate_space(vec2(ui.available_width(), OVER_TIME_HEIGHT));
        let outer = all.with_min_y(all.top() + CAPTION);
        let rect = within_gutters(outer, TIME_GUTTER);
        let (begin_ns, end_ns) = visible_range(ctx);
        let key = "Rank over time";
        let (low, high) = value_range_of(ctx, key, 0.0, max_rank * 1.08);
        let area = PlotArea { rect, begin_ns, end_ns, low, high, middle: None };
        let caption = format!("informed rank over time, of {max_rank:.0} (faint: structural rank)");
        let place = all.left_top() + vec2(3.0, 0.0);
        ui.painter().text(place, egui::Align2::LEFT_TOP, caption, super::theme::label_font(), theme.text_weak);
        let painter = ui.painter_at(outer);
        paint_ground(&painter, &theme, rect);
        paint_value_axis(&painter, &theme, &area, 1.0);
        paint_time_axis(&painter, &theme, &area, TIME_GUTTER);
        let inner = painter.with_clip_rect(rect.intersect(painter.clip_rect()));
        self.curves.resize_with(tables.len(), Default::default);
        for (run, (table, [informed, structural])) in tables.iter().zip(&mut self.curves).enumerate() {
            informed.update(&area, table.epoch, &table.stamps_ns, &table.columns[INFORMED]);
            structural.update(&area, table.epoch, &table.stamps_ns, &table.columns[STRUCTURAL]);
            let style = theme.run(run);
            let faint = RunStyle { color: style.color.gamma_multiply(0.45), ..style };
            paint_steps(&inner, &area, structural, faint, CURVE_WIDTH);
            paint_steps(&inner, &area, informed, style, CURVE_WIDTH);
        }
        let id = ui.unique_id().with("rank over time");
        let value = ctx.selected_run().and_then(|run| run.step_at(ctx.cursor_ns)).and_then(|step| step.rank.as_ref());
        let value = value.map_or_else(String::new, ranks_text);
        let wheel = Wheel::in_list(self.overflows);
        let plot = Interaction { id, name: key, value: &value, clicks: Clicks::Seek, wheel };
        let lines = read_lines(&theme, tables.iter().map(|table| (&*table.stamps_ns, &*table.columns[INFORMED])));
        let readout = Readout { key, lines: &lines, factor: 1.0, unit: "", whole: true };
        plot_ui(ui, ctx, &area, &plot, &readout).on_hover_text(window::RANKS_OVER_TIME.meaning);
    }
}

fn rank_row(step: &StepRecord) -> [f64; 3] {
    step.rank.as_ref().filter(|rank| !rank.parameters.is_empty()).map_or([f64::NAN, f64::NAN, 0.0], |rank| {
        [rank.rank_structural as f64, rank.rank_informed as f64, rank.parameters.len() as f64]
    })
}

/// A rectangle split into left and right at a fraction of its width, with a gap.
fn halves(rect: egui::Rect, fraction: f32) -> [egui::Rect; 2] {
    const GAP: f32 = 16.0;
    let (left, right) = rect.split_left_right_at_fraction(fraction);
    [left.with_max_x(left.right() - GAP), right]
}

/// Draws the verdict at the cursor: a symbol, one line, the reasons, and the least observable direction with its start;
/// the cause of an uninformed direction if there is room.
fn verdict_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    verdict: &RankVerdict,
    since: Option<LostSince>,
    with_cause: bool,
) {
    let theme = *ctx.theme;
    let look = mark_of(verdict.level, &theme);
    headline_ui(ui, &theme, look, "At the cursor:", &verdict.headline, window::RANKS.meaning);
    let cause = verdict.cause.iter().filter(|_| with_cause);
    for reason in verdict.reasons.iter().chain(cause) {
        let line = ui.add(egui::Label::new(RichText::new(&reason.text).color(theme.text)).wrap());
        line.on_hover_text(reason.term.meaning);
    }
    let Some(direction) = &verdict.direction else { return };
    let Some((kind, names)) = direction.text.split_once(": ") else { return };
    let kind_of_loss = since.map_or_else(String::new, |since| format!(", {}", since.kind()));
    let (name, text) = (format!("{kind}: "), format!("{names}{kind_of_loss}"));
    let since_ns = since.map(|since| since.stamp_ns);
    fact_at_ui(ui, ctx, &name, &text, since_ns, direction.term.meaning);
}

/// Draws the null directions that are known in closed form.
fn structure_ui(ui: &mut Ui, ctx: &PanelContext<'_>, names: &ParameterNames, rank: &RankReport) {
    if rank.known.is_empty() {
        return;
    }
    let title = format!(
        "Closed-form null directions: {} of {} confirmed by the measured Jacobian",
        rank.known_agreeing(),
        rank.known.len()
    );
    let theme = ctx.theme;
    let title =
        RichText::new(title).color(if rank.known_agreeing() == rank.known.len() { theme.text } else { theme.error });
    if ctx.presentation.is_figure() {
        ui.label(title);
        return;
    }
    egui::CollapsingHeader::new(title).id_salt("known structure").show(ui, |ui| {
        for line in verdict::structure_lines(rank, names) {
            ui.add(egui::Label::new(RichText::new(line).small().color(theme.text)).wrap());
        }
    });
}

/// Symbol and colour of a level; the symbol is unique without the colour.
fn mark_of(level: Level, theme: &Theme) -> (&'static str, egui::Color32) {
    match level {
        Level::Good => ("✔", theme.ok),
        Level::Uninformed => ("⚠", theme.warn),
        Level::Lost => ("✖", theme.error),
        Level::None => ("…", theme.text_weak),
    }
}
