//! The timeline: lanes over the whole log, and the cursor of all panels.

mod csv;
mod determinations;
mod findings_lane;
mod lanes;
mod markers;
mod model;
mod pace;
mod parameters_lane;
mod stretch;
mod transport;

pub use pace::{Pace, PaceReading};
pub(crate) use transport::{SPEEDS, next_speed, toggled_loop};

use egui::{Align2, PointerButton, Rect, Response, Role, Sense, Stroke, Ui, WidgetInfo, pos2, vec2};

use self::findings_lane::FindingsLane;
use self::lanes::Lane;
use self::model::RunLanes;
use self::parameters_lane::{ParametersLane, history};
use super::events::name_of;
use super::plot::{
    Clicks, Curve, Interaction, PlotArea, Wheel, decimals_of_step, navigate, paint_ground, paint_time_labels,
    paint_times, register, ticks, visible_range,
};
use super::theme::{LANE_HEIGHT, LANE_LABEL_WIDTH, Theme, number_font};
use super::under_pointer::{Item, offer, offer_item};
use super::units::{fixed, seconds};
use super::widgets::plated_text;
use super::{Panel, PanelContext, ReadingCursor};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::session::Command;

const RULER_HEIGHT: f32 = 18.0;
/// Maximum width of the lane names in points.
const MAX_LABEL_WIDTH: f32 = 220.0;
/// Maximum height of a lane in points.
const MAX_LANE_HEIGHT: f32 = 90.0;
/// Minimum height of a lane in points.
const MIN_LANE_HEIGHT: f32 = 11.0;

#[derive(Debug, Default)]
pub struct TimelinePanel {
    /// Measured speed of the cursor.
    pub pace: Pace,
    runs: Vec<RunLanes>,
    /// Curves of the plotted lanes: rank, features, reprojection.
    curves: [Vec<Curve>; 3],
    /// Start of a range that is being selected with Shift.
    range_begin_ns: Option<i64>,
    parameters: ParametersLane,
    findings: FindingsLane,
}

