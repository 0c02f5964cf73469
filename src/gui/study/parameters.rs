//! Errors of calibration parameters against their σ.

use egui::{Align2, Rect, RichText, Role, ScrollArea, Sense, Stroke, Ui, WidgetInfo, pos2, vec2};

use super::context::StudyContext;
use super::points::Points;
use crate::gui::plot::{GridLine, ValueAxis, ValuePlot};
use crate::gui::table::{aligned_rows, number_ui};
use crate::gui::theme::{ThemeName, label_font};
use crate::gui::units::{fixed, significant};
use crate::gui::widgets::describe;
use crate::study::view::{ParameterErrors, Study, parameter_errors};
use crate::table::Medium;

/// Space in points to the left of the scatter plot for ticks and titles.
const LEFT: f32 = 50.0;
/// Space in points below the scatter plot.
const BELOW: f32 = 32.0;
/// Height of a line of text in points.
const LABEL_HEIGHT: f32 = 14.0;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    generation: u64,
    chosen: usize,
    rect: Rect,
    theme: ThemeName,
}

#[derive(Debug, Default)]
pub(super) struct ParametersPanel {
    /// Row of the study for each row of the table of parameters.
    run_of: Vec<Option<usize>>,
    generation: Option<u64>,
    errors: Vec<ParameterErrors>,
    chosen: String,
    key: Option<Key>,
    points: Points,
}

impl ParametersPanel {
    pub(super) fn new(study: &Study) -> Self {
        Self { run_of: study.run_of_parameter_rows(), ..Self::default() }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut StudyContext<'_>) {
        if self.generation != Some(ctx.model.generation) {
            self.generation = Some(ctx.model.generation);
            self.errors = parameter_errors(ctx.study, &self.run_of, &ctx.model.arranged.rows);
            self.key = None;
        }
        if self.errors.is_empty() {
            let text = "No run that passes the filter has calibration parameters with a ground truth";
            ui.add(egui::Label::new(RichText::new(text).color(ctx.theme.text_weak)).wrap());
            return;
        }
        let chosen =
            self.errors.iter().position(|of| of.name == self.chosen).unwrap_or_else(|| least_consistent(&self.errors));
        let room = ui.available_rect_before_wrap();
        let table = Rect::from_min_max(room.min, pos2(room.left() + (0.58 * room.width()).min(500.0), room.bottom()));
        let plot = Rect::from_min_max(pos2(table.right() + 8.0, room.top()), room.max);
        ui.scope_builder(egui::UiBuilder::new().max_rect(table), |ui| self.table_ui(ui, ctx, chosen));
        if plot.width() > LEFT + 40.0 && plot.height() > BELOW + 40.0 {
            ui.scope_builder(egui::UiBuilder::new().max_rect(plot), |ui| self.scatter_ui(ui, ctx, chosen, plot));
        }
    }

    fn table_ui(&mut self, ui: &mut Ui, ctx: &StudyContext<'_>, chosen: usize) {
        let theme = ctx.theme;
        ScrollArea::both().id_salt("parameters").auto_shrink(false).show(ui, |ui| {
            let grid = egui::Grid::new("parameter errors").striped(true).spacing(vec2(12.0, 1.0)).min_row_height(15.0);
            grid.show(ui, |ui| {
                let columns = ParameterErrors::columns();
                let shown: Vec<_> = columns.iter().filter_map(|it| Some((it, it.heading(Medium::Screen)?))).collect();
                for (column, heading) in &shown {
                    ui.label(RichText::new(*heading).color(theme.text_weak)).on_hover_text(&*column.meaning);
                }
                ui.end_row();
                let texts = |of| shown[1..].iter().map(|(column, _)| column.shown_text(of, Medium::Screen)).collect();
                let texts = aligned_rows(self.errors.iter().map(texts).collect());
                for (number, (of, texts)) in self.errors.iter().zip(texts).enumerate() {
                    if ctx.presentation.is_figure() {
                        ui.label(RichText::new(&of.name).color(theme.text));
                    } else if ui.selectable_label(number == chosen, &of.name).clicked() {
                        self.chosen.clone_from(&of.name);
                    }
                    for ((column, _), text) in shown[1..].iter().zip(texts) {
                        number_ui(ui, &text, theme.tone(column.shown_tone(of)));
                    }
                    ui.end_row();
                }
            });
        });
    }

