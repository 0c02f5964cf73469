//! Buttons of the planned motion: start, undo, optimization and files.

use std::path::PathBuf;

use egui::{Button, CollapsingHeader, DragValue, ProgressBar, RichText, Role, TextEdit, Ui, WidgetInfo};

use super::super::request::MotionRequest;
use super::edited::EditedMotion;
use super::worker::PlanSearch;
use super::{PlanInputs, PlanView, WIDTHS_S};
use crate::gui::PanelContext;
use crate::gui::help::terms::window;
use crate::gui::units::fixed;
use crate::gui::widgets::choice_ui;
use crate::observability::laboratory::{MotionProblem, MotionStart};
use crate::text::Named as _;

/// Width of the field for the file in points.
const PATH_WIDTH: f32 = 260.0;

/// Button of the history: true if it is enabled, its name, its hint and its effect.
type HistoryButton = (bool, &'static str, &'static str, fn(&mut EditedMotion));

impl PlanView {
    pub(super) fn bar_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>, inputs: PlanInputs<'_>) {
        ui.horizontal_wrapped(|ui| {
            self.search_ui(ui, ctx, inputs);
            ui.separator();
            self.undo_ui(ui);
            let name = ui.label("Width");
            let [least, most] = WIDTHS_S;
            let width = DragValue::new(&mut self.width_s).range(least..=most).speed(0.02).suffix(" s").max_decimals(2);
            ui.add(width).labelled_by(name.id).on_hover_text(window::PLAN_WIDTH.meaning);
            ui.separator();
            self.start_ui(ui, inputs);
            if let Some(latency_s) = self.predictions.latency_s().filter(|_| inputs.in_background) {
                let text = format!("σ in {} ms", fixed(1e3 * latency_s, 0));
                ui.label(RichText::new(text).small().color(ctx.theme.text_weak))
                    .on_hover_text("Time from the last change of the motion to its predicted σ");
            }
        });
        self.file_ui(ui, ctx, inputs.problem);
    }

    /// Starts and stops the optimization.
    fn search_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>, inputs: PlanInputs<'_>) {
        let Some(search) = &self.search else {
            let button = ui.add(Button::new(RichText::new("Optimize from here").color(ctx.theme.accent)));
            if button.on_hover_text(window::PLAN_OPTIMIZE.meaning).clicked() {
                let kind = PlanSearch::Improve { trials: self.trials };
                self.start_search(ui, kind, inputs);
            }
            return;
        };
        let is_improvement = matches!(search.kind, PlanSearch::Improve { .. });
        if is_improvement && ui.button("Stop").on_hover_text("Keep the best motion so far").clicked() {
            search.stop();
        }
        if is_improvement {
            let bar = ProgressBar::new(search.progress as f32).desired_width(120.0).show_percentage();
            let bar = ui.add(bar);
            bar.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, "Progress of the optimization"));
        } else {
            ui.spinner();
            ui.label(RichText::new("Comparing moves…").color(ctx.theme.text_weak));
        }
        ui.ctx().request_repaint_after(std::time::Duration::from_millis(100));
    }

    fn undo_ui(&mut self, ui: &mut Ui) {
        let is_idle = self.search.is_none();
        let Some(edited) = &mut self.edited else { return };
        let buttons: [HistoryButton; 3] = [
            (edited.can_undo(), "Undo", "Motion before the last change", EditedMotion::undo),
            (edited.can_redo(), "Redo", "Motion after the change that was undone", EditedMotion::redo),
            (edited.is_changed(), "Reset", "Motion with which the editing began", EditedMotion::reset),
        ];
        for (is_enabled, name, hint, act) in buttons {
            if ui.add_enabled(is_enabled && is_idle, Button::new(name)).on_hover_text(hint).clicked() {
                act(edited);
                self.before = self.predictions.last().cloned();
            }
        }
    }

    /// Chooses the motion from which to start.
    fn start_ui(&mut self, ui: &mut Ui, inputs: PlanInputs<'_>) {
        let start = &mut self.settings.start;
        choice_ui(ui, "Start", 120.0, start, MotionStart::all(), |start| start.name().to_owned())
            .on_hover_text(window::PLAN_START.meaning);
        let begin = ui.add_enabled(self.search.is_none(), Button::new("Begin with it"));
        if begin.on_hover_text("Replace the motion by this start").clicked() {
            self.start_search(ui, PlanSearch::Start(self.settings.start), inputs);
        }
    }

    pub(super) fn settings_ui(&mut self, ui: &mut Ui) {
        let header = CollapsingHeader::new("Duration, limits and scene").id_salt("limits of the planned motion");
        header.show(ui, |ui| self.settings.ui(ui));
    }

    /// Saves the motion to a file and opens one.
    fn file_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>, problem: &MotionProblem) {
        let path = self.path.get_or_insert_with(|| format!("dcvins-output/{}/motion.csv", ctx.recording.log_stem()));
        let Some(edited) = &self.edited else { return };
        ui.horizontal_wrapped(|ui| {
            let name = ui.label("File");
            let field = ui.add(TextEdit::singleline(path).desired_width(PATH_WIDTH)).labelled_by(name.id);
            field.widget_info(|| WidgetInfo::labeled(Role::TextInput, true, "File of the motion"));
            let file = PathBuf::from(path.trim());
            let is_named = !file.as_os_str().is_empty();
            let save = ui.add_enabled(is_named && self.search.is_none(), Button::new("Save motion"));
            if save.on_hover_text(window::PLAN_FILE.meaning).clicked() {
                let joint_names = problem.situation().joint_names();
                let motion = edited.current().clone();
                self.request = Some(MotionRequest::Write { path: file.clone(), motion, joint_names });
            }
            let open = ui.add_enabled(is_named && self.search.is_none(), Button::new("Open motion"));
            if open.on_hover_text("Show the motion of this file instead").clicked() {
                self.request = Some(MotionRequest::Read { path: file });
            }
            if let Some((text, is_problem)) = &self.message {
                let color = if *is_problem { ctx.theme.error } else { ctx.theme.text_weak };
                ui.label(RichText::new(text).color(color));
            }
        });
    }
}