impl Panel for TimelinePanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        self.runs.resize_with(ctx.recording.runs.len(), RunLanes::default);
        for (lanes, run) in self.runs.iter_mut().zip(&ctx.recording.runs) {
            lanes.read(run);
        }
        transport::ui(ui, ctx, self.pace.reading());
        let rect = ui.available_rect_before_wrap();
        self.findings.read(ctx);
        let shown = self.shown_lanes(ctx);
        let open = self.parameters.open;
        let findings_height = self.findings.height();
        let others = shown.iter().filter(|lane| **lane != Lane::Findings).count();
        let room = (rect.height() - RULER_HEIGHT - findings_height) / others as f32;
        let height = if open { LANE_HEIGHT } else { room.clamp(MIN_LANE_HEIGHT, MAX_LANE_HEIGHT) };
        let scale = lanes::scale_width(height - 2.0);
        let left = (rect.left() + self.label_width(ui, ctx) + scale).min(rect.center().x);
        let plot = Rect::from_min_max(pos2(left, rect.top()), rect.max - vec2(4.0, 0.0));
        if plot.width() < 8.0 || plot.height() < RULER_HEIGHT {
            return;
        }
        // The lanes fill the available space, so that the panel around them keeps its height.
        ui.advance_cursor_after_rect(rect);
        let (begin_ns, end_ns) = visible_range(ctx);
        let area = PlotArea { rect: plot, begin_ns, end_ns, low: 0.0, high: 1.0, middle: None };
        let theme = *ctx.theme;
        let painter = ui.painter_at(rect);
        paint_ruler(&painter, ctx, &area);

        let mut read = Vec::new();
        self.parameters.rows_rect = None;
        let first_top = plot.top() + RULER_HEIGHT + findings_height;
        let mut next_top = plot.top() + RULER_HEIGHT;
        for lane in &shown {
            let top = next_top;
            // The open rows are last and fill the room.
            let bottom = match lane {
                Lane::Findings => top + findings_height,
                Lane::Parameters if open => rect.bottom(),
                _ => top + height,
            };
            next_top = bottom;
            if bottom > rect.bottom() + 1.0 || bottom < top + 3.0 {
                break;
            }
            let lane_rect = Rect::from_min_max(pos2(plot.left(), top), pos2(plot.right(), bottom - 2.0));
            let label_rect = Rect::from_min_max(pos2(rect.left(), top), pos2(plot.left() - scale, bottom - 2.0));
            let axis = self.lane(ui, ctx, *lane, PlotArea { rect: lane_rect, ..area }, label_rect);
            read.extend(axis.map(|area| (*lane, area)));
        }
        let lane_y = |run: usize| first_top + (run as f32 + 0.5) * height - 1.0;
        paint_forks(&painter, ctx, &area, lane_y);
        paint_range(&painter, ctx, &area);
        markers::paint(&painter, &theme, &area, &ctx.playback.markers);
        if ctx.presentation.shows_cursor() {
            paint_cursor(&painter, &theme, &area, ctx.cursor_ns);
        }
        let below_ruler = PlotArea { rect: plot.with_min_y(plot.top() + RULER_HEIGHT), ..area };
        paint_times(&painter, ctx, &below_ruler);
        paint_time_labels(&painter, ctx, &area, plot.top() + 1.0, false);
        paint_interval(&painter, ctx, &area);
        for (lane, area) in read {
            lanes::read_values(&painter, ctx, lane, &area, &self.runs);
        }

        register(ui, &area, "");
        let id = ui.unique_id().with("timeline");
        let value = value_text(ctx);
        let origin = ui.input(|input| input.pointer.press_origin());
        let is_pressed = |rect: &Rect| origin.is_some_and(|origin| rect.contains(origin));
        let on_rows = self.parameters.rows_rect.filter(is_pressed);
        let is_apart = on_rows.is_some() || self.findings.rect.is_some_and(|rect| is_pressed(&rect));
        let (clicks, wheel) = (if is_apart { Clicks::Brush } else { Clicks::Scrub }, Wheel::Zooms);
        let response = navigate(ui, ctx, &area, &Interaction { id, name: "Timeline", value: &value, clicks, wheel });
        step_by_assistance(ui, ctx, &response);
        self.select_range(ui, ctx, &area, &response);
        if on_rows.is_some() {
            self.parameters.brush(ui, ctx, &area, &response);
        }
        self.findings.clicks_ui(ui, ctx, &area);
        self.parameters.stretch_ui(ui, ctx, &area);
        self.hover(ui, ctx, &area, response);
    }
}

impl TimelinePanel {
    /// Height in points of the transport and of all lanes: the lanes of runs and trajectories, and either the lanes of
    /// single values or the open rows of the parameters.
    pub(super) fn wanted_height(&self, ui: &Ui, ctx: &PanelContext<'_>) -> f32 {
        let lanes = ctx.recording.runs.len() + ctx.recording.trajectories.len();
        let below = if self.parameters.open {
            let rows = history(ui, ctx).map_or(0, |history| history.parameters.len());
            LANE_HEIGHT * 2.0 + determinations::HEADING_HEIGHT + determinations::ROW_HEIGHT * rows as f32
        } else {
            LANE_HEIGHT * 8.0
        };
        transport::HEIGHT + RULER_HEIGHT + self.findings.height() + LANE_HEIGHT * lanes as f32 + below + 10.0
    }

    /// True if the rows of the parameters are open.
    pub(super) fn has_open_parameters(&self) -> bool {
        self.parameters.open
    }

