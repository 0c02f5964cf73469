//! Curves of a planned motion: one plot per joint, per axis of the vehicle and for the heading, whose points are dragged.

use egui::epaint::PathStroke;
use egui::{
    Align2, EventFilter, Key, Modifiers, PointerButton, Pos2, Rect, Response, Role, Sense, Shape, Stroke, Ui,
    WidgetInfo, pos2, vec2,
};

use super::edited::EditedMotion;
use crate::geometry::ns_from_seconds;
use crate::gui::PanelContext;
use crate::gui::plot::{
    PlotArea, TICKS_ONLY, TIME_GUTTER, paint_ground, paint_hatch, paint_time_axis, paint_value_axis, within_gutters,
};
use crate::gui::theme::{CURVE_WIDTH, label_font};
use crate::gui::units::fixed;
use crate::gui::widgets::describe;
use crate::observability::laboratory::{MotionLimits, Situation};
use crate::simulation::MotionSplines;

/// Smallest and largest height of a plot with its gutter, in points.
const ROW_HEIGHTS: [f32; 2] = [50.0, 110.0];
/// Space above and below the limits, as a ratio of the range between them.
const MARGIN: f64 = 0.12;
/// Samples of a curve per knot interval.
const SAMPLES_PER_KNOT: usize = 4;
/// Radii of a point, and of the one that is held or would be, in points.
const RADII: [f32; 2] = [2.5, 5.0];
/// Steps of a key between the limits of a channel.
const KEY_STEPS: f64 = 50.0;

/// Inputs of the curves beside the motion.
pub(super) struct CurveInputs<'a> {
    pub(super) situation: &'a Situation,
    pub(super) limits: &'a MotionLimits,
    /// Half width of a change in seconds.
    pub(super) width_s: f64,
    /// False while a search changes the motion.
    pub(super) is_editable: bool,
}

/// Name and units of a channel.
struct CurveChannel {
    index: usize,
    name: String,
    /// Shown value per stored value.
    factor: f64,
    unit: &'static str,
    decimals: usize,
}

impl CurveChannel {
    fn all(situation: &Situation) -> Vec<Self> {
        let degrees = 180.0 / std::f64::consts::PI;
        let joints = situation.joints.iter().map(|joint| (joint.name.clone(), degrees, "°", 1));
        let axes = ["forward", "left", "up"].into_iter().map(|name| (name.to_owned(), 1.0, " m", 2));
        let channels = joints.chain(axes).chain([("heading".to_owned(), degrees, "°", 1)]);
        let of = |(index, (name, factor, unit, decimals))| Self { index, name, factor, unit, decimals };
        channels.enumerate().map(of).collect()
    }

    fn shown(&self, value: f64) -> String {
        format!("{}{}", fixed(value * self.factor, self.decimals), self.unit)
    }
}

/// Points that the keyboard moves, by channel.
#[derive(Clone, Debug, Default)]
pub(super) struct Curves {
    selected: Vec<usize>,
}

