//! The bar of the study view: filter, groups, metric, reference, condition of success.

use std::sync::Arc;

use egui::{Align, Button, ComboBox, Label, Layout, RichText, TextEdit, Ui, WidgetInfo};

use super::context::StudyRequest;
use super::model::{StudyModel, TypedCondition, shown_group};
use crate::gui::theme::Theme;
use crate::gui::units::counted;
use crate::study::view::Study;

/// Draws the bar and applies the choices.
pub(super) fn ui(
    ui: &mut Ui,
    study: &Arc<Study>,
    model: &mut StudyModel,
    theme: &Theme,
    requests: &mut Vec<StudyRequest>,
) {
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new(&study.name).strong().color(theme.text_strong));
        let (shown, all) = (model.arranged.rows.len(), study.runs.rows());
        let text = if shown == all { counted(all, "run") } else { format!("{shown} of {}", counted(all, "run")) };
        ui.label(RichText::new(text).color(theme.text_weak));
        ui.separator();
        let hint = "ate_rmse_m < 0.1 and run = auto";
        let hover = "Runs that are shown. Comparisons: < <= > >= = !=; texts also contains; has(column); and, or, not. \
                     Units of numbers: deg, mm, cm, ms, …";
        if condition_ui(ui, "Filter", hint, hover, 300.0, study, &mut model.filter) {
            model.touch();
        }
        group_ui(ui, model);
        metric_ui(ui, model);
        reference_ui(ui, model);
        let hover = "Condition of a success, written like a filter";
        if condition_ui(ui, "Success", "status = ok", hover, 190.0, study, &mut model.success) {
            model.success_changed();
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if ui.button("Close study").on_hover_text("Back to the welcome view").clicked() {
                requests.push(StudyRequest::Close);
            }
        });
    });
    for (name, condition) in [("Filter", &model.filter), ("Success", &model.success)] {
        if let Some(problem) = &condition.problem {
            let text = RichText::new(format!("{name}: {problem}")).color(theme.error);
            ui.add(Label::new(text).wrap());
        }
    }
}

/// Draws a labelled input line; returns true if the condition in effect changed.
fn condition_ui(
    ui: &mut Ui,
    name: &str,
    hint: &str,
    hover: &str,
    width: f32,
    study: &Study,
    condition: &mut TypedCondition,
) -> bool {
    ui.label(name);
    let edit = TextEdit::singleline(&mut condition.text).hint_text(hint).desired_width(width).code_editor();
    let edit = ui.add(edit);
    edit.widget_info(|| WidgetInfo::labeled(egui::Role::TextInput, true, format!("{name} condition")));
    let changed = edit.changed() && condition.parse(study);
    edit.on_hover_text(hover);
    let clear = !condition.text.is_empty() && name == "Filter";
    let button = ui.add_enabled(clear, Button::new("x").small());
    button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, clear, format!("Clear {name}")));
    if button.clicked() {
        condition.text.clear();
        return condition.parse(study) || changed;
    }
    changed
}

fn group_ui(ui: &mut Ui, model: &mut StudyModel) {
    ui.label("Group");
    let mut chosen = None;
    let none = "none";
    let combo = ComboBox::from_id_salt("group").selected_text(model.group().unwrap_or(none).to_owned());
    let shown = combo.show_ui(ui, |ui| {
        if ui.selectable_label(model.group().is_none(), none).clicked() {
            chosen = Some(None);
        }
        for column in &model.group_columns {
            if ui.selectable_label(model.group() == Some(column), column).clicked() {
                chosen = Some(Some(column.clone()));
            }
        }
    });
    shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Group by"));
    shown.response.on_hover_text("Column whose values make the groups of all plots");
    if let Some(group) = chosen {
        model.set_group(group);
    }
}

fn metric_ui(ui: &mut Ui, model: &mut StudyModel) {
    let Some(metric) = model.metric() else { return };
    ui.label("Metric");
    let mut chosen = None;
    let combo = ComboBox::from_id_salt("metric").selected_text(metric.title());
    let shown = combo.height(400.0).show_ui(ui, |ui| {
        for (place, known) in model.metrics.iter().enumerate() {
            let on = known.column == metric.column;
            if ui.selectable_label(on, known.title()).on_hover_text(&known.description).clicked() {
                chosen = Some(place);
            }
        }
    });
    shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Metric"));
    shown.response.on_hover_text(&metric.description);
    if let Some(place) = chosen {
        model.set_metric(place);
    }
}

fn reference_ui(ui: &mut Ui, model: &mut StudyModel) {
    let (Some(group), Some(reference)) = (model.group().map(str::to_owned), model.reference().map(str::to_owned))
    else {
        return;
    };
    ui.label("Reference");
    let mut chosen = None;
    let name = |name: &str| shown_group(name, Some(&group));
    let shown = ComboBox::from_id_salt("reference").selected_text(name(&reference)).show_ui(ui, |ui| {
        for of in &model.arranged.groups {
            if ui.selectable_label(of.name == reference, name(&of.name)).clicked() {
                chosen = Some(of.name.clone());
            }
        }
    });
    shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Reference group"));
    shown.response.on_hover_text("Group from which the paired differences are measured");
    if let Some(reference) = chosen {
        model.set_reference(reference);
    }
}