    fn shown_lanes(&self, ctx: &PanelContext<'_>) -> Vec<Lane> {
        let breaks = !ctx.playback.breakpoints.list().is_empty();
        let values = [Lane::Rank, Lane::Features, Lane::Reprojection, Lane::Outliers, Lane::Warnings];
        let values = values.into_iter().filter(|_| !self.parameters.open);
        let findings = (self.findings.count() > 0).then_some(Lane::Findings);
        findings
            .into_iter()
            .chain((0..self.runs.len()).map(Lane::Run))
            .chain((0..ctx.recording.trajectories.len()).map(Lane::Trajectory))
            .chain(breaks.then_some(Lane::Breakpoints))
            .chain([Lane::Events])
            .chain(values)
            .chain([Lane::Parameters])
            .collect()
    }

    /// Width in points of the lane names, large enough for the names of the runs.
    fn label_width(&self, ui: &Ui, ctx: &PanelContext<'_>) -> f32 {
        const MARGIN: f32 = 10.0;
        let width = |lane: Lane| lanes::name_width(ui, ctx, lane) + MARGIN;
        let trajectories = (0..ctx.recording.trajectories.len()).map(Lane::Trajectory);
        let lanes = (0..self.runs.len()).map(Lane::Run).chain(trajectories).map(width);
        let widest = lanes.fold(LANE_LABEL_WIDTH, f32::max);
        let parameters = history(ui, ctx).filter(|_| self.parameters.open);
        let names = parameters.map_or(0.0, |history| determinations::label_width(ui, ctx, &history));
        widest.max(names).min(MAX_LABEL_WIDTH)
    }

    /// Draws a lane; returns its area with the value axis if it has curves.
    fn lane(
        &mut self,
        ui: &Ui,
        ctx: &mut PanelContext<'_>,
        lane: Lane,
        area: PlotArea,
        label_rect: Rect,
    ) -> Option<PlotArea> {
        let theme = *ctx.theme;
        if lane == Lane::Parameters {
            paint_ground(&ui.painter_at(area.rect), &theme, area.rect);
            self.parameters.ui(ui, ctx, area, label_rect);
            return None;
        }
        let painter = ui.painter_at(area.rect.union(label_rect));
        let mut axis = None;
        let inner = painter.with_clip_rect(area.rect.intersect(painter.clip_rect()));
        paint_ground(&painter, &theme, area.rect);
        match lane {
            Lane::Run(run) => {
                if let Some(lanes) = self.runs.get(run) {
                    lanes::run(&inner, &theme, &area, lanes, theme.run(run));
                }
            }
            Lane::Trajectory(number) => {
                if let Some(lane) = ctx.recording.trajectories.get(number) {
                    lanes::trajectory(&inner, &area, &lane.track, theme.trajectory(number));
                }
            }
            Lane::Findings => self.findings.paint(&inner, &theme, &area),
            Lane::Breakpoints => lanes::breakpoints(&inner, &theme, &area, ctx),
            Lane::Events => lanes::events(&inner, &theme, &area, &self.runs),
            Lane::Rank | Lane::Features | Lane::Reprojection => {
                let curves = match lane {
                    Lane::Rank => &mut self.curves[0],
                    Lane::Features => &mut self.curves[1],
                    _ => &mut self.curves[2],
                };
                axis = lanes::plotted_values(&painter, &theme, &area, lane, &self.runs, curves);
            }
            Lane::Outliers => lanes::outliers(&inner, &theme, &area, &self.runs),
            // Has returned above: it draws its own label.
            Lane::Parameters => {}
            Lane::Warnings => {
                let stamps_ns: Vec<i64> = ctx.recording.warnings.iter().map(|warning| warning.stamp_ns).collect();
                lanes::warnings(&inner, &theme, &area, &stamps_ns, &self.runs);
            }
        }
        let selected = ctx.run_number();
        let value = match lane {
            Lane::Findings => Some(self.findings.count().to_string()),
            _ => self.runs.get(selected).and_then(|run| lane.value(run, ctx.cursor_ns)),
        };
        let color = match lane {
            Lane::Run(run) => theme.run(run).color,
            Lane::Trajectory(number) => theme.trajectory(number).color,
            _ => theme.text_weak,
        };
        lanes::label(&painter, &theme, label_rect, &lane.name(ctx), value.clone(), color);
        let label = ui.interact(label_rect, ui.unique_id().with(("lane", lane.name(ctx))), Sense::hover());
        if let Lane::Run(run) = lane
            && label.contains_pointer()
        {
            offer_item(ui, Item::Run(run));
        }
        let text = value.map_or_else(|| lane.name(ctx), |value| format!("{} {value}", lane.name(ctx)));
        label.widget_info(|| WidgetInfo::labeled(Role::Label, true, &text));
        label.on_hover_text(format!("{}\n{}", lane.name(ctx), lane.meaning()));
        axis
    }

