//! Inspector panel: values of the selection and of the step at the cursor.

mod csv;
mod feature;
mod links;
mod parameter;
mod rows;
mod step;

use std::sync::Arc;

use egui::{CollapsingHeader, RichText, ScrollArea, Ui, vec2};

use self::links::Links;
use super::theme::Theme;
use super::widgets::empty_ui;
use super::{Panel, PanelContext};
use crate::session::{RunRecord, StepRecord};

#[derive(Debug, Default)]
pub struct InspectorPanel {
    /// Show stage times. They differ between executions, so screenshots omit them.
    pub show_times: bool,
    links: Links,
}

impl Panel for InspectorPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let Some((run, step)) = ctx.selected_step() else {
            empty_ui(ui, "No step at the cursor");
            return;
        };
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing = vec2(6.0, 2.0);
            self.sections_ui(ui, ctx, run, step);
        });
    }
}

impl InspectorPanel {
    fn sections_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord, step: &Arc<StepRecord>) {
        let figure = ctx.presentation.is_figure();
        if !figure && (ctx.selection.parameter.is_some() || ctx.selection.feature.is_some()) {
            let clear = ui.small_button("Clear selection").on_hover_text("Escape");
            if clear.clicked() {
                (ctx.selection.parameter, ctx.selection.feature) = (None, None);
            }
        }
        if let Some(parameter) = ctx.selection.parameter {
            let title = format!("Parameter {}", ctx.names().name(parameter));
            section_ui(ui, ctx.theme, figure, &title, |ui| {
                parameter::ui(ui, ctx, run, step, parameter);
                self.links.of_parameter_ui(ui, ctx, run, step, parameter);
            });
        }
        if let Some(id) = ctx.selection.feature {
            section_ui(ui, ctx.theme, figure, &format!("Feature {}", id.0), |ui| {
                feature::ui(ui, ctx, step, id);
                self.links.of_feature_ui(ui, ctx, run, step, id);
            });
        }
        if let (Some(id), Some(parameter)) = (ctx.selection.feature, ctx.selection.parameter) {
            let title = format!("Block: feature {} × {}", id.0, ctx.names().name(parameter));
            section_ui(ui, ctx.theme, figure, &title, |ui| links::block_ui(ui, ctx, run, step, id, parameter));
        }
        let title = format!("Frame {}", step.report.frame_name());
        section_ui(ui, ctx.theme, figure, &title, |ui| step::frame_ui(ui, ctx, run, step));
        section_ui(ui, ctx.theme, figure, "Events", |ui| step::events_ui(ui, ctx.theme, &step.report));
        section_ui(ui, ctx.theme, figure, "Solver iterations", |ui| step::iterations_ui(ui, ctx.theme, &step.report));
        if self.show_times {
            section_ui(ui, ctx.theme, figure, "Stage times", |ui| step::times_ui(ui, ctx.theme, &step.report));
        }
    }
}

/// Draws a section with a title; in the window a click on the title opens or closes it.
fn section_ui(ui: &mut Ui, theme: &Theme, figure: bool, title: &str, contents: impl FnOnce(&mut Ui)) {
    // The id uses only the first word, so that a section stays open or closed when another parameter or frame is shown.
    let salt = title.split(' ').next().unwrap_or(title);
    let title = RichText::new(title).strong().color(theme.text_strong);
    if figure {
        ui.label(title);
        contents(ui);
        return;
    }
    CollapsingHeader::new(title).id_salt(salt).default_open(true).show_unindented(ui, contents);
}
