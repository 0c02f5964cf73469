//! Navigation in time with the pointer, the same in every plot.

use egui::{Id, PointerButton, Rangef, Rect, Response, Role, Sense, Stroke, Ui, WidgetInfo};

use super::area::PlotArea;
use crate::gui::PanelContext;
use crate::gui::widgets::describe;
use crate::session::Command;

/// Minimum visible time range.
const MIN_VISIBLE_NS: i64 = 200_000_000;
/// Minimum width of a range that is selected with the pointer, in points.
const MIN_RANGE_WIDTH: f32 = 6.0;

/// The time range of all plots: the zoomed range, or the whole log.
pub(crate) fn visible_range(ctx: &PanelContext<'_>) -> (i64, i64) {
    let whole = (0, ctx.recording.duration_ns.max(1));
    ctx.selection.visible_ns.filter(|(begin, end)| begin < end).unwrap_or(whole)
}

/// Effect of the pointer's primary button on a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clicks {
    /// A click and a drag move the cursor: the timeline.
    Scrub,
    /// A click moves the cursor, a drag selects a stretch: the parameters of the timeline.
    Brush,
    /// A click moves the cursor, a drag pans.
    Seek,
    /// A click selects the plot, a drag pans.
    Select,
}

/// Effect of the wheel on a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wheel {
    Zooms,
    /// Scrolls the list around the plot; with Ctrl it zooms.
    Scrolls,
}

impl Wheel {
    /// Scrolling in a list that is higher than its panel, else zooming.
    pub(crate) fn in_list(overflows: bool) -> Self {
        if overflows { Self::Scrolls } else { Self::Zooms }
    }
}

/// Interface of a plot to the pointer and to a screen reader.
pub(crate) struct Interaction<'a> {
    pub(crate) id: Id,
    pub(crate) name: &'a str,
    /// Shown content at the cursor, as text.
    pub(crate) value: &'a str,
    pub(crate) clicks: Clicks,
    pub(crate) wheel: Wheel,
}

/// In the window: zooms the time axis about the pointer (wheel, pinch), pans (drag, or the middle button on the
/// timeline; horizontal scrolling), zooms to a range (drag with the secondary button), shows the whole log (double
/// click) and moves the cursor.
pub(crate) fn navigate(ui: &Ui, ctx: &mut PanelContext<'_>, area: &PlotArea, plot: &Interaction<'_>) -> Response {
    let Interaction { id, name, value, clicks, wheel } = *plot;
    let figure = ctx.presentation.is_figure();
    let sense = if figure { Sense::hover() } else { Sense::click_and_drag() };
    let response = ui.interact(area.rect, id, sense);
    let role = match clicks {
        Clicks::Scrub | Clicks::Brush if !figure => Role::Slider,
        Clicks::Select if !figure => Role::Button,
        _ => Role::Image,
    };
    response.widget_info(|| WidgetInfo::labeled(role, true, name));
    describe(&response, value);
    if figure {
        return response;
    }
    move_cursor(ui, ctx, area, clicks, &response);
    let pans = matches!(clicks, Clicks::Seek | Clicks::Select) && response.dragged_by(PointerButton::Primary)
        || response.dragged_by(PointerButton::Middle);
    if pans {
        pan(ctx, area, response.drag_delta().x);
    }
    if let Some((range, complete)) = dragged_range(ui, area.rect, &response) {
        if complete {
            show(ctx, area.stamp_ns_at(range.min), area.stamp_ns_at(range.max));
        } else {
            paint_range(ui, ctx, Rect::from_x_y_ranges(range, area.rect.y_range()));
        }
    }
    if response.double_clicked() {
        ctx.selection.visible_ns = None;
    }
    if let Some(pointer) = response.hover_pos() {
        let Scroll { zoom: factor, pan_x } = Scroll::read(ui, wheel);
        if factor != 1.0 {
            zoom(ctx, (area.begin_ns, area.end_ns), area.stamp_ns_at(pointer.x), factor);
        } else if pan_x != 0.0 {
            pan(ctx, area, pan_x);
        }
    }
    response
}

/// Clicks, and drags on the timeline, move the cursor to the pointer.
fn move_cursor(ui: &Ui, ctx: &mut PanelContext<'_>, area: &PlotArea, clicks: Clicks, response: &Response) {
    let Some(pointer) = response.interact_pointer_pos() else { return };
    let seeks = match clicks {
        Clicks::Scrub => response.is_pointer_button_down_on() || response.clicked(),
        Clicks::Seek | Clicks::Brush => response.clicked(),
        Clicks::Select => false,
    };
    let primary = ui.input(|input| {
        input.pointer.button_down(PointerButton::Primary) || input.pointer.button_released(PointerButton::Primary)
    });
    if seeks && primary && !ui.input(|input| input.modifiers.shift) {
        let stamp_ns = area.stamp_ns_at(pointer.x).clamp(0, ctx.recording.duration_ns.max(0));
        ctx.commands.push(Command::Seek { stamp_ns });
    }
}

