//! Images and scenes of all runs side by side, with one common view.

use egui::{Rect, RichText, Ui, UiBuilder};

use crate::gui::cells::{above_line, cells, columns_of_images};
use crate::gui::image_panel::ImagePanel;
use crate::gui::scene::ScenePanel;
use crate::gui::{Panel as _, PanelContext, Selection};

/// Minimum width of a scene's cell in points; below it the cells form two rows.
const MIN_CELL_WIDTH: f32 = 250.0;
/// Height in points of the label above an image, with its gap.
const LABEL_HEIGHT: f32 = 22.0;
/// Height in points of the common legend below the images, with its gap.
const LEGEND_HEIGHT: f32 = 22.0;

/// Images side by side; zoom, position and options follow the image that was changed last.
#[derive(Default)]
pub(super) struct SideBySideImages {
    lead: ImagePanel,
    pub(super) panels: Vec<ImagePanel>,
}

impl SideBySideImages {
    pub(super) fn view_copy(&self) -> Self {
        Self { lead: self.lead.view_copy(), panels: Vec::new() }
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        self.panels.resize_with(ctx.recording.runs.len(), ImagePanel::default);
        let Self { lead, panels } = self;
        lead.common_controls_ui(ui, ctx);
        let (images, legend) = above_line(ui, LEGEND_HEIGHT);
        let columns = columns_of_images(images.size(), ctx.recording.runs.len(), LABEL_HEIGHT);
        each_run(ui, ctx, (images, columns), |ui, ctx, run| {
            let panel = &mut panels[run];
            panel.follow(lead);
            panel.cell_ui(ui, ctx);
            if !panel.looks_like(lead) {
                *lead = panel.view_copy();
            }
        });
        let moved = ctx.selection.slide.is_some();
        ui.scope_builder(UiBuilder::new().max_rect(legend), |ui| lead.legend_ui(ui, ctx, moved));
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
        let (room, count) = (ui.available_rect_before_wrap(), ctx.recording.runs.len());
        // One row if the cells are wide enough for their options, else two.
        let columns = if count > 2 && room.width() < MIN_CELL_WIDTH * count as f32 { 2 } else { count };
        each_run(ui, ctx, (room, columns), |ui, ctx, run| {
            let label = &ctx.recording.runs[run].spec.label;
            ui.label(RichText::new(label).strong().color(ctx.theme.run(run).color));
            let panel = &mut panels[run];
            panel.look = lead.look;
            panel.ui(ui, ctx);
            if panel.look != lead.look {
                *lead = panel.view_copy();
            }
        });
    }
}

/// Draws each run in a cell, as if it were the shown run.
///
/// A selection in one cell applies to all cells, a selected feature only to runs on the same camera.
fn each_run(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    (all, columns): (Rect, usize),
    mut draw: impl FnMut(&mut Ui, &mut PanelContext<'_>, usize),
) {
    ui.advance_cursor_after_rect(all);
    let runs = &ctx.recording.runs;
    let camera_of = |run: usize| runs.get(run).map(|run| run.camera_key.as_str());
    for (run, cell) in cells(all, columns, runs.len()).into_iter().enumerate() {
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
