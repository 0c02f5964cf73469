//! The page as a dialog over the window.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use egui::{Align, Button, CollapsingHeader, Label, RichText, ScrollArea, TextEdit, Ui};

use super::draft::{DraftWorker, RigDraft};
use super::form::RigForm;
use crate::flight_log::RigCandidate;
use crate::gui::app::open_request::{OpenRequest, RigQuestion};
use crate::gui::app::repaint::POLL_PERIOD;
use crate::gui::desktop::Desktop;
use crate::gui::theme::Theme;
use crate::gui::window::Modal;
use crate::text::{counted, log_name};

/// Width of the dialog in points.
const WIDTH: f32 = 980.0;
/// Largest number of found rigs that are listed.
const MAX_CANDIDATES: usize = 8;
/// Height in points of what surrounds the scrolled part: title, buttons and margins.
const OUTSIDE_HEIGHT: f32 = 150.0;
const CANDIDATES_HEIGHT: f32 = 120.0;
/// Width in points from which the assumed values are beside the form.
const MIN_WIDTH_FOR_BOTH: f32 = 900.0;
const TEXT_HEIGHT: f32 = 240.0;

/// State of the page.
pub(in crate::gui::app) struct RigPage {
    question: RigQuestion,
    form: RigForm,
    drafts: DraftWorker,
    /// Text of the rig where a person has changed it; `None` follows the form.
    edited: Option<String>,
    /// Text of the form in this frame; `None` while it is computed, and for a form that makes no rig.
    of_form: Option<String>,
    file: String,
}

/// Result of a frame of the page.
#[derive(Default)]
pub(in crate::gui::app) struct PageAnswer {
    /// The log with its rig, to be opened.
    pub(in crate::gui::app) opens: Option<OpenRequest>,
    /// Reason why the rig cannot be written.
    pub(in crate::gui::app) problem: Option<String>,
    pub(in crate::gui::app) closed: bool,
}

impl RigPage {
    pub(in crate::gui::app) fn new(question: RigQuestion) -> Self {
        let name = log_name(&question.new_rig);
        let name = name.split('.').next().unwrap_or_default().to_owned();
        Self {
            form: RigForm::new(&question.log, name),
            drafts: DraftWorker::default(),
            edited: None,
            of_form: None,
            file: question.new_rig.display().to_string(),
            question,
        }
    }

    /// Request that is answered.
    pub(in crate::gui::app) fn request(&self) -> &OpenRequest {
        &self.question.request
    }

    pub(in crate::gui::app) fn ui(&mut self, ui: &Ui, theme: &Theme, desktop: &Arc<dyn Desktop>) -> PageAnswer {
        let title = format!("Rig of {}", self.question.request.names());
        let height = (ui.ctx().content_rect().height() - OUTSIDE_HEIGHT).max(200.0);
        let modal = Modal { name: "rig question", title: &title, width: WIDTH };
        let (mut answer, stays_open) = modal.ui(ui, theme, |ui| {
            let area = ScrollArea::vertical().max_height(height).min_scrolled_height(height);
            let area = area.auto_shrink([false, true]);
            let mut answer = area.show(ui, |ui| self.contents_ui(ui, theme)).inner;
            ui.add_space(6.0);
            self.buttons_ui(ui, desktop, &mut answer);
            answer
        });
        answer.closed |= !stays_open;
        answer
    }

    fn contents_ui(&mut self, ui: &mut Ui, theme: &Theme) -> PageAnswer {
        let mut answer = PageAnswer::default();
        ui.add(Label::new(RichText::new(&self.question.reason).color(theme.text_weak)).wrap());
        ui.add_space(6.0);
        if !self.question.candidates.is_empty() {
            ui.label(RichText::new("Rigs found").color(theme.text_strong));
            if let Some(rig) = candidates_ui(ui, theme, &self.question.candidates) {
                answer.opens = Some(OpenRequest { rig: Some(rig), ..self.question.request.clone() });
            }
            ui.add_space(6.0);
        }
        ui.label(RichText::new("New rig").color(theme.text_strong));
        let choices = self.form.choices();
        let draft = self.drafts.draft(&self.question.log, &choices).cloned();
        if draft.is_none() {
            ui.ctx().request_repaint_after(POLL_PERIOD);
        }
        let count = if ui.available_width() < MIN_WIDTH_FOR_BOTH { 1 } else { 2 };
        ui.columns(count, |columns| {
            if let Some(left) = columns.first_mut() {
                left.add_enabled_ui(self.edited.is_none(), |ui| self.form.ui(ui, theme));
            }
            if let Some(right) = columns.last_mut() {
                draft_ui(right, theme, draft.as_ref());
            }
        });
        self.text_ui(ui, theme, draft.as_ref());
        self.of_form = draft.and_then(Result::ok).map(|draft| draft.text);
        answer
    }

