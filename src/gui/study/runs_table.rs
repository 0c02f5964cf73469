//! Table of runs: sorted by clicks on its headings, grouped, and drawn only where it is visible.

use std::collections::BTreeSet;
use std::ops::Range;

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{
    Align2, Label, PopupCloseBehavior, Rect, RichText, Role, ScrollArea, Sense, Stroke, Ui, WidgetInfo, pos2, vec2,
};

use super::context::StudyContext;
use super::model::{StudyModel, shown_group};
use super::plots::spaced;
use crate::gui::theme::{Theme, label_font, number_font};
use crate::gui::units::{counted, significant};
use crate::study::view::{Metric, Spread, Study, columns};
use crate::study::{Cell, ColumnType, ColumnValues, StudyColumn};

/// Height of a line in points.
const LINE: f32 = 18.0;
/// Minimum and maximum width of a column in points.
const WIDTHS: [f32; 2] = [44.0, 230.0];
/// Number of rows from which the width of a column is measured.
const MEASURED: usize = 300;
/// Initially shown columns, if they vary or have different results.
const FIRST: [&str; 18] = [
    columns::RUN,
    columns::LOG,
    columns::DISTURBANCE,
    columns::PERTURBATION,
    columns::SEED,
    columns::STATUS,
    columns::ATE,
    "ate_percent",
    "rpe_10m_translation_m",
    "pose_nees",
    "chain_error_m",
    "chain_error_rad",
    "parameter_error_sigma",
    "rank_informed",
    "restarts",
    "real_time_factor",
    "peak_memory_bytes",
    columns::MESSAGE,
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    Group(usize),
    Run(usize),
}

#[derive(Debug)]
pub(super) struct RunsTablePanel {
    /// Names of the shown columns in the order of the study.
    shown: BTreeSet<String>,
    /// Names of groups whose rows are hidden.
    closed: BTreeSet<String>,
    generation: Option<u64>,
    lines: Vec<Line>,
    /// Shown columns: index in the study, title and width; empty until they are measured.
    columns: Vec<ShownColumn>,
    /// Quantiles of the metric by group.
    spreads: Vec<Option<Spread>>,
}

#[derive(Clone, Debug)]
struct ShownColumn {
    place: usize,
    title: String,
    factor: f64,
    width: f32,
    number: bool,
}

