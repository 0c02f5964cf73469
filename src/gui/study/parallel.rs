//! Parallel coordinates: every run is a line over axes of inputs and results.

use std::collections::BTreeMap;
use std::sync::Arc;

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::epaint::{Mesh, Vertex, WHITE_UV};
use egui::{Align2, Color32, PopupCloseBehavior, Pos2, Rect, Role, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2};

use super::context::StudyContext;
use super::parallel_axes::{AxisScale, ParallelAxis, default_axes, parallel_axis};
use crate::gui::theme::{Theme, ThemeName, label_font, number_font, viridis};
use crate::gui::units::significant;
use crate::gui::widgets::describe;
use crate::study::view::Study;

/// Distance in points within which the pointer hits a line.
const REACH: f32 = 5.0;
/// Space in points above the axes for titles and upper ends.
const ABOVE: f32 = 34.0;
/// Space in points below the axes.
const BELOW: f32 = 18.0;
/// Number of colours of the metric.
const SHADES: usize = 12;
const MAX_AXES: usize = 12;

/// Inputs of the drawn lines; equal keys have equal lines.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    generation: u64,
    columns: Vec<String>,
    rect: Rect,
    theme: ThemeName,
}

/// State of the panel: the chosen axes, and the lines.
#[derive(Debug, Default)]
pub(super) struct ParallelPanel {
    columns: Vec<String>,
    key: Option<Key>,
    axes: Vec<ParallelAxis>,
    mesh: Arc<Mesh>,
}

