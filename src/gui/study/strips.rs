//! Rows of points over one horizontal axis of values, a row per group.

use egui::{Align2, Painter, Pos2, Rect, Role, ScrollArea, Sense, Stroke, Ui, WidgetInfo, pos2, vec2};

use super::context::StudyContext;
use super::points::Points;
use crate::gui::plot::ValueAxis;
use crate::gui::theme::{Theme, label_font, number_font};
use crate::gui::units::significant;
use crate::gui::widgets::describe;
use crate::study::view::Spread;

/// Minimum and maximum height of a strip in points.
const STRIP: [f32; 2] = [26.0, 120.0];
/// Height in points of the axis with its ticks and title.
const AXIS: f32 = 30.0;
/// Width in points of a column of data points.
const BIN: f32 = 3.0;

/// The values of one group.
#[derive(Clone, Debug, Default)]
pub(super) struct StripPlot {
    pub(super) name: String,
    /// Lines of text at the right of the strip.
    pub(super) notes: Vec<String>,
    /// Tooltip of the notes.
    pub(super) hover: String,
    /// Rows with their values.
    pub(super) points: Vec<(usize, f64)>,
    /// Quantiles of the points.
    pub(super) spread: Option<Spread>,
    /// Lower end, middle and upper end of an interval.
    pub(super) interval: Option<[f64; 3]>,
    pub(super) color: usize,
}

/// Inputs of a drawn plot; equal keys have equal points.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    generation: u64,
    origin: Pos2,
    size: egui::Vec2,
    theme: crate::gui::theme::ThemeName,
}

/// A plot of strips with its cached points.
#[derive(Debug, Default)]
pub(super) struct StripsPlot {
    key: Option<Key>,
    points: Vec<Points>,
}

/// Parts of a plot other than its strips.
pub(super) struct StripsFrame<'a> {
    /// Name for screen readers.
    pub(super) name: &'a str,
    /// Title of the axis, with its unit.
    pub(super) title: &'a str,
    /// Unit of values in tooltips, with its leading space.
    pub(super) unit: &'a str,
    pub(super) axis: ValueAxis,
    /// True if zero is marked.
    pub(super) zero: bool,
}

