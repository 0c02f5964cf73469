//! The bar of the study view: filter, groups, metric, reference, condition of success.

use std::sync::Arc;

use egui::{Align, Button, ComboBox, Label, Layout, RichText, TextEdit, Ui, WidgetInfo};

use super::context::StudyRequest;
use super::model::{StudyModel, TypedCondition, shown_group};
use crate::gui::theme::Theme;
use crate::gui::units::counted;
use crate::study::view::{Metric, Study};

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
    const NONE: &str = "none";
    let group = model.group();
    let columns = model.group_columns.iter().map(|column| (group == Some(column), column.clone(), ""));
    let entries = std::iter::once((group.is_none(), NONE.to_owned(), "")).chain(columns);
    let hover = "Column whose values make the groups of all plots";
    if let Some(place) = list_ui(ui, ("Group", "Group by", hover), group.unwrap_or(NONE), entries) {
        let chosen = place.checked_sub(1).and_then(|place| model.group_columns.get(place)).cloned();
        model.set_group(chosen);
    }
}

fn metric_ui(ui: &mut Ui, model: &mut StudyModel) {
    let Some(metric) = model.metric() else { return };
    let of = |known: &Metric| known.column == metric.column;
    let entries = model.metrics.iter().map(|known| (of(known), known.title(), known.description.as_str()));
    if let Some(place) = list_ui(ui, ("Metric", "Metric", &metric.description), &metric.title(), entries) {
        model.set_metric(place);
    }
}

fn reference_ui(ui: &mut Ui, model: &mut StudyModel) {
    let (Some(group), Some(reference)) = (model.group(), model.reference()) else { return };
    let name = |name: &str| shown_group(name, Some(group));
    let groups = &model.arranged.groups;
    let entries = groups.iter().map(|of| (of.name == reference, name(&of.name), ""));
    let hover = "Group from which the paired differences are measured";
    let chosen = list_ui(ui, ("Reference", "Reference group", hover), &name(reference), entries);
    if let Some(name) = chosen.map(|place| groups[place].name.clone()) {
        model.set_reference(name);
    }
}

/// Draws a labelled list of entries: whether it is the current one, its text and its hint. Returns the place of the
/// clicked one. `names` are the label, the name for screen readers and the hint of the list.
fn list_ui<'a>(
    ui: &mut Ui,
    names: (&str, &str, &str),
    current: &str,
    entries: impl Iterator<Item = (bool, String, &'a str)>,
) -> Option<usize> {
    let (label, spoken, hover) = names;
    ui.label(label);
    let mut chosen = None;
    let shown = ComboBox::from_id_salt(label).selected_text(current).height(400.0).show_ui(ui, |ui| {
        for (place, (on, text, hint)) in entries.enumerate() {
            let mut entry = ui.selectable_label(on, text);
            if !hint.is_empty() {
                entry = entry.on_hover_text(hint);
            }
            if entry.clicked() {
                chosen = Some(place);
            }
        }
    });
    shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, spoken));
    shown.response.on_hover_text(hover);
    chosen
}
