//! Images and scenes of all runs side by side, with one common view.

use egui::{Rect, RichText, Ui, UiBuilder, pos2, vec2};

use crate::gui::image_panel::ImagePanel;
use crate::gui::scene::ScenePanel;
use crate::gui::{Panel as _, PanelContext, Selection};

/// Minimum width of a run's cell in points; below it the cells form two rows.
const MIN_CELL_WIDTH: f32 = 250.0;
const GAP: f32 = 6.0;

/// Images side by side; zoom, position and options follow the image that was changed last.
#[derive(Default)]
pub(super) struct Images {
    lead: ImagePanel,
    panels: Vec<ImagePanel>,
}

impl Images {
    pub(super) fn view_copy(&self) -> Self {
        Self { lead: self.lead.view_copy(), panels: Vec::new() }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        self.panels.resize_with(ctx.recording.runs.len(), ImagePanel::default);
        let Self { lead, panels } = self;
        each_run(ui, ctx, |ui, ctx, run| {
            let panel = &mut panels[run];
            panel.follow(lead);
            panel.ui(ui, ctx);
            if !panel.looks_like(lead) {
                *lead = panel.view_copy();
            }
        });
    }
}

/// Scenes side by side; the viewpoint follows the scene that was changed last.
#[derive(Default)]
pub(super) struct Scenes {
    lead: ScenePanel,
    panels: Vec<ScenePanel>,
}

impl Scenes {
    pub(super) fn view_copy(&self) -> Self {
        Self { lead: self.lead.view_copy(), panels: Vec::new() }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        self.panels.resize_with(ctx.recording.runs.len(), ScenePanel::default);
        let Self { lead, panels } = self;
        each_run(ui, ctx, |ui, ctx, run| {
            let label = &ctx.recording.runs[run].spec.label;
            ui.label(RichText::new(label).strong().color(ctx.theme.run(run).color));
            let panel = &mut panels[run];
            panel.follow(lead);
            panel.ui(ui, ctx);
            if !panel.looks_like(lead) {
                *lead = panel.view_copy();
            }
        });
    }
}

/// Draws each run in a cell, as if it were the shown run.
///
/// A selection in one cell applies to all cells, a selected feature only to runs on the same camera.
fn each_run(ui: &mut Ui, ctx: &mut PanelContext<'_>, mut draw: impl FnMut(&mut Ui, &mut PanelContext<'_>, usize)) {
    let all = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(all);
    let runs = &ctx.recording.runs;
    let camera_of = |run: usize| runs.get(run).map(|run| run.camera_key.as_str());
    for (run, cell) in cells(all, runs.len()).into_iter().enumerate() {
        let shown = ctx.selection.run;
        let kin = camera_of(run) == camera_of(shown);
        let feature = ctx.selection.feature.filter(|_| kin);
        // The slide applies only to the chain of the shown run.
        let slide = ctx.selection.slide.filter(|_| run == shown);
        let before = Selection { feature, run, slide, ..ctx.selection.clone() };
        let mut selection = before.clone();
        let PanelContext { recording, cursor_ns, playback, theme, presentation, .. } = *ctx;
        let (images, commands) = (&mut *ctx.images, &mut *ctx.commands);
        let own = &mut selection;
        let inner =
            &mut PanelContext { recording, cursor_ns, playback, images, selection: own, theme, presentation, commands };
        ui.push_id(run, |ui| {
            ui.scope_builder(UiBuilder::new().max_rect(cell), |ui| {
                ui.set_clip_rect(ui.clip_rect().intersect(cell));
                draw(ui, inner, run);
            });
        });
        if selection.feature != before.feature {
            (ctx.selection.feature, ctx.selection.run) = (selection.feature, run);
        }
        if selection.parameter != before.parameter {
            ctx.selection.parameter = selection.parameter;
        }
    }
}

/// Rectangles of the cells: one row if they are wide enough, else two.
fn cells(all: Rect, count: usize) -> Vec<Rect> {
    let columns = if count > 2 && all.width() < MIN_CELL_WIDTH * count as f32 { 2 } else { count.max(1) };
    let rows = count.div_ceil(columns);
    let size = vec2(
        (all.width() - GAP * (columns - 1) as f32) / columns as f32,
        (all.height() - GAP * (rows.max(1) - 1) as f32) / rows.max(1) as f32,
    );
    let place = |run: usize| {
        let (column, row) = ((run % columns) as f32, (run / columns) as f32);
        Rect::from_min_size(pos2(all.left() + column * (size.x + GAP), all.top() + row * (size.y + GAP)), size)
    };
    (0..count).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_do_not_overlap_and_stay_inside() {
        for width in [300.0, 700.0, 1600.0] {
            let all = Rect::from_min_size(pos2(10.0, 20.0), vec2(width, 400.0));
            for count in 1..=4 {
                let cells = cells(all, count);
                assert_eq!(cells.len(), count);
                for (number, cell) in cells.iter().enumerate() {
                    assert!(all.expand(0.1).contains_rect(*cell) && cell.is_positive());
                    assert!(cells[..number].iter().all(|other| !other.intersects(cell.shrink(1.0))));
                }
            }
        }
    }
}