    /// Shift and drag sets the loop range.
    fn select_range(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>, area: &PlotArea, response: &Response) {
        let shift = ui.input(|input| input.modifiers.shift);
        let Some(pointer) = response.interact_pointer_pos() else {
            self.range_begin_ns = None;
            return;
        };
        let stamp_at = |x: f32| area.stamp_ns_at(x).clamp(0, ctx.recording.duration_ns.max(0));
        let stamp_ns = stamp_at(pointer.x);
        if response.drag_started_by(PointerButton::Primary) && shift {
            // A drag is recognized some points after the press.
            self.range_begin_ns = ui.input(|input| input.pointer.press_origin()).map(|origin| stamp_at(origin.x));
        }
        if let Some(begin_ns) = self.range_begin_ns.filter(|begin_ns| *begin_ns != stamp_ns) {
            ctx.commands.push(Command::SetLoop(Some((begin_ns.min(stamp_ns), begin_ns.max(stamp_ns)))));
        }
    }

    /// Tooltip of the step or event under the pointer.
    fn hover(&self, ui: &Ui, ctx: &PanelContext<'_>, area: &PlotArea, response: Response) {
        const REACH: f32 = 5.0;
        let Some(pointer) = response.hover_pos() else { return };
        let stamp_ns = area.stamp_ns_at(pointer.x);
        let reach_ns = area.stamp_ns_at(pointer.x + REACH) - stamp_ns;
        let near = |other_ns: i64| (other_ns - stamp_ns).abs() <= reach_ns;
        let mut text = format!("{} s", seconds(stamp_ns));
        if let Some(marker) = markers::at(area, &ctx.playback.markers, pointer.x) {
            offer_item(ui, Item::Marker(marker.stamp_ns));
            text.extend(["\nmarker ", marker.name.as_str(), " ", &seconds(marker.stamp_ns), " s"]);
        }
        if let (Some(rows), Some(history)) = (self.parameters.rows_rect, history(ui, ctx)) {
            let row = determinations::row_under(rows, pointer.y, history.parameters.len());
            let parameter = row.and_then(|row| history.parameters.get(row));
            if let Some(parameter) = parameter {
                offer_item(ui, Item::Parameter(parameter.parameter));
            }
            let line = row.and_then(|row| determinations::hover_text(ctx, &history, row, stamp_ns));
            text.extend(line.map(|line| format!("\n{line}")));
        }
        let mut lines = 0;
        let mut push_line = |line: String| {
            lines += 1;
            if lines <= 8 {
                text.push('\n');
                text.push_str(&line);
            }
        };
        for (run, lanes) in ctx.recording.runs.iter().zip(&self.runs) {
            for event in lanes.events.iter().filter(|event| near(event.stamp_ns)) {
                let message = run.steps.get(event.step).and_then(|step| step.report.events.get(event.event));
                let message = message.map_or("", |event| event.message.as_str());
                push_line(format!("{}: {}, {message}", run.spec.label, name_of(event.kind)));
            }
            for (_, step) in lanes.warnings.iter().filter(|(stamp_ns, _)| near(*stamp_ns)) {
                for warning in run.steps.get(*step).iter().flat_map(|step| &step.report.warnings) {
                    push_line(format!("{}: {warning}", run.spec.label));
                }
            }
        }
        for warning in ctx.recording.warnings.iter().filter(|warning| near(warning.stamp_ns)) {
            push_line(warning.message.clone());
        }
        offer(ui, text.clone());
        response.on_hover_text_at_pointer(text);
    }
}