impl ParallelPanel {
    pub(super) fn new(study: &Study) -> Self {
        Self { columns: default_axes(&study.runs), ..Self::default() }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut StudyContext<'_>) {
        if !ctx.presentation.is_figure() {
            self.chooser_ui(ui, ctx);
        }
        let (_, rect) = ui.allocate_space(ui.available_size());
        let metric = ctx.metric();
        let columns: Vec<String> = self
            .columns
            .iter()
            // The axis of the metric is always the last one.
            .filter(|column| metric.as_ref().is_none_or(|metric| metric.column != **column))
            .cloned()
            .chain(metric.as_ref().map(|metric| metric.column.clone()))
            .collect();
        let theme = *ctx.theme;
        let key = Key { generation: ctx.model.generation, columns, rect, theme: theme.name };
        if self.key.as_ref() != Some(&key) {
            let rows = &ctx.model.arranged.rows;
            if self.key.as_ref().is_none_or(|old| (old.generation, &old.columns) != (key.generation, &key.columns)) {
                let axis = |column: &String| parallel_axis(&ctx.study.runs, column, rows);
                self.axes = key.columns.iter().filter_map(axis).collect();
            }
            self.mesh = Arc::new(lines(&theme, &self.axes, plot_of(rect), rows.len()));
            self.key = Some(key);
        }
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 0.0, theme.plot_background);
        let plot = plot_of(rect);
        painter.add(Shape::Mesh(Arc::clone(&self.mesh)));
        for number in 0..self.axes.len() {
            self.axis_ui(&painter, &theme, plot, number);
        }
        self.pointer_ui(ui, ctx, rect, plot, &painter);
    }

    /// Draws the menu of the axes.
    fn chooser_ui(&mut self, ui: &mut Ui, ctx: &StudyContext<'_>) {
        let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
        ui.horizontal(|ui| {
            MenuButton::new("Axes").config(config).ui(ui, |ui| {
                egui::ScrollArea::vertical().max_height(360.0).show(ui, |ui| {
                    let metrics = ctx.model.metrics.iter().map(|metric| &metric.column);
                    for column in ctx.model.group_columns.iter().chain(metrics) {
                        let mut shown = self.columns.contains(column);
                        let room = shown || self.columns.len() < MAX_AXES;
                        let check = ui.add_enabled(room, egui::Checkbox::new(&mut shown, column));
                        if check.changed() {
                            self.columns.retain(|known| known != column);
                            self.columns.extend(shown.then(|| column.clone()));
                        }
                    }
                });
            });
            let text = "every run is a line; colour: the metric on the last axis";
            ui.label(egui::RichText::new(text).small().color(ctx.theme.text_weak));
        });
    }

    /// Draws line, title and ticks of an axis.
    fn axis_ui(&self, painter: &egui::Painter, theme: &Theme, plot: Rect, number: usize) {
        let (axis, count) = (&self.axes[number], self.axes.len());
        let x = axis_x(plot, number, count);
        painter.vline(x, plot.y_range(), Stroke::new(1.5, theme.text_weak));
        let room = plot.width() / count.max(2).saturating_sub(1) as f32 - 6.0;
        // The outer titles are aligned to the edges of the plot.
        let (align, from) = match number {
            0 => (Align2::LEFT_BOTTOM, plot.left() - 12.0),
            _ if number + 1 == count => (Align2::RIGHT_BOTTOM, plot.right() + 34.0),
            _ => (Align2::CENTER_BOTTOM, x),
        };
        let clip = match number {
            0 => Rect::from_x_y_ranges(from..=from + room, plot.y_range()),
            _ if number + 1 == count => Rect::from_x_y_ranges(from - room..=from, plot.y_range()),
            _ => Rect::from_x_y_ranges(x - 0.5 * room..=x + 0.5 * room, plot.y_range()),
        };
        let clip = clip.with_min_y(plot.top() - ABOVE);
        let titles = painter.with_clip_rect(clip.intersect(painter.clip_rect()));
        titles.text(pos2(from, plot.top() - 6.0), align, &axis.title, label_font(), theme.text_strong);
        let texts: Vec<(f64, String)> = match &axis.scale {
            AxisScale::Values(values) => {
                let marks = values.marks((plot.height() / 30.0) as usize);
                marks.into_iter().map(|mark| (values.position(mark), significant(mark))).collect()
            }
            AxisScale::Names(names) => {
                let place = |place: usize| (place as f64 + 0.5) / names.len() as f64;
                names.iter().enumerate().map(|(number, name)| (place(number), name.clone())).collect()
            }
        };
        let mut free = f32::INFINITY;
        for (position, text) in texts {
            let at = pos2(x + 4.0, y_of(plot, position));
            painter.hline(x - 3.0..=x + 3.0, at.y, Stroke::new(1.0, theme.text_weak));
            if at.y + 6.0 > free {
                continue;
            }
            free = at.y - 6.0;
            let text = if text.chars().count() > 22 {
                format!("{}…", text.chars().take(21).collect::<String>())
            } else {
                text
            };
            let galley = painter.layout_no_wrap(text, number_font(), theme.text_strong);
            let place = Align2::LEFT_CENTER.anchor_size(at, galley.size());
            painter.rect_filled(place.expand(1.0), 1.0, theme.plot_background.gamma_multiply(0.75));
            painter.galley(place.min, galley, theme.text_strong);
        }
    }

    fn pointer_ui(&self, ui: &Ui, ctx: &mut StudyContext<'_>, rect: Rect, plot: Rect, painter: &egui::Painter) {
        let figure = ctx.presentation.is_figure();
        let sense = if figure { Sense::hover() } else { Sense::click() };
        let response = ui.interact(rect, ui.unique_id().with("parallel lines"), sense);
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Parallel coordinates"));
        let titles: Vec<&str> = self.axes.iter().map(|axis| axis.title.as_str()).collect();
        describe(&response, &format!("{} runs over {}", ctx.model.arranged.rows.len(), titles.join(", ")));
        if let Some(place) = ctx.pointed.and_then(|row| ctx.model.arranged.rows.iter().position(|of| *of == row)) {
            let points: Vec<Pos2> = self.points_of(place, plot).flatten().collect();
            painter.add(Shape::line(points.clone(), Stroke::new(5.0, ctx.theme.plot_background)));
            painter.add(Shape::line(points, Stroke::new(2.5, ctx.theme.text_strong)));
        }
        if let Some(row) = response.hover_pos().filter(|_| !figure).and_then(|pointer| self.line_at(pointer, plot))
            && let Some(row) = ctx.model.arranged.rows.get(row).copied()
        {
            let value = ctx.metric().and_then(|metric| Some((metric.value(&ctx.study.runs, row)?, metric)));
            let value =
                value.map(|(value, metric)| format!("{} {} {}", metric.column, significant(value), metric.unit));
            ctx.point_at(ui, &response, row, &value.unwrap_or_default());
        }
    }

    /// Intersections of a line with the axes.
    fn points_of(&self, place: usize, plot: Rect) -> impl Iterator<Item = Option<Pos2>> {
        let count = self.axes.len();
        self.axes.iter().enumerate().map(move |(number, axis)| {
            let position = axis.positions.get(place).copied().flatten()?;
            Some(pos2(axis_x(plot, number, count), y_of(plot, position)))
        })
    }

    /// Index of the line nearest to the pointer among the shown rows.
    fn line_at(&self, pointer: Pos2, plot: Rect) -> Option<usize> {
        let gaps = self.axes.len().checked_sub(1).filter(|gaps| *gaps > 0)?;
        let fraction = ((pointer.x - plot.left()) / plot.width()).clamp(0.0, 1.0) * gaps as f32;
        let left = (fraction.floor() as usize).min(gaps - 1);
        let along = f64::from(fraction - left as f32);
        let (from, to) = (&self.axes[left].positions, &self.axes[left + 1].positions);
        let distance = |(from, to): (&Option<f64>, &Option<f64>)| {
            let (from, to) = ((*from)?, (*to)?);
            Some((y_of(plot, from + (to - from) * along) - pointer.y).abs())
        };
        let near = from.iter().zip(to).enumerate().filter_map(|(place, ends)| Some((place, distance(ends)?)));
        let near = near.filter(|(_, distance)| *distance <= REACH).min_by(|(_, a), (_, b)| a.total_cmp(b));
        near.map(|(place, _)| place)
    }
}

