//! Value axes with the pointer: zoom, pan, and ranges that do not follow the data.

use egui::{Align2, Rect, Role, Sense, Ui, WidgetInfo, pos2};

use super::area::PlotArea;
use super::navigate::{Interaction, Wheel};
use crate::gui::PanelContext;
use crate::gui::theme::label_font;
use crate::gui::widgets::describe;

/// Width in points of the strip to the left of a plot that reacts to the pointer.
const AXIS_WIDTH: f32 = 38.0;

/// Range of `low` and `high` in stored units, or the fixed range of the plot.
pub(crate) fn value_range_of(ctx: &PanelContext<'_>, key: &str, low: f64, high: f64) -> (f64, f64) {
    ctx.selection.reading.fixed_values.get(key).map_or((low, high), |[low, high]| (*low, *high))
}

/// In the window: zooms the value axis about the pointer (wheel over the axis, Alt and wheel over the plot), moves it
/// (drag of the axis), and lets it follow the data again (double click on the axis).
///
/// A changed range stays fixed while data and visible times change; the axis then has a mark.
pub(super) fn value_axis_ui(
    ui: &Ui,
    ctx: &mut PanelContext<'_>,
    area: &PlotArea,
    key: &str,
    plot: &Interaction<'_>,
    hovered: bool,
) {
    if key.is_empty() {
        return;
    }
    let left = area.rect.left();
    let gutter = Rect::from_x_y_ranges(left - AXIS_WIDTH..=left, area.rect.y_range());
    if ctx.selection.reading.fixed_values.contains_key(key) {
        let place = pos2(left + 2.0, area.rect.top() + 1.0);
        ui.painter().text(place, Align2::LEFT_TOP, "🔒", label_font(), ctx.theme.accent);
    }
    if ctx.presentation.is_figure() {
        return;
    }
    // The Tab key skips the axes: a window has dozens of them.
    let axis = ui.interact(gutter, plot.id.with("value axis"), Sense::CLICK | Sense::DRAG);
    axis.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Value axis"));
    describe(&axis, key);
    let mut range = [area.low, area.high];
    if axis.dragged() && axis.drag_delta().y != 0.0 {
        let shift = f64::from(axis.drag_delta().y / area.rect.height().max(1.0)) * (area.high - area.low);
        range = range.map(|value| value + shift);
    }
    // In a list the wheel alone scrolls.
    let alt = ui.input(|input| input.modifiers.alt);
    let zooms = axis.hovered() && (alt || plot.wheel == Wheel::Zooms) || hovered && alt;
    let pointer = ui.input(|input| input.pointer.hover_pos()).filter(|_| zooms);
    if let Some(pointer) = pointer {
        let scrolled = ui.input_mut(|input| std::mem::take(&mut input.smooth_scroll_delta.y));
        range = zoomed(range, area.value_at(pointer.y), (f64::from(scrolled) / 200.0).exp());
    }
    let fixed = &mut ctx.selection.reading.fixed_values;
    if axis.double_clicked() {
        fixed.remove(key);
    } else if range != [area.low, area.high] {
        fixed.insert(key.to_owned(), range);
    }
    axis.on_hover_text("Scroll: zoom the values; drag: move them; double click: automatic range");
}

/// A range that is magnified by a factor about a fixed value.
fn zoomed(range: [f64; 2], about: f64, factor: f64) -> [f64; 2] {
    let zoomed = range.map(|value| about + (value - about) / factor);
    let span = zoomed[1] - zoomed[0];
    // Beyond these bounds neighbouring values of an axis are not distinguishable.
    let valid = span.is_finite() && span > 1e-9 * about.abs().max(1e-6) && span < 1e12;
    if factor == 1.0 || !valid { range } else { zoomed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zooming_keeps_the_value_under_the_pointer_and_ends() {
        assert_eq!(zoomed([0.0, 8.0], 2.0, 2.0), [1.0, 5.0]);
        assert_eq!(zoomed([0.0, 8.0], 2.0, 1.0), [0.0, 8.0]);
        let narrow = [1.0, 1.0 + 1e-9];
        assert_eq!(zoomed(narrow, 1.0, 10.0), narrow);
        assert_eq!(zoomed([-1e11, 1e11], 0.0, 1e-3), [-1e11, 1e11]);
    }
}