impl Curves {
    /// Draws all curves into `height` points, or more if they need it.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        ctx: &PanelContext<'_>,
        edited: &mut EditedMotion,
        inputs: &CurveInputs<'_>,
        height: f32,
    ) {
        let channels = CurveChannel::all(inputs.situation);
        let free = edited.current().free_points();
        self.selected.resize(channels.len(), free.start);
        for selected in &mut self.selected {
            *selected = (*selected).clamp(free.start, free.end.max(free.start + 1) - 1);
        }
        let [least, most] = ROW_HEIGHTS;
        let row_height = ((height - TIME_GUTTER) / channels.len() as f32).clamp(least, most);
        for channel in &channels {
            let below = if channel.index + 1 == channels.len() { TIME_GUTTER } else { TICKS_ONLY };
            let size = vec2(ui.available_width(), row_height - TICKS_ONLY + below);
            let (_, outer) = ui.allocate_space(size);
            self.row_ui(ui, ctx, edited, inputs, channel, (outer, below));
        }
    }

    fn row_ui(
        &mut self,
        ui: &Ui,
        ctx: &PanelContext<'_>,
        edited: &mut EditedMotion,
        inputs: &CurveInputs<'_>,
        channel: &CurveChannel,
        (outer, below): (Rect, f32),
    ) {
        let area = area_of(edited.current(), inputs.limits, channel.index, within_gutters(outer, below));
        let sense =
            if inputs.is_editable && !ctx.presentation.is_figure() { Sense::click_and_drag() } else { Sense::hover() };
        let response = ui.interact(area.rect, ui.unique_id().with(("planned curve", channel.index)), sense);
        if sense.senses_drag() {
            self.drag_ui(ui, edited, inputs, channel, (&area, &response));
            self.keys_ui(ui, edited, inputs, channel, &response);
        }
        let motion = edited.current();
        let (low, high) = inputs.limits.range(channel.index);
        let selected = self.selected[channel.index];
        let time_s = motion.time_of_point(selected);
        let role = if sense.senses_drag() { Role::Slider } else { Role::Image };
        response.widget_info(|| WidgetInfo::labeled(role, true, format!("Motion of {}", channel.name)));
        let value = channel.shown(motion.value(channel.index, time_s, 0));
        let range = format!("limits {} to {}", channel.shown(low), channel.shown(high));
        describe(&response, &format!("{value} at {} s, {range}", fixed(time_s, 1)));
        paint_row(ui, ctx, inputs, channel, motion, (&area, below));
        let pointed = response.hover_pos().filter(|_| sense.senses_drag()).map(|at| nearest(motion, &area, at.x));
        let held = edited.held().filter(|(of, _)| *of == channel.index).map(|(_, point)| point);
        let emphasized = held.or(pointed).or_else(|| response.has_focus().then_some(selected));
        if sense.senses_drag() {
            paint_points(ui, ctx, channel, motion, &area, emphasized);
            if let Some(point) = held.or(pointed) {
                let time_s = motion.time_of_point(point);
                let value = channel.shown(motion.value(channel.index, time_s, 0));
                response.on_hover_text(format!(
                    "{} {value} at {} s, {range}\nDrag up or down: move the curve here",
                    channel.name,
                    fixed(time_s, 1)
                ));
            }
        }
    }

    /// Moves the point that is nearest in time to where the pointer was pressed.
    fn drag_ui(
        &mut self,
        ui: &Ui,
        edited: &mut EditedMotion,
        inputs: &CurveInputs<'_>,
        channel: &CurveChannel,
        (area, response): (&PlotArea, &Response),
    ) {
        let origin = ui.input(|input| input.pointer.press_origin());
        if let Some(origin) = origin.filter(|_| response.drag_started_by(PointerButton::Primary)) {
            let point = nearest(edited.current(), area, origin.x);
            self.selected[channel.index] = point;
            edited.hold((channel.index, point));
        }
        if edited.held().is_none_or(|(of, _)| of != channel.index) {
            return;
        }
        if let (Some(at), Some(origin)) = (response.interact_pointer_pos(), origin) {
            let change = area.value_at(at.y) - area.value_at(origin.y);
            edited.drag(inputs.limits, change, inputs.width_s);
        }
        if response.drag_stopped() {
            edited.release();
        }
    }

    /// Left and right select a point, up and down move the curve there.
    fn keys_ui(
        &mut self,
        ui: &Ui,
        edited: &mut EditedMotion,
        inputs: &CurveInputs<'_>,
        channel: &CurveChannel,
        response: &Response,
    ) {
        if response.clicked() {
            response.request_focus();
        }
        if !response.has_focus() {
            return;
        }
        let filter = EventFilter { horizontal_arrows: true, vertical_arrows: true, ..EventFilter::default() };
        ui.memory_mut(|memory| memory.set_focus_lock_filter(response.id, filter));
        let pressed = |key: Key| ui.input_mut(|input| input.count_and_consume_key(Modifiers::NONE, key)) as f64;
        let aside = pressed(Key::ArrowRight) - pressed(Key::ArrowLeft);
        let up = pressed(Key::ArrowUp) - pressed(Key::ArrowDown);
        let free = edited.current().free_points();
        let selected = &mut self.selected[channel.index];
        *selected = (*selected as f64 + aside).clamp(free.start as f64, free.end as f64 - 1.0) as usize;
        if up != 0.0 {
            let (low, high) = inputs.limits.range(channel.index);
            edited.hold((channel.index, *selected));
            edited.drag(inputs.limits, up * (high - low) / KEY_STEPS, inputs.width_s);
            edited.release();
        }
    }
}

