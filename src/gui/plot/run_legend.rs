//! Legend of the runs with colour and dashes, for figures; in the window the top bar shows it.

use egui::{Align2, Color32, Ui, pos2, vec2};

use super::paint_line;
use crate::gui::PanelContext;
use crate::gui::theme::{CURVE_WIDTH, RunStyle, label_font};

/// Length of a sample of a line in points.
const SAMPLE: f32 = 26.0;
const HEIGHT: f32 = 14.0;

/// Draws a sample of each run's line with its label after the other content of the row; nothing for a single run, and
/// nothing in the window.
pub(crate) fn run_legend_ui(ui: &mut Ui, ctx: &PanelContext<'_>) {
    if !ctx.presentation.is_figure() || ctx.recording.runs.len() < 2 {
        return;
    }
    for (number, run) in ctx.recording.runs.iter().enumerate() {
        entry_ui(ui, &run.spec.label, ctx.theme.run(number), ctx.theme.text);
    }
}

fn entry_ui(ui: &mut Ui, label: &str, style: RunStyle, color: Color32) {
    let galley = ui.painter().layout_no_wrap(label.to_owned(), label_font(), color);
    let (_, rect) = ui.allocate_space(vec2(SAMPLE + 6.0 + galley.size().x + 8.0, HEIGHT));
    let line = [rect.left_center(), pos2(rect.left() + SAMPLE, rect.center().y)];
    paint_line(ui.painter(), &line, style, CURVE_WIDTH + 0.5);
    let place = Align2::LEFT_CENTER.anchor_size(line[1] + vec2(6.0, 0.0), galley.size());
    ui.painter().galley(place.min, galley, color);
}
