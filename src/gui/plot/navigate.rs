//! Navigation in time with the pointer, the same in every plot.

use egui::{Id, PointerButton, Response, Role, Sense, Ui, WidgetInfo};

use super::PlotArea;
use crate::gui::PanelContext;
use crate::session::Command;

/// Minimum visible time range.
const MIN_VISIBLE_NS: i64 = 200_000_000;

/// The time range of all plots: the zoomed range, or the whole log.
pub(crate) fn visible_range(ctx: &PanelContext<'_>) -> (i64, i64) {
    let whole = (0, ctx.recording.duration_ns.max(1));
    ctx.selection.visible_ns.filter(|(begin, end)| begin < end).unwrap_or(whole)
}

/// The effect of a click on a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clicks {
    /// It moves the cursor there.
    Seek,
    /// It selects the plot; dragging still moves the cursor.
    Select,
}

/// In the window: moves the cursor (drag or click), zooms (wheel with Ctrl, or the wheel alone when `scroll_zooms`), pans (middle
/// button) and shows the whole log (double click).
pub(crate) fn navigate(
    ui: &Ui,
    ctx: &mut PanelContext<'_>,
    area: &PlotArea,
    id: Id,
    label: &str,
    clicks: Clicks,
    scroll_zooms: bool,
) -> Response {
    if ctx.presentation.is_figure() {
        let response = ui.interact(area.rect, id, Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, label));
        return response;
    }
    let response = ui.interact(area.rect, id, Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, label));
    if let Some(pointer) = response.interact_pointer_pos() {
        let seeks = match clicks {
            Clicks::Seek => response.is_pointer_button_down_on() || response.clicked(),
            Clicks::Select => response.dragged_by(PointerButton::Primary),
        };
        let primary = ui.input(|input| {
            input.pointer.button_down(PointerButton::Primary) || input.pointer.button_released(PointerButton::Primary)
        });
        if seeks && primary && !ui.input(|input| input.modifiers.shift) {
            let stamp_ns = area.stamp_ns_at(pointer.x).clamp(0, ctx.recording.duration_ns.max(0));
            ctx.commands.push(Command::Seek { stamp_ns });
        }
    }
    let (begin_ns, end_ns) = (area.begin_ns, area.end_ns);
    if response.dragged_by(PointerButton::Middle) {
        let shift_ns = area.stamp_ns_at(area.rect.left() + response.drag_delta().x) - begin_ns;
        show(ctx, begin_ns - shift_ns, end_ns - shift_ns);
    }
    if response.double_clicked() {
        ctx.selection.visible_ns = None;
    }
    if let Some(pointer) = response.hover_pos() {
        let zoom = ui.input(|input| {
            let pinched = f64::from(input.zoom_delta());
            if scroll_zooms && pinched == 1.0 {
                (f64::from(input.smooth_scroll_delta().y) / 200.0).exp()
            } else {
                pinched
            }
        });
        if zoom != 1.0 {
            let fixed_ns = area.stamp_ns_at(pointer.x);
            let scaled = |stamp_ns: i64| fixed_ns + ((stamp_ns - fixed_ns) as f64 / zoom).round() as i64;
            show(ctx, scaled(begin_ns), scaled(end_ns));
        }
    }
    response
}

/// Factor of one step of zooming by key.
const ZOOM_STEP: f64 = 1.5;

/// Zooms the time axis of all plots in (`closer`) or out, about the cursor.
pub(crate) fn zoom_about_cursor(ctx: &mut PanelContext<'_>, closer: bool) {
    let (begin_ns, end_ns) = visible_range(ctx);
    let fixed_ns = ctx.cursor_ns.clamp(begin_ns, end_ns);
    zoom(ctx, (begin_ns, end_ns), fixed_ns, if closer { ZOOM_STEP } else { 1.0 / ZOOM_STEP });
}

/// Zooms a time range by a factor about a stamp, which stays where it is.
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