/// Wheel and gestures of a frame.
struct Scroll {
    /// Factor of the magnification.
    zoom: f64,
    /// Displacement to the right in points.
    pan_x: f32,
}

impl Scroll {
    fn read(ui: &Ui, wheel: Wheel) -> Self {
        ui.input(|input| {
            let (pinched, scrolled) = (f64::from(input.zoom_delta()), input.smooth_scroll_delta());
            // With Alt the wheel zooms the value axis.
            let turns = wheel == Wheel::Zooms && !input.modifiers.alt;
            let turned =
                if turns && scrolled.y.abs() > scrolled.x.abs() { (f64::from(scrolled.y) / 200.0).exp() } else { 1.0 };
            Self { zoom: pinched * turned, pan_x: scrolled.x }
        })
    }
}

/// Range dragged with the secondary button; the bool is true if the button has just been released.
fn dragged_range(ui: &Ui, rect: Rect, response: &Response) -> Option<(Rangef, bool)> {
    let complete = response.drag_stopped_by(PointerButton::Secondary);
    if !complete && !response.dragged_by(PointerButton::Secondary) {
        return None;
    }
    // The origin of the press is no longer available when the button is released.
    let stored = response.id.with("range");
    let origin = ui.input(|input| input.pointer.press_origin()).map(|origin| origin.x);
    let begin = match origin {
        Some(begin) if !complete => {
            ui.data_mut(|data| data.insert_temp(stored, begin));
            begin
        }
        _ => ui.data_mut(|data| data.remove_temp::<f32>(stored))?,
    };
    let end = response.interact_pointer_pos()?.x;
    let range = Rangef::new(begin.min(end), begin.max(end)).intersection(rect.x_range());
    (range.span() >= MIN_RANGE_WIDTH).then_some((range, complete))
}

/// The range that is being selected.
fn paint_range(ui: &Ui, ctx: &PanelContext<'_>, rect: Rect) {
    let painter = ui.painter_at(rect.expand(1.0));
    painter.rect_filled(rect, 0.0, ctx.theme.accent.gamma_multiply(0.2));
    for x in [rect.left(), rect.right()] {
        painter.vline(x, rect.y_range(), Stroke::new(1.0, ctx.theme.accent));
    }
}

/// Moves the visible range with a drag of the content by `points` to the right.
fn pan(ctx: &mut PanelContext<'_>, area: &PlotArea, points: f32) {
    let shift_ns = area.stamp_ns_at(area.rect.left() + points) - area.begin_ns;
    show(ctx, area.begin_ns - shift_ns, area.end_ns - shift_ns);
}

/// Factor of one step of zooming by key.
const ZOOM_STEP: f64 = 1.5;

/// Zooms the time axis of all plots in (`closer`) or out, about the cursor.
pub(crate) fn zoom_about_cursor(ctx: &mut PanelContext<'_>, closer: bool) {
    let (begin_ns, end_ns) = visible_range(ctx);
    let fixed_ns = ctx.cursor_ns.clamp(begin_ns, end_ns);
    zoom(ctx, (begin_ns, end_ns), fixed_ns, if closer { ZOOM_STEP } else { 1.0 / ZOOM_STEP });
}

/// Zooms a time range by a factor about a fixed stamp.
fn zoom(ctx: &mut PanelContext<'_>, (begin_ns, end_ns): (i64, i64), fixed_ns: i64, factor: f64) {
    let scaled = |stamp_ns: i64| fixed_ns + ((stamp_ns - fixed_ns) as f64 / factor).round() as i64;
    show(ctx, scaled(begin_ns), scaled(end_ns));
}

/// Shows a time range, limited to the log and to the minimum range; the whole log if the range covers it.
fn show(ctx: &mut PanelContext<'_>, begin_ns: i64, end_ns: i64) {
    let whole_ns = ctx.recording.duration_ns.max(1);
    let length_ns = (end_ns - begin_ns).max(MIN_VISIBLE_NS);
    if length_ns >= whole_ns {
        ctx.selection.visible_ns = None;
    } else {
        let begin_ns = begin_ns.clamp(0, whole_ns - length_ns);
        ctx.selection.visible_ns = Some((begin_ns, begin_ns + length_ns));
    }
}