/// Axes of a channel: the whole motion, and the limits with a margin.
fn area_of(motion: &MotionSplines, limits: &MotionLimits, channel: usize, rect: Rect) -> PlotArea {
    let (low, high) = limits.range(channel);
    let margin = MARGIN * (high - low);
    let values = || samples(motion).map(|time_s| motion.value(channel, time_s, 0));
    let (least, most) = (values().fold(low, f64::min), values().fold(high, f64::max));
    let end_ns = ns_from_seconds(motion.duration_s());
    PlotArea { rect, begin_ns: 0, end_ns, low: 0.0, high: 1.0, middle: None }.with_values(least - margin, most + margin)
}

fn samples(motion: &MotionSplines) -> impl Iterator<Item = f64> {
    let (duration_s, step_s) = (motion.duration_s(), motion.knot_s() / SAMPLES_PER_KNOT as f64);
    let count = (duration_s / step_s).round().max(1.0) as usize;
    (0..=count).map(move |index| duration_s * index as f64 / count as f64)
}

/// Free control value whose time is nearest to a screen x.
fn nearest(motion: &MotionSplines, area: &PlotArea, x: f32) -> usize {
    let free = motion.free_points();
    let distance = |index: &usize| (place(motion, area, 0, *index).x - x).abs();
    free.clone().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(free.start)
}

/// Place of the curve at the time of a control value.
fn place(motion: &MotionSplines, area: &PlotArea, channel: usize, index: usize) -> Pos2 {
    let time_s = motion.time_of_point(index);
    pos2(area.x(ns_from_seconds(time_s)), area.y(motion.value(channel, time_s, 0)))
}

fn paint_row(
    ui: &Ui,
    ctx: &PanelContext<'_>,
    inputs: &CurveInputs<'_>,
    channel: &CurveChannel,
    motion: &MotionSplines,
    (area, below): (&PlotArea, f32),
) {
    let theme = ctx.theme;
    let painter = ui.painter();
    paint_ground(painter, theme, area.rect);
    paint_time_axis(painter, theme, area, below);
    paint_value_axis(painter, theme, area, channel.factor);
    let (low, high) = inputs.limits.range(channel.index);
    let beyond = [(area.rect.top(), area.y(high)), (area.y(low), area.rect.bottom())];
    for (top, bottom) in beyond {
        paint_hatch(painter, Rect::from_x_y_ranges(area.rect.x_range(), top..=bottom), theme.hatch);
    }
    for limit in [low, high] {
        painter.hline(area.rect.x_range(), area.y(limit), Stroke::new(1.0, theme.outline));
    }
    let clipped = ui.painter_at(area.rect);
    let points: Vec<(Pos2, f64)> = samples(motion)
        .map(|time_s| {
            let at = pos2(area.x(ns_from_seconds(time_s)), area.y(motion.value(channel.index, time_s, 0)));
            (at, inputs.limits.load_at(motion, channel.index, time_s))
        })
        .collect();
    let curve: Vec<Pos2> = points.iter().map(|(at, _)| *at).collect();
    clipped.add(Shape::line(curve, PathStroke::new(CURVE_WIDTH, theme.text_strong)));
    let mut is_exceeded = false;
    for pair in points.windows(2).filter(|pair| pair.iter().all(|(_, load)| *load > 1.0)) {
        is_exceeded = true;
        clipped.line_segment([pair[0].0, pair[1].0], Stroke::new(2.0 * CURVE_WIDTH, theme.error));
    }
    let title = format!("{}, {}", channel.name, channel.unit.trim());
    let left = area.rect.left_top() + vec2(4.0, 1.0);
    let drawn = clipped.text(left, Align2::LEFT_TOP, title, label_font(), theme.text);
    if is_exceeded {
        let left = drawn.right_top() + vec2(8.0, 0.0);
        clipped.text(left, Align2::LEFT_TOP, "✖ too fast", label_font(), theme.error);
    }
}

fn paint_points(
    ui: &Ui,
    ctx: &PanelContext<'_>,
    channel: &CurveChannel,
    motion: &MotionSplines,
    area: &PlotArea,
    emphasized: Option<usize>,
) {
    let theme = ctx.theme;
    let painter = ui.painter_at(area.rect.expand(RADII[1]));
    for index in motion.free_points() {
        let at = place(motion, area, channel.index, index);
        if emphasized == Some(index) {
            painter.circle(at, RADII[1], theme.accent, Stroke::new(1.0, theme.plot_background));
        } else {
            painter.circle_filled(at, RADII[0], theme.accent);
        }
    }
}