    fn text_ui(&mut self, ui: &mut Ui, theme: &Theme, draft: Option<&Result<RigDraft, String>>) {
        CollapsingHeader::new("Text of the rig (YAML)").id_salt("rig text").show(ui, |ui| {
            if self.edited.is_some() {
                ui.horizontal(|ui| {
                    ui.label(RichText::new("Edited: the form is not used any more").color(theme.warn));
                    if ui.button("Discard the edits").clicked() {
                        self.edited = None;
                    }
                });
            }
            let of_form = draft.and_then(|draft| draft.as_ref().ok()).map(|draft| draft.text.clone());
            let mut text = self.edited.clone().or(of_form).unwrap_or_default();
            ScrollArea::vertical().id_salt("rig text").max_height(TEXT_HEIGHT).show(ui, |ui| {
                let editor = TextEdit::multiline(&mut text).code_editor().desired_width(f32::INFINITY).desired_rows(12);
                let editor = ui.add(editor);
                editor.widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Text of the rig"));
                if editor.changed() {
                    self.edited = Some(text);
                }
            });
        });
    }

    fn buttons_ui(&mut self, ui: &mut Ui, desktop: &Arc<dyn Desktop>, answer: &mut PageAnswer) {
        let text = self.edited.as_deref().or(self.of_form.as_deref());
        ui.horizontal(|ui| {
            let name = ui.label("File");
            ui.add(TextEdit::singleline(&mut self.file).desired_width(560.0)).labelled_by(name.id);
            let saves = ui.add_enabled(text.is_some() && !self.file.trim().is_empty(), Button::new("Save and open"));
            if saves.clicked()
                && let Some(text) = text
            {
                match desktop.write_rig(Path::new(self.file.trim()), text) {
                    Ok(rig) => {
                        answer.opens = Some(OpenRequest { rig: Some(rig), ..self.question.request.clone() });
                    }
                    Err(problem) => answer.problem = Some(problem),
                }
            }
            answer.closed |= ui.button("Cancel").clicked();
        });
    }
}

/// Draws the list of found rigs; returns the chosen one.
fn candidates_ui(ui: &mut Ui, theme: &Theme, candidates: &[RigCandidate]) -> Option<PathBuf> {
    let mut chosen = None;
    ScrollArea::vertical().id_salt("rigs").max_height(CANDIDATES_HEIGHT).auto_shrink([false, true]).show(ui, |ui| {
        for (number, candidate) in candidates.iter().take(MAX_CANDIDATES).enumerate() {
            ui.horizontal(|ui| {
                let name = log_name(&candidate.path);
                let usable = candidate.description.is_ok();
                let open = ui.add_enabled(usable, Button::new("Open with it"));
                let spoken = format!("Open with {name}");
                open.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, usable, &spoken));
                if number == 0 && usable && ui.memory(|memory| memory.focused().is_none()) {
                    open.request_focus();
                }
                if open.on_hover_text(candidate.path.display().to_string()).clicked() {
                    chosen = Some(candidate.path.clone());
                }
                let kind = if candidate.is_kalibr { " (Kalibr)" } else { "" };
                ui.label(RichText::new(format!("{name}{kind}")).color(theme.text_strong));
                let (text, color) = match &candidate.description {
                    Ok(text) => (text, theme.text_weak),
                    Err(problem) => (problem, theme.error),
                };
                ui.add(Label::new(RichText::new(text).color(color)).truncate()).on_hover_text(text);
            });
        }
    });
    chosen
}

/// Draws the assumed values of a draft, or the reason why there is none.
fn draft_ui(ui: &mut Ui, theme: &Theme, draft: Option<&Result<RigDraft, String>>) {
    match draft {
        None => {
            ui.spinner();
        }
        Some(Err(problem)) => {
            ui.add(Label::new(RichText::new(format!("✖ {problem}")).color(theme.error)).wrap());
        }
        Some(Ok(draft)) => {
            let title = format!("{} assumed; measure or confirm each", counted(draft.assumed.len(), "value"));
            ui.label(RichText::new(title).color(theme.text_strong));
            // Fields with one reason share its text.
            for fields in draft.assumed.chunk_by(|field, next| field.reason == next.reason) {
                let names: Vec<&str> = fields.iter().map(|field| field.field.as_str()).collect();
                for (text, color) in [(names.join(", "), theme.accent), (fields[0].reason.clone(), theme.text)] {
                    let label = Label::new(RichText::new(text).small().color(color)).halign(Align::Min);
                    ui.add(label.wrap());
                }
            }
            let hint = "dcvins check lists them and measures some";
            ui.label(RichText::new(hint).small().color(theme.text_weak));
        }
    }
}
