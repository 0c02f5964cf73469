//! State of the lane of the calibration parameters: closed or open rows, and the stretch that is selected on them.

use std::sync::Arc;

use egui::{PointerButton, Rangef, Rect, Response, Role, Stroke, Ui, WidgetInfo};

use super::determinations::{self, LevelMap};
use super::lanes::{self, Lane};
use super::stretch::TimelineStretch;
use super::transport;
use crate::gui::PanelContext;
use crate::gui::derived::flight::DeterminationHistory;
use crate::gui::plot::PlotArea;
use crate::observability::Determination;

#[derive(Debug, Default)]
pub(super) struct ParametersLane {
    /// True if the rows are open; the lanes of single values are hidden then.
    pub(super) open: bool,
    levels: LevelMap,
    /// Rectangle of the open rows in the last frame.
    pub(super) rows_rect: Option<Rect>,
    /// Stretch that was selected on the rows.
    brush_ns: Option<(i64, i64)>,
    stretch: Option<TimelineStretch>,
}

/// Verdicts of the selected run over time.
pub(super) fn history(ui: &Ui, ctx: &PanelContext<'_>) -> Option<Arc<DeterminationHistory>> {
    Some(ctx.flight(ui, ctx.selected_run()?).history)
}

impl ParametersLane {
    /// Draws the map of the parameters, with names and legend if its rows are open; a click on its name opens them.
    pub(super) fn ui(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>, area: PlotArea, label_rect: Rect) {
        let theme = *ctx.theme;
        let Some((run, history)) = ctx.selected_run().zip(history(ui, ctx)) else { return };
        self.levels.update(&area, run.id, &history);
        let painter = ui.painter_at(area.rect);
        let (mut rows, mut heading) = (area.rect, label_rect);
        if self.open {
            let bottom = area.rect.top() + determinations::HEADING_HEIGHT;
            (rows, heading) = (area.rect.with_min_y(bottom), label_rect.with_max_y(bottom));
            let redundant = history.parameters.iter().any(|it| it.verdicts.last() == Some(&Determination::Redundant));
            determinations::legend(&painter, &theme, area.rect.with_max_y(bottom), redundant);
            determinations::labels_ui(ui, ctx, label_rect.with_min_y(bottom), &history);
            self.rows_rect = Some(rows);
        }
        determinations::paint(&painter, &theme, rows, &self.levels);
        let (sense, role) = ctx.presentation.clickable(Role::Label);
        let response = ui.interact(heading, ui.unique_id().with("parameters over time"), sense);
        let open = self.open;
        let mark = match (ctx.presentation.is_figure(), open) {
            (true, _) => "",
            (false, true) => "⏷ ",
            (false, false) => "⏵ ",
        };
        let name = format!("{mark}{}", Lane::Parameters.name(ctx));
        lanes::label(&ui.painter_at(heading), &theme, heading, &name, None, theme.text_weak);
        response.widget_info(|| WidgetInfo::selected(role, true, open, "Parameters over time"));
        if response.clicked() {
            (self.open, self.brush_ns) = (!open, None);
            ui.ctx().request_repaint();
        }
        response.on_hover_text(Lane::Parameters.meaning());
    }

    /// A drag on the open rows selects a stretch.
    pub(super) fn brush(&mut self, ui: &Ui, ctx: &PanelContext<'_>, area: &PlotArea, response: &Response) {
        let shift = ui.input(|input| input.modifiers.shift);
        let origin = ui.input(|input| input.pointer.press_origin());
        let (Some(origin), Some(pointer)) = (origin, response.interact_pointer_pos()) else { return };
        if response.dragged_by(PointerButton::Primary) && !shift {
            let stamp_at = |x: f32| area.stamp_ns_at(x).clamp(0, ctx.recording.duration_ns.max(0));
            let (begin_ns, end_ns) = (stamp_at(origin.x), stamp_at(pointer.x));
            self.brush_ns = (begin_ns != end_ns).then_some((begin_ns.min(end_ns), begin_ns.max(end_ns)));
        }
    }

    /// Draws the selected stretch, and its table when the button is released.
    pub(super) fn stretch_ui(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>, area: &PlotArea) {
        let (Some(range_ns), Some(rows)) = (self.brush_ns, self.rows_rect) else { return };
        let columns = Rangef::new(area.x(range_ns.0), area.x(range_ns.1)).intersection(rows.x_range());
        if columns.span() > 0.0 {
            let (painter, accent) = (ui.painter_at(rows), ctx.theme.accent);
            painter.rect_filled(Rect::from_x_y_ranges(columns, rows.y_range()), 0.0, accent.gamma_multiply(0.2));
            for x in [columns.min, columns.max] {
                painter.vline(x, rows.y_range(), Stroke::new(1.5, accent));
            }
        }
        if ui.input(|input| input.pointer.primary_down()) && self.stretch.is_none() {
            return;
        }
        let Some((run, history)) = ctx.selected_run().zip(history(ui, ctx)) else { return };
        if !self.stretch.as_ref().is_some_and(|known| known.is_of(run, range_ns)) {
            self.stretch = TimelineStretch::read(run, &history, range_ns, &ctx.recording.rig.joint_names());
        }
        let top = area.rect.top() - transport::HEIGHT;
        let open = self.stretch.as_ref().is_some_and(|it| it.window_ui(ui.ctx(), ctx, top, columns.center()));
        if !open {
            (self.brush_ns, self.stretch) = (None, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::gui::rendering::headless::{HeadlessOptions, draw};
    use crate::gui::samples::{sample_images, sample_recording};
    use crate::gui::tests::{keep_screenshot, with_context};
    use crate::gui::theme::{Theme, ThemeName};
    use crate::gui::timeline::TimelinePanel;
    use crate::gui::{Panel as _, Selection};
    use crate::text::Named as _;

    #[test]
    fn open_rows_and_a_selected_stretch_are_drawn() {
        let recording = sample_recording();
        let end_ns = recording.last_stamp_ns();
        for (name, size_px) in [(ThemeName::Dark, [1920, 700]), (ThemeName::Light, [1366, 600])] {
            let options = HeadlessOptions { size_px, pixels_per_point: 1.0, theme: name };
            let theme = Theme::of(name);
            let screenshot = |brush_ns: Option<(i64, i64)>| {
                let mut panel = TimelinePanel::default();
                (panel.parameters.open, panel.parameters.brush_ns) = (true, brush_ns);
                let screenshot = draw(options, |ui| {
                    theme.apply(ui.ctx());
                    let (mut images, mut selection) = (sample_images(), Selection::default());
                    with_context(&recording, end_ns, &mut images, &mut selection, &theme, |ctx| panel.ui(ui, ctx));
                });
                let brushed = if brush_ns.is_some() { "-stretch" } else { "" };
                keep_screenshot(&format!("timeline-parameters-{}{brushed}", name.name()), &screenshot);
                screenshot
            };
            assert!(screenshot(None) != screenshot(Some((end_ns / 2, end_ns))), "the stretch is shown");
        }
    }
}