/// Position of the cursor, the frame there, and the visible range.
fn value_text(ctx: &PanelContext<'_>) -> String {
    let step = ctx.selected_step().map(|(_, step)| step);
    let cursor = Some(format!("cursor {} s", seconds(ctx.cursor_ns)));
    let frame = step.map(|step| format!("frame {}", step.report.frame_name()));
    let range = ctx.selection.visible_ns;
    let visible = range.map(|(begin, end)| format!("visible {} to {} s", seconds(begin), seconds(end)));
    [cursor, frame, visible].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Exposes the timeline to a screen reader as a slider: its value is the cursor in seconds, its step one frame.
fn step_by_assistance(ui: &Ui, ctx: &mut PanelContext<'_>, response: &Response) {
    use egui::accesskit::{Action, ActionData};

    response.ctx.accesskit_node_builder(response.id, |node| {
        node.set_numeric_value(seconds_from_ns(ctx.cursor_ns));
        node.set_min_numeric_value(0.0);
        node.set_max_numeric_value(seconds_from_ns(ctx.recording.duration_ns));
        for action in [Action::Increment, Action::Decrement, Action::SetValue] {
            node.add_action(action);
        }
    });
    ui.input(|input| {
        for (action, frames) in [(Action::Increment, 1), (Action::Decrement, -1)] {
            let count = input.num_accesskit_action_requests(response.id, action);
            if let Some(count) = i64::try_from(count).ok().filter(|count| *count > 0) {
                ctx.commands.push(Command::StepFrames(frames * count));
            }
        }
        for request in input.accesskit_action_requests(response.id, Action::SetValue) {
            if let Some(ActionData::NumericValue(cursor_s)) = request.data {
                ctx.commands.push(Command::Seek { stamp_ns: ns_from_seconds(cursor_s) });
            }
        }
    });
}

fn paint_range(painter: &egui::Painter, ctx: &PanelContext<'_>, area: &PlotArea) {
    if let Some((begin_ns, end_ns)) = ctx.playback.loop_range_ns {
        let rect = Rect::from_x_y_ranges(area.x(begin_ns)..=area.x(end_ns), area.rect.y_range());
        let rect = rect.intersect(area.rect);
        if rect.width() > 0.0 {
            painter.rect_filled(rect, 0.0, ctx.theme.accent.gamma_multiply(0.13));
            let edge = Stroke::new(1.0, ctx.theme.accent);
            painter.vline(rect.left(), rect.y_range(), edge);
            painter.vline(rect.right(), rect.y_range(), edge);
        }
    }
}

/// Draws the length of the interval between the reading cursors in the ruler, between their names if it fits there.
fn paint_interval(painter: &egui::Painter, ctx: &PanelContext<'_>, area: &PlotArea) {
    let reading = &ctx.selection.reading;
    let ends = ReadingCursor::ALL.map(|cursor| reading.cursor_ns(cursor).map(|stamp_ns| area.x(stamp_ns)));
    let (Some(interval_ns), [Some(a), Some(b)]) = (reading.interval_ns(), ends) else { return };
    let text = format!("Δt {} s", seconds(interval_ns));
    let galley = painter.layout_no_wrap(text, number_font(), ctx.theme.accent);
    let inside = galley.size().x + 90.0 < (b - a).abs();
    let left = if inside { 0.5 * (a + b - galley.size().x) } else { a.max(b) + 40.0 };
    let place = pos2(left.min(area.rect.right() - galley.size().x), area.rect.top());
    plated_text(painter, place, Align2::LEFT_TOP, (galley, ctx.theme.accent), (ctx.theme.surface, vec2(8.0, 0.0)));
}

/// Seconds along the upper edge, with a grid line through the lanes for each.
fn paint_ruler(painter: &egui::Painter, ctx: &PanelContext<'_>, area: &PlotArea) {
    /// Distance in points to a reading cursor, whose name replaces the label.
    const TAKEN: f32 = 58.0;
    /// Half the width of a label of a time in points.
    const HALF_LABEL: f32 = 20.0;
    let theme = ctx.theme;
    let cursors = ReadingCursor::ALL.map(|cursor| ctx.selection.reading.cursor_ns(cursor));
    let marked = markers::covered(painter, theme, area, &ctx.playback.markers);
    let taken = |x: f32| {
        cursors.iter().flatten().any(|stamp_ns| (area.x(*stamp_ns) - x).abs() < TAKEN)
            || marked.iter().any(|range| range.expand(HALF_LABEL).contains(x))
    };
    let (begin_s, end_s) = (seconds_from_ns(area.begin_ns), seconds_from_ns(area.end_ns));
    let (marks, step) = ticks(begin_s, end_s, ((area.rect.width() / 70.0) as usize).max(1));
    for mark in marks {
        let x = area.x((mark * 1e9).round() as i64).round() + 0.5;
        painter.vline(x, area.rect.top() + RULER_HEIGHT - 4.0..=area.rect.bottom(), Stroke::new(1.0, theme.grid));
        let text = format!("{} s", fixed(mark, decimals_of_step(step)));
        let align = if x + 30.0 > area.rect.right() {
            Align2::RIGHT_TOP
        } else if x - 20.0 < area.rect.left() {
            Align2::LEFT_TOP
        } else {
            Align2::CENTER_TOP
        };
        if !taken(x) {
            painter.text(pos2(x, area.rect.top()), align, text, number_font(), theme.text_weak);
        }
    }
}

/// Draws the origins of forks: the steps shared with the parent are dimmed, and a line connects both lanes.
fn paint_forks(painter: &egui::Painter, ctx: &PanelContext<'_>, area: &PlotArea, lane_y: impl Fn(usize) -> f32) {
    let runs = &ctx.recording.runs;
    for (number, run) in runs.iter().enumerate() {
        let Some(origin) = &run.origin else { continue };
        let (x, y) = (area.x(origin.stamp_ns), lane_y(number));
        let shared = Rect::from_min_max(pos2(area.rect.left(), y - 11.0), pos2(x, y + 11.0)).intersect(area.rect);
        if shared.is_positive() {
            painter.rect_filled(shared, 0.0, ctx.theme.surface.gamma_multiply(0.75));
        }
        let parent = runs.iter().position(|other| other.id == origin.parent);
        if let Some(parent) = parent.filter(|_| area.rect.x_range().contains(x)) {
            let stroke = Stroke::new(1.5, ctx.theme.run(number).color);
            painter.line_segment([pos2(x, lane_y(parent)), pos2(x, y)], stroke);
            painter.circle_filled(pos2(x, lane_y(parent)), 3.0, ctx.theme.run(parent).color);
            painter.circle_filled(pos2(x, y), 3.5, ctx.theme.run(number).color);
        }
    }
}

fn paint_cursor(painter: &egui::Painter, theme: &Theme, area: &PlotArea, cursor_ns: i64) {
    let x = area.x(cursor_ns);
    if !area.rect.x_range().expand(1.0).contains(x) {
        return;
    }
    // The head of the cursor is below the seconds and does not cover them.
    let foot = area.rect.top() + RULER_HEIGHT;
    painter.vline(x, foot - 1.0..=area.rect.bottom(), Stroke::new(1.5, theme.cursor));
    let head = vec![pos2(x - 5.0, foot - 6.0), pos2(x + 5.0, foot - 6.0), pos2(x, foot)];
    painter.add(egui::Shape::convex_polygon(head, theme.cursor, Stroke::NONE));
}