impl RunsTablePanel {
    pub(super) fn new(study: &Study) -> Self {
        let varying: BTreeSet<&str> = study.runs.varying_columns().map(|column| column.name.as_str()).collect();
        let constant = [columns::RUN, columns::LOG, columns::STATUS, columns::ATE];
        let first = FIRST.into_iter().filter(|name| varying.contains(name) || constant.contains(name));
        let first = first.filter(|name| study.runs.place(name).is_some());
        Self {
            shown: first.map(str::to_owned).collect(),
            closed: BTreeSet::new(),
            generation: None,
            lines: Vec::new(),
            columns: Vec::new(),
            spreads: Vec::new(),
        }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut StudyContext<'_>) {
        self.bar_ui(ui, ctx);
        if self.columns.is_empty() {
            self.measure(ui, ctx.study);
        }
        if self.generation != Some(ctx.model.generation) {
            self.generation = Some(ctx.model.generation);
            self.arrange(ctx.study, ctx.model);
        }
        let width: f32 = self.columns.iter().map(|column| column.width).sum();
        ScrollArea::horizontal().id_salt("columns").auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 0.0;
            let width = width.max(ui.available_width());
            self.heads_ui(ui, ctx, width);
            let area = ScrollArea::vertical().id_salt("runs").auto_shrink(false);
            area.show_rows(ui, LINE, self.lines.len(), |ui, range| self.lines_ui(ui, ctx, range, width));
        });
    }

    /// Draws number of runs, and menus for the columns and the groups.
    fn bar_ui(&mut self, ui: &mut Ui, ctx: &StudyContext<'_>) {
        let (shown, all) = (ctx.model.arranged.rows.len(), ctx.study.runs.rows());
        let text = if shown == all { counted(all, "run") } else { format!("{shown} of {}", counted(all, "run")) };
        if ctx.presentation.is_figure() {
            ui.label(RichText::new(text).small().color(ctx.theme.text_weak));
            return;
        }
        ui.horizontal(|ui| {
            let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
            MenuButton::new("Columns").config(config).ui(ui, |ui| {
                ScrollArea::vertical().max_height(400.0).show(ui, |ui| {
                    for column in ctx.study.runs.columns() {
                        let mut shown = self.shown.contains(&column.name);
                        if ui.checkbox(&mut shown, &column.name).on_hover_text(&column.description).changed() {
                            if shown {
                                self.shown.insert(column.name.clone());
                            } else {
                                self.shown.remove(&column.name);
                            }
                            self.columns.clear();
                        }
                    }
                });
            });
            if ctx.model.group().is_some() {
                let groups = || ctx.model.arranged.groups.iter().map(|group| group.name.clone());
                let open = groups().any(|name| !self.closed.contains(&name));
                let name = if open { "Close groups" } else { "Open groups" };
                if ui.button(name).clicked() {
                    self.closed = if open { groups().collect() } else { BTreeSet::new() };
                    self.generation = None;
                }
            }
            let hint = "header: sort (Shift: add key); run: open it at its worst frame";
            ui.add(Label::new(RichText::new(format!("{text} · {hint}")).small().color(ctx.theme.text_weak)).truncate());
        });
    }

    /// Arranges the lines of the table: headings of groups and rows.
    fn arrange(&mut self, study: &Study, model: &StudyModel) {
        self.lines.clear();
        let grouped = model.group().is_some();
        for (place, group) in model.arranged.groups.iter().enumerate() {
            if grouped {
                self.lines.push(Line::Group(place));
            }
            if !grouped || !self.closed.contains(&group.name) {
                self.lines.extend(group.rows.iter().map(|row| Line::Run(*row)));
            }
        }
        let spread = |rows: &[usize]| {
            let metric = model.metric()?;
            Spread::of(metric.values(&study.runs, rows).into_iter().map(|(_, value)| value))
        };
        self.spreads = model.arranged.groups.iter().map(|group| spread(&group.rows)).collect();
    }

    /// Measures the widths of the shown columns from their titles and first rows.
    fn measure(&mut self, ui: &Ui, study: &Study) {
        let width = |text: String, number: bool| {
            let font = if number { number_font() } else { label_font() };
            ui.painter().layout_no_wrap(text, font, egui::Color32::WHITE).size().x
        };
        let column = |place: usize, column: &StudyColumn| {
            let metric = Metric::of(column).filter(|_| column.name != columns::SEED);
            let title = metric.as_ref().map_or_else(|| column.name.clone(), Metric::title);
            let factor = metric.map_or(1.0, |metric| metric.factor);
            let number = column.values.column_type() != ColumnType::Text;
            let cells = (0..study.runs.rows().min(MEASURED)).map(|row| text_of(&column.values, row, factor));
            let widest = cells.map(|text| width(text, number)).fold(width(title.clone(), false) + 14.0, f32::max);
            ShownColumn { place, title, factor, width: (widest + 12.0).clamp(WIDTHS[0], WIDTHS[1]), number }
        };
        let columns = study.runs.columns();
        let order = |name: &str| FIRST.iter().position(|known| *known == name).unwrap_or(FIRST.len());
        let mut shown: Vec<usize> = (0..columns.len()).filter(|it| self.shown.contains(&columns[*it].name)).collect();
        shown.sort_by_key(|place| (order(&columns[*place].name), *place));
        self.columns = shown.into_iter().map(|place| column(place, &columns[place])).collect();
    }

    /// Draws the headings; a click sorts.
    fn heads_ui(&self, ui: &mut Ui, ctx: &mut StudyContext<'_>, width: f32) {
        let theme = *ctx.theme;
        let (_, rect) = ui.allocate_space(vec2(width, LINE + 2.0));
        ui.painter().rect_filled(rect, 0.0, theme.surface_raised);
        let mut left = rect.left();
        for column in &self.columns {
            let place = Rect::from_x_y_ranges(left..=left + column.width, rect.y_range());
            left += column.width;
            let of = &ctx.study.runs.columns()[column.place];
            let key = ctx.model.sort.iter().position(|key| key.column == of.name);
            let sign = match key.map(|at| (ctx.model.sort[at].descending, at)) {
                None => String::new(),
                Some((descending, at)) => {
                    let number = if ctx.model.sort.len() > 1 { (at + 1).to_string() } else { String::new() };
                    format!(" {}{number}", if descending { "▼" } else { "▲" })
                }
            };
            let title = format!("{}{sign}", column.title);
            let painter = ui.painter_at(place.intersect(ui.clip_rect()));
            let color = if key.is_some() { theme.text_strong } else { theme.text };
            let (at, align) = if column.number {
                (place.right_center() - vec2(6.0, 0.0), Align2::RIGHT_CENTER)
            } else {
                (place.left_center() + vec2(4.0, 0.0), Align2::LEFT_CENTER)
            };
            painter.text(at, align, title, label_font(), color);
            painter.vline(place.right(), place.y_range(), Stroke::new(1.0, theme.outline));
            if ctx.presentation.is_figure() {
                continue;
            }
            let response = ui.interact(place, ui.unique_id().with(("head", column.place)), Sense::click());
            response.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Sort by {}", of.name)));
            let hover = format!("{}: {}", of.name, of.description);
            if response.on_hover_text(hover).clicked() {
                let add = ui.input(|input| input.modifiers.shift);
                ctx.model.sort_by(&of.name, add);
                ui.ctx().request_repaint();
            }
        }
    }

    fn lines_ui(&mut self, ui: &mut Ui, ctx: &mut StudyContext<'_>, range: Range<usize>, width: f32) {
        let (_, rect) = ui.allocate_space(vec2(width, LINE * range.len() as f32));
        let mut toggled = None;
        for (number, line) in range.clone().zip(&self.lines[range.clone()]) {
            let top = rect.top() + LINE * (number - range.start) as f32;
            let place = Rect::from_x_y_ranges(rect.x_range(), top..=top + LINE);
            match line {
                Line::Group(group) => {
                    if self.group_ui(ui, ctx, *group, place) {
                        toggled = Some(*group);
                    }
                }
                Line::Run(row) => self.run_ui(ui, ctx, *row, place, number % 2 == 1),
            }
        }
        if let Some(group) = toggled.and_then(|group| ctx.model.arranged.groups.get(group)) {
            if !self.closed.remove(&group.name) {
                self.closed.insert(group.name.clone());
            }
            self.generation = None;
            ui.ctx().request_repaint();
        }
    }

    /// Draws the heading of a group; returns true if it is clicked.
    fn group_ui(&self, ui: &Ui, ctx: &StudyContext<'_>, group: usize, place: Rect) -> bool {
        let theme = ctx.theme;
        let Some(of) = ctx.model.arranged.groups.get(group) else { return false };
        let closed = self.closed.contains(&of.name);
        ui.painter().rect_filled(place, 0.0, theme.surface_raised);
        let name = shown_group(&of.name, ctx.model.group());
        let spread = self.spreads.get(group).copied().flatten().zip(ctx.model.metric());
        let median = spread.map(|(spread, metric)| {
            format!("   median {} {}{}", metric.column, significant(spread.median), spaced(metric.unit))
        });
        let sign = if closed { "▶" } else { "▼" };
        let text = format!("{sign} {name}   {}{}", counted(of.rows.len(), "run"), median.unwrap_or_default());
        let left = place.left().max(ui.clip_rect().left());
        let painter = ui.painter_at(place.intersect(ui.clip_rect()));
        painter.text(pos2(left + 4.0, place.center().y), Align2::LEFT_CENTER, text, label_font(), theme.text_strong);
        if ctx.presentation.is_figure() {
            return false;
        }
        let response = ui.interact(place, ui.unique_id().with(("group", &of.name)), Sense::click());
        let name = format!("{} group {name}", if closed { "Open" } else { "Close" });
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &name));
        response.clicked()
    }

    fn run_ui(&self, ui: &Ui, ctx: &mut StudyContext<'_>, row: usize, place: Rect, striped: bool) {
        let theme = *ctx.theme;
        let clip = ui.clip_rect();
        if striped {
            ui.painter().rect_filled(place, 0.0, theme.surface_raised.gamma_multiply(0.35));
        }
        if ctx.pointed == Some(row) {
            ui.painter().rect_filled(place, 0.0, theme.accent.gamma_multiply(0.25));
        }
        if !ctx.presentation.is_figure() {
            let response = ui.interact(place, ui.unique_id().with(("run", row)), Sense::click());
            let name = || WidgetInfo::labeled(Role::Button, true, format!("Open {}", ctx.study.title_of(row)));
            response.widget_info(name);
            if response.has_focus() {
                ui.painter().rect_stroke(
                    place.shrink(1.0),
                    0.0,
                    Stroke::new(1.0, theme.accent),
                    egui::StrokeKind::Inside,
                );
            }
            if response.hovered() || response.clicked() {
                let message = ctx.study.runs.text(row, columns::MESSAGE).unwrap_or_default().to_owned();
                ctx.point_at(ui, &response, row, &message);
            }
        }
        let mut left = place.left();
        for column in &self.columns {
            let cell = Rect::from_x_y_ranges(left..=left + column.width, place.y_range());
            left += column.width;
            if !cell.intersects(clip) {
                continue;
            }
            let of = &ctx.study.runs.columns()[column.place];
            let text = text_of(&of.values, row, column.factor);
            let color = cell_color(&theme, of, &text);
            let painter = ui.painter_at(cell.shrink2(vec2(3.0, 0.0)).intersect(clip));
            if column.number {
                let at = cell.right_center() - vec2(6.0, 0.0);
                painter.text(at, Align2::RIGHT_CENTER, text, number_font(), color);
            } else {
                let first = text.lines().next_back().unwrap_or_default();
                let at = cell.left_center() + vec2(4.0, 0.0);
                painter.text(at, Align2::LEFT_CENTER, first, label_font(), color);
            }
        }
    }
}

/// Shown text of a cell: numbers with three digits in the shown unit.
fn text_of(values: &ColumnValues, row: usize, factor: f64) -> String {
    match values.cell(row) {
        Cell::Number(number) => significant(number * factor),
        Cell::Integer(integer) if factor != 1.0 => significant(integer as f64 * factor),
        Cell::Bool(on) => if on { "on" } else { "off" }.to_owned(),
        Cell::Empty => "–".to_owned(),
        cell => cell.to_string(),
    }
}

/// Colour of a cell: marks a status other than success, in addition to the text.
fn cell_color(theme: &Theme, column: &StudyColumn, text: &str) -> egui::Color32 {
    if column.name == columns::STATUS && text != columns::STATUS_OK {
        theme.error
    } else if text == "–" {
        theme.text_weak
    } else {
        theme.text
    }
}