    /// Scatter plot of |error| over σ of every run, both logarithmic, with lines at 1 σ and 3 σ.
    fn scatter_ui(&mut self, ui: &Ui, ctx: &mut StudyContext<'_>, chosen: usize, rect: Rect) {
        let theme = *ctx.theme;
        let of = &self.errors[chosen];
        let plot = Rect::from_min_max(rect.min + vec2(LEFT, 4.0), rect.max - vec2(4.0, BELOW));
        let painter = ui.painter_at(rect);
        painter.rect_filled(plot, 0.0, theme.plot_background);
        let [x, y] = axes(of);
        let axes = ValuePlot { rect: plot, x, y };
        let line = |value| GridLine { value, color: theme.grid, label: significant(value) };
        axes.paint_columns(&painter, &theme, 2.0, x.marks((plot.width() / 50.0) as usize).into_iter().map(line));
        axes.paint_rows(&painter, &theme, 3.0, y.marks((plot.height() / 24.0) as usize).into_iter().map(line));
        let lines = painter.with_clip_rect(plot.intersect(painter.clip_rect()));
        for (factor, name) in [(1.0, "1σ"), (3.0, "3σ")] {
            let line = [x.low, x.high].map(|sigma| axes.at(sigma, factor * sigma));
            lines.add(egui::Shape::dashed_line(&line, Stroke::new(1.5, theme.ground_truth), 6.0, 4.0));
            let along = line[1] + (line[0] - line[1]) * 0.06 + vec2(-4.0, -2.0);
            let inside = pos2(along.x, along.y.max(plot.top() + LABEL_HEIGHT));
            lines.text(inside, Align2::RIGHT_BOTTOM, name, label_font(), theme.text_strong);
        }
        let key = Key { generation: ctx.model.generation, chosen, rect, theme: theme.name };
        if self.key != Some(key) {
            self.key = Some(key);
            let place = |sigma, error: f64| axes.at_or_edge(sigma, error.abs());
            let places = of.points.iter().map(|point| (place(point.sigma, point.error), point.row)).collect();
            self.points = Points::new(places, theme.run(0).color.gamma_multiply(0.7));
        }
        self.points.paint(&painter);
        let unit = if of.unit.is_empty() { String::new() } else { format!(" [{}]", of.unit) };
        let title = format!("σ of {}{unit}; upwards: |error|{unit}", of.name);
        painter.text(
            rect.center_bottom() + vec2(0.5 * LEFT, -1.0),
            Align2::CENTER_BOTTOM,
            title,
            label_font(),
            theme.text,
        );
        if let Some(row) = ctx.pointed {
            self.points.mark(&painter, row, theme.text_strong);
        }
        let figure = ctx.presentation.is_figure();
        let sense = if figure { Sense::hover() } else { Sense::click() };
        let response = ui.interact(plot, ui.unique_id().with("error over sigma"), sense);
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("Error over σ of {}", of.name)));
        let text = format!("RMS of error over σ {}, {} runs", fixed(of.ratio_rms, 2), of.points.len());
        describe(&response, &text);
        let found = response.hover_pos().filter(|_| !figure).and_then(|pointer| self.points.at(pointer));
        if let Some((row, _)) = found {
            let point = of.points.iter().find(|point| point.row == row);
            let unit = super::plots::spaced(of.unit);
            let value = point
                .map(|point| format!("error {}{unit}, σ {}{unit}", significant(point.error), significant(point.sigma)));
            ctx.point_at(ui, &response, row, &value.unwrap_or_default());
        }
    }
}

/// Index of the parameter with the largest error relative to σ; it is shown first.
fn least_consistent(errors: &[ParameterErrors]) -> usize {
    let worst = errors.iter().enumerate().max_by(|(_, a), (_, b)| a.ratio_rms.total_cmp(&b.ratio_rms));
    worst.map_or(0, |(place, _)| place)
}

/// Axes of σ and |error|. Errors far below all σ are shown at the lower edge.
fn axes(of: &ParameterErrors) -> [ValueAxis; 2] {
    let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::MIN_POSITIVE, f64::max);
    let sigmas = || of.points.iter().map(|point| point.sigma);
    let errors = || of.points.iter().map(|point| point.error.abs());
    let (low, high) = (least(&mut sigmas()), most(&mut sigmas()));
    let highest = most(&mut errors()).max(3.0 * high);
    let lowest = least(&mut errors().filter(|error| *error > 0.0)).clamp(1e-3 * low, low);
    [ValueAxis::logarithmic(low, high), ValueAxis::logarithmic(lowest, highest)]
}