fn plot_of(rect: Rect) -> Rect {
    let inner = Rect::from_min_max(rect.min + vec2(16.0, ABOVE), rect.max - vec2(48.0, BELOW));
    if inner.is_positive() { inner } else { Rect::from_center_size(rect.center(), vec2(1.0, 1.0)) }
}

fn axis_x(plot: Rect, number: usize, count: usize) -> f32 {
    plot.left() + plot.width() * number as f32 / count.saturating_sub(1).max(1) as f32
}

fn y_of(plot: Rect, position: f64) -> f32 {
    plot.bottom() - position as f32 * plot.height()
}

/// Lines of all rows as one mesh. Lines between the same two pixels are drawn once, the darker the more they are, so
/// that the mesh does not grow with the number of rows.
fn lines(theme: &Theme, axes: &[ParallelAxis], plot: Rect, rows: usize) -> Mesh {
    let mut mesh = Mesh::default();
    let Some(last) = axes.last() else { return mesh };
    let shade = |place: usize| {
        let position = last.positions[place].map_or(0.0, |position| position.clamp(0.0, 1.0));
        (position * (SHADES - 1) as f64).round() as usize
    };
    // Few lines are opaque; many become transparent.
    let alpha = (8.0 / (rows.max(1) as f64).sqrt()).clamp(0.12, 0.9);
    for (number, pair) in axes.windows(2).enumerate() {
        let mut counts: BTreeMap<(usize, i32, i32), u32> = BTreeMap::new();
        for place in 0..rows {
            if let (Some(from), Some(to)) = (pair[0].positions[place], pair[1].positions[place]) {
                let pixel = |position: f64| y_of(plot, position).round() as i32;
                *counts.entry((shade(place), pixel(from), pixel(to))).or_default() += 1;
            }
        }
        let x = [axis_x(plot, number, axes.len()), axis_x(plot, number + 1, axes.len())];
        for ((shade, from, to), count) in counts {
            let color = shade_color(theme, shade as f64 / (SHADES - 1) as f64);
            let opaque = 1.0 - (1.0 - alpha).powi(count.min(60) as i32);
            add_line(&mut mesh, pos2(x[0], from as f32), pos2(x[1], to as f32), color.gamma_multiply(opaque as f32));
        }
    }
    mesh
}

/// Viridis without the end of low contrast with the background.
fn shade_color(theme: &Theme, fraction: f64) -> Color32 {
    if theme.is_dark() { viridis(0.3 + 0.7 * fraction) } else { viridis(0.8 * fraction) }
}

/// A line one point wide.
fn add_line(mesh: &mut Mesh, from: Pos2, to: Pos2, color: Color32) {
    let across = (to - from).normalized().rot90() * 0.6;
    let first = mesh.vertices.len() as u32;
    for pos in [from - across, from + across, to - across, to + across] {
        mesh.vertices.push(Vertex { pos, uv: WHITE_UV, color });
    }
    mesh.add_triangle(first, first + 1, first + 2);
    mesh.add_triangle(first + 1, first + 2, first + 3);
}
