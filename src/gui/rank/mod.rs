//! The rank panel: observability of the calibration as a verdict, as a spectrum and by parameter name.

mod advice;
pub(super) mod columns;
mod compare;
mod csv;
mod heat_map;
mod information;
mod slider;
mod spectrum;
pub(crate) mod verdict;

pub(super) use self::compare::ui as all_runs_ui;

use std::sync::Arc;

use egui::{RichText, ScrollArea, Sense, Ui, UiBuilder, vec2};

use self::advice::AdviceUi;
use self::information::InformationUi;
use self::slider::SliderUi;
use self::verdict::Level;
use super::PanelContext;
use super::convergence::empty_ui;
use super::follow::RunTables;
use super::help::terms::window;
use super::plot::{Clicks, Curve, PlotArea, navigate, paint_cursor, paint_ground, paint_steps, visible_range};
use super::theme::{CURVE_WIDTH, RunStyle, Theme};
use crate::session::{RunRecord, StepRecord};

/// Columns of the tables over time.
const STRUCTURAL: usize = 0;
const INFORMED: usize = 1;
const PARAMETERS: usize = 2;

/// Width in points of the lines about one run.
const RUN_WIDTH: f32 = 480.0;

/// Panel height in points from which the ranks over time are shown.
const MIN_HEIGHT_WITH_TIME: f32 = 340.0;

/// Panel height in points from which alternatives to the best motion are shown.
const MIN_HEIGHT_WITH_ALTERNATIVES: f32 = 300.0;

/// Panel height in points from which the table of the information gain is shown beside the heat map.
const MIN_HEIGHT_WITH_INFORMATION: f32 = 1000.0;

/// State of the rank panel.
#[derive(Debug, Default)]
pub struct RankPanel {
    tables: RunTables,
    /// By run: informed and structural rank.
    curves: Vec<[Curve; 2]>,
    /// Whether advice is computed on its own thread, as in the window; screenshots wait for it.
    pub in_background: bool,
    advice: AdviceUi,
    information: InformationUi,
    slider: SliderUi,
    /// Show all runs side by side, in a panel too small for both views.
    all_runs: bool,
}

impl RankPanel {
    /// Draws the shown run, or all runs side by side.
    pub fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let recording = ctx.recording;
        let Some(run) = recording.runs.get(ctx.selection.run.min(recording.runs.len().saturating_sub(1))) else {
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
            let number = ctx.selection.run.min(recording.runs.len().saturating_sub(1));
            ui.label(RichText::new(&run.spec.label).strong().color(ctx.theme.run(number).color));
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

    /// One run.
    fn run_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        height: f32,
    ) {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 3.0;
            let top = ui.cursor().top();
            verdict_ui(ui, ctx, step);
            let Some(rank) = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty()) else {
                self.over_time_ui(ui, ctx);
                return;
            };
            self.advice.ui(ui, ctx, run, step, self.in_background, height > MIN_HEIGHT_WITH_ALTERNATIVES);
            self.information.ui(ui, ctx, run, step, height > MIN_HEIGHT_WITH_INFORMATION);
            let number = ctx.selection.run.min(ctx.recording.runs.len().saturating_sub(1));
            compare::singularity_ui(ui, ctx, number, run, step);
            self.slider.ui(ui, ctx, step);
            spectrum::ui(ui, ctx.theme, &ctx.names(), rank, (0.16 * height).clamp(60.0, 150.0));
            // The timeline has a lane for it too, so it yields to the heat map first.
            if height > MIN_HEIGHT_WITH_TIME {
                self.over_time_ui(ui, ctx);
            }
            let left = height - (ui.cursor().top() - top) - 4.0;
            heat_map::ui(ui, ctx, rank, left);
        });
    }

    /// Structural and informed rank of all runs over time.
    fn over_time_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        /// Heights of the caption and of the plot.
        const CAPTION: f32 = 14.0;
        const HEIGHT: f32 = 58.0;
        let theme = *ctx.theme;
        let tables = self.tables.read(&ctx.recording.runs, rank_row);
        let max_rank = tables.iter().flat_map(|table| &table.columns[PARAMETERS]).copied().fold(0.0, f64::max);
        if max_rank == 0.0 {
            return;
        }
        let (_, all) = ui.allocate_space(vec2(ui.available_width(), HEIGHT));
        let rect = egui::Rect::from_min_max(all.min + vec2(0.0, CAPTION), all.max);
        let (begin_ns, end_ns) = visible_range(ctx);
        let area = PlotArea { rect, begin_ns, end_ns, low: 0.0, high: max_rank * 1.08 };
        let caption = format!("informed rank over time, of {max_rank:.0} (faint: structural rank)");
        let place = all.left_top() + vec2(3.0, 0.0);
        ui.painter().text(place, egui::Align2::LEFT_TOP, caption, super::theme::label_font(), theme.text_weak);
        let painter = ui.painter_at(rect);
        paint_ground(&painter, &theme, rect);
        self.curves.resize_with(tables.len(), Default::default);
        for (run, (table, [informed, structural])) in tables.iter().zip(&mut self.curves).enumerate() {
            informed.update(&area, table.epoch, &table.stamps_ns, &table.columns[INFORMED]);
            structural.update(&area, table.epoch, &table.stamps_ns, &table.columns[STRUCTURAL]);
            let style = theme.run(run);
            let faint = RunStyle { color: style.color.gamma_multiply(0.45), ..style };
            paint_steps(&painter, &area, structural, faint, CURVE_WIDTH);
            paint_steps(&painter, &area, informed, style, CURVE_WIDTH);
        }
        paint_cursor(&painter, &theme, &area, ctx.cursor_ns);
        let id = ui.unique_id().with("rank over time");
        navigate(ui, ctx, &area, id, "Rank over time", Clicks::Seek, false)
            .on_hover_text(window::RANKS_OVER_TIME.meaning);
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

/// The verdict: a symbol, one line, and the reasons.
fn verdict_ui(ui: &mut Ui, ctx: &PanelContext<'_>, step: &StepRecord) {
    let (theme, names) = (ctx.theme, &ctx.names());
    let verdict = verdict::verdict(step, names);
    let (mark, color) = mark_of(verdict.level, theme);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        ui.label(RichText::new(mark).color(color).size(14.0));
        let headline = RichText::new(&verdict.headline).color(theme.text_strong).size(14.0);
        let headline = ui.add(egui::Label::new(headline).truncate());
        headline.on_hover_text(format!("{}\n{}", verdict.headline, window::VERDICT.meaning));
    });
    for reason in &verdict.reasons {
        let response =
            ui.add(egui::Label::new(RichText::new(&reason.text).color(theme.text)).truncate().sense(Sense::hover()));
        response.on_hover_text(format!("{}\n{}", reason.text, reason.term.meaning));
    }
    let Some(rank) = step.rank.as_ref().filter(|rank| !rank.known.is_empty()) else { return };
    let title = format!(
        "Closed-form null directions: {} of {} confirmed by the measured Jacobian",
        rank.known_agreeing(),
        rank.known.len()
    );
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

/// Symbol and colour of a level: never the colour alone.
fn mark_of(level: Level, theme: &Theme) -> (&'static str, egui::Color32) {
    match level {
        Level::Good => ("✔", theme.ok),
        Level::Weak => ("⚠", theme.warn),
        Level::Lost => ("✖", theme.error),
        Level::None => ("…", theme.text_weak),
    }
}