impl StripsPlot {
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        ctx: &mut StudyContext<'_>,
        strips: &[StripPlot],
        frame: &StripsFrame<'_>,
    ) {
        let theme = *ctx.theme;
        let (width, height) = (ui.available_width(), ui.available_height());
        let each = ((height - AXIS) / strips.len().max(1) as f32).clamp(STRIP[0], STRIP[1]);
        let list = (each * strips.len() as f32).min((height - AXIS).max(STRIP[0]));
        let measure = |text: &str, number: bool| {
            let font = if number { number_font() } else { label_font() };
            ui.painter().layout_no_wrap(text.to_owned(), font, theme.text).size().x
        };
        let names = strips.iter().map(|strip| measure(&strip.name, false)).fold(20.0, f32::max);
        let notes = strips.iter().flat_map(|strip| &strip.notes).map(|note| measure(note, true)).fold(0.0, f32::max);
        let (left, right) = ((names + 8.0).min(0.3 * width), (notes + 12.0).min(0.4 * width));
        let columns = [left, (width - left - right).max(20.0), right];
        let scrolled = ScrollArea::vertical().id_salt(frame.name).max_height(list).auto_shrink([false, true]);
        let shown = scrolled.show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 0.0;
            let (_, rect) = ui.allocate_space(vec2(width, each * strips.len() as f32));
            self.strips_ui(ui, ctx, strips, frame, rect, columns);
        });
        let x = shown.inner_rect.left() + left;
        let (_, below) = ui.allocate_space(vec2(width, AXIS));
        let plot = Rect::from_x_y_ranges(x..=x + columns[1], below.y_range());
        axis_ui(ui.painter(), &theme, plot, frame);
    }

    fn strips_ui(
        &mut self,
        ui: &Ui,
        ctx: &mut StudyContext<'_>,
        strips: &[StripPlot],
        frame: &StripsFrame<'_>,
        rect: Rect,
        [left, width, right]: [f32; 3],
    ) {
        let theme = *ctx.theme;
        let painter = ui.painter_at(rect.intersect(ui.clip_rect()));
        let each = rect.height() / strips.len().max(1) as f32;
        let row = |number: usize| {
            let top = rect.top() + each * number as f32;
            Rect::from_x_y_ranges(rect.left() + left..=rect.left() + left + width, top..=top + each)
        };
        let whole = Rect::from_x_y_ranges(row(0).x_range(), rect.y_range());
        painter.rect_filled(whole, 0.0, theme.plot_background);
        let x = |value: f64| whole.left() + frame.axis.position(value) as f32 * whole.width();
        for mark in frame.axis.marks((width / 60.0) as usize) {
            painter.vline(x(mark).round() + 0.5, whole.y_range(), Stroke::new(1.0, theme.grid));
        }
        let key = Key { generation: ctx.model.generation, origin: rect.min, size: rect.size(), theme: theme.name };
        if self.key != Some(key) {
            self.key = Some(key);
            let points = |(number, strip): (usize, &StripPlot)| {
                let color = theme.run(strip.color).color.gamma_multiply(0.8);
                Points::new(swarm(&strip.points, row(number), &frame.axis), color)
            };
            self.points = strips.iter().enumerate().map(points).collect();
        }
        for (number, strip) in strips.iter().enumerate() {
            let place = row(number);
            painter.hline(rect.x_range(), place.bottom(), Stroke::new(1.0, theme.grid));
            if let Some(spread) = &strip.spread {
                let quartiles = Rect::from_x_y_ranges(x(spread.q1)..=x(spread.q3), place.shrink(2.0).y_range());
                painter.rect_filled(quartiles, 0.0, theme.run(strip.color).color.gamma_multiply(0.16));
            }
            if let Some(points) = self.points.get(number) {
                points.paint(&painter);
            }
            if let Some(spread) = &strip.spread {
                painter.vline(x(spread.median), place.shrink(2.0).y_range(), Stroke::new(2.0, theme.text_strong));
            }
            interval_ui(&painter, &theme, strip, place, x);
            texts_ui(ui, &theme, strip, place, [rect.left(), rect.left() + left + width + 8.0], right);
        }
        if frame.zero {
            painter.vline(x(0.0), whole.y_range(), Stroke::new(1.0, theme.text_weak));
        }
        self.pointer_ui(ui, ctx, strips, frame, whole, &painter);
    }

    fn pointer_ui(
        &self,
        ui: &Ui,
        ctx: &mut StudyContext<'_>,
        strips: &[StripPlot],
        frame: &StripsFrame<'_>,
        whole: Rect,
        painter: &Painter,
    ) {
        let (sense, role) =
            if ctx.presentation.is_figure() { (Sense::hover(), Role::Image) } else { (Sense::click(), Role::Image) };
        let response = ui.interact(whole.intersect(ui.clip_rect()), ui.unique_id().with((frame.name, "points")), sense);
        response.widget_info(|| WidgetInfo::labeled(role, true, frame.name));
        let values: Vec<String> =
            strips.iter().map(|strip| format!("{}: {}", strip.name, strip.notes.join(", "))).collect();
        describe(&response, &values.join("; "));
        if let Some(row) = ctx.pointed {
            self.points.iter().for_each(|points| points.mark(painter, row, ctx.theme.text_strong));
        }
        let Some(pointer) = response.hover_pos().filter(|_| !ctx.presentation.is_figure()) else { return };
        let found = self.points.iter().enumerate().filter_map(|(strip, points)| Some((strip, points.at(pointer)?)));
        let Some((strip, (row, _))) = found.min_by(|(_, (_, a)), (_, (_, b))| a.total_cmp(b)) else { return };
        let value = strips[strip].points.iter().find(|(of, _)| *of == row).map(|(_, value)| *value);
        let value = value.map(|value| format!("{}{}", significant(value), frame.unit)).unwrap_or_default();
        ctx.point_at(ui, &response, row, &value);
    }
}

#[cfg(test)]
impl StripsPlot {
    pub(super) fn places(&self) -> Vec<(Pos2, usize)> {
        self.points.iter().flat_map(|points| points.places().iter().copied()).collect()
    }
}

