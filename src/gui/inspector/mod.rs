//! Inspector panel: values of the selection and of the step at the cursor.

mod csv;
mod feature;
mod links;
mod parameter;
mod rows;
mod step;

use std::sync::Arc;

use egui::{CollapsingHeader, Rect, RichText, ScrollArea, Ui, vec2};

use self::links::Links;
use super::theme::Theme;
use super::widgets::empty_ui;
use super::{Panel, PanelContext};
use crate::frontend::FeatureId;
use crate::gimbal::ParameterId;
use crate::session::{RunRecord, StepRecord};

#[derive(Debug, Default)]
pub struct InspectorPanel {
    /// Show stage times. They differ between executions, so screenshots omit them.
    pub show_times: bool,
    links: Links,
    /// Selection of the last frame; the section of a new one is scrolled into view.
    shown: (Option<ParameterId>, Option<FeatureId>),
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
        let before = std::mem::replace(&mut self.shown, (ctx.selection.parameter, ctx.selection.feature));
        let is_new = (self.shown.0 != before.0, self.shown.1 != before.1);
        if let Some(parameter) = ctx.selection.parameter {
            let title = format!("Parameter {}", ctx.names().name(parameter));
            let section = section_ui(ui, ctx.theme, figure, &title, |ui| {
                parameter::ui(ui, ctx, run, step, parameter);
                self.links.of_parameter_ui(ui, ctx, run, step, parameter);
            });
            scroll_to(ui, section, is_new.0 && !figure);
        }
        if let Some(id) = ctx.selection.feature {
            let section = section_ui(ui, ctx.theme, figure, &format!("Feature {}", id.0), |ui| {
                feature::ui(ui, ctx, step, id);
                self.links.of_feature_ui(ui, ctx, run, step, id);
            });
            scroll_to(ui, section, is_new.1 && !figure);
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

/// Scrolls the begin of a section into view.
fn scroll_to(ui: &Ui, section: Rect, is_new: bool) {
    /// Height in points of the title with the first rows.
    const BEGIN: f32 = 100.0;
    if is_new {
        ui.scroll_to_rect(section.with_max_y(section.bottom().min(section.top() + BEGIN)), None);
    }
}

/// Draws a section with a title, which in the window is opened or closed by a click on the title; returns its place.
fn section_ui(ui: &mut Ui, theme: &Theme, figure: bool, title: &str, contents: impl FnOnce(&mut Ui)) -> Rect {
    // The id uses only the first word, so that a section stays open or closed when another parameter or frame is shown.
    let salt = title.split(' ').next().unwrap_or(title);
    let title = RichText::new(title).strong().color(theme.text_strong);
    let drawn = ui.scope(|ui| {
        if figure {
            ui.label(title);
            contents(ui);
        } else {
            CollapsingHeader::new(title).id_salt(salt).default_open(true).show_unindented(ui, contents);
        }
    });
    drawn.response.rect
}