/// Points of a strip at their values; points in the same column of pixels are spread vertically, closer together in a
/// full column, so that all fit.
pub(super) fn swarm(points: &[(usize, f64)], place: Rect, axis: &ValueAxis) -> Vec<(Pos2, usize)> {
    let place = place.shrink2(vec2(0.0, 4.0));
    let mut order: Vec<(usize, f64)> = points.to_vec();
    order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let x = |value: f64| place.left() + axis.position(value) as f32 * place.width();
    let bin = |value: f64| ((x(value) - place.left()) / BIN).floor() as i64;
    let mut placed = Vec::with_capacity(order.len());
    for column in order.chunk_by(|a, b| bin(a.1) == bin(b.1)) {
        let step = (place.height() / column.len() as f32).min(BIN + 0.5);
        for (number, (row, value)) in column.iter().enumerate() {
            // 0, +1, −1, +2, −2, …
            let half = number.div_ceil(2) as f32;
            let side = if number % 2 == 0 { -half } else { half };
            placed.push((pos2(x(*value), place.center().y + side * step), *row));
        }
    }
    placed
}

/// Paints the interval of a strip as a bar with a dot, with a light outline so that it stays visible over points.
fn interval_ui(painter: &Painter, theme: &Theme, strip: &StripPlot, place: Rect, x: impl Fn(f64) -> f32) {
    let Some([low, middle, high]) = strip.interval else { return };
    let color = if strip.points.is_empty() { theme.run(strip.color).color } else { theme.text_strong };
    let y = place.center().y;
    let ends = [x(low), x(high)];
    for (width, color) in [(5.0, theme.plot_background), (2.5, color)] {
        painter.hline(ends[0]..=ends[1], y, Stroke::new(width, color));
        for end in ends {
            painter.vline(end, y - 5.0..=y + 5.0, Stroke::new(width, color));
        }
    }
    painter.circle(pos2(x(middle), y), 4.5, color, Stroke::new(1.5, theme.plot_background));
}

/// Draws name and notes of a strip at its left and right.
fn texts_ui(ui: &Ui, theme: &Theme, strip: &StripPlot, place: Rect, [left, right]: [f32; 2], width: f32) {
    let clip = ui.clip_rect();
    let name_place = Rect::from_x_y_ranges(left..=place.left() - 4.0, place.y_range());
    let painter = ui.painter_at(name_place.intersect(clip));
    painter.text(name_place.left_center(), Align2::LEFT_CENTER, &strip.name, label_font(), theme.text);
    let notes_place = Rect::from_x_y_ranges(right..=right + width, place.y_range());
    let painter = ui.painter_at(notes_place.intersect(clip));
    let room = ((place.height() - 2.0) / 13.0).floor().max(1.0) as usize;
    let notes = &strip.notes[..strip.notes.len().min(room)];
    for (number, note) in notes.iter().enumerate() {
        let y = place.center().y + 13.0 * (number as f32 - 0.5 * (notes.len() as f32 - 1.0));
        let color = if number == 0 { theme.text_strong } else { theme.text_weak };
        painter.text(pos2(right, y), Align2::LEFT_CENTER, note, number_font(), color);
    }
    for (part, place) in [("name", name_place), ("notes", notes_place)] {
        let response = ui.interact(place.intersect(clip), ui.unique_id().with((part, &strip.name)), Sense::hover());
        let text = if part == "name" { strip.name.clone() } else { strip.notes.join(", ") };
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &text));
        let hover = format!("{}\n{}\n{}", strip.name, strip.notes.join("\n"), strip.hover);
        response.on_hover_text(hover.trim_end());
    }
}

/// Draws ticks with their values, and the title.
pub(super) fn axis_ui(painter: &Painter, theme: &Theme, place: Rect, frame: &StripsFrame<'_>) {
    let mut free = f32::NEG_INFINITY;
    for mark in frame.axis.marks((place.width() / 60.0) as usize) {
        let x = place.left() + frame.axis.position(mark) as f32 * place.width();
        let galley = painter.layout_no_wrap(significant(mark), number_font(), theme.text_weak);
        let at = pos2(x - 0.5 * galley.size().x, place.top() + 1.0);
        if at.x < free {
            continue;
        }
        free = at.x + galley.size().x + 6.0;
        painter.galley(at, galley, theme.text_weak);
    }
    let scale = if frame.axis.logarithmic { ", logarithmic" } else { "" };
    let title = format!("{}{scale}", frame.title);
    painter.text(place.center_bottom(), Align2::CENTER_BOTTOM, title, label_font(), theme.text);
}
