//! The dialog that adds a run on the same log.

use egui::{ComboBox, Grid, RichText, TextEdit, Ui, vec2};

use super::modal::{Modal, accept_or_cancel_ui};
use crate::gui::PanelContext;
use crate::session::{Command, RunSpec};

/// Name of a parameterization on the command line, and its description.
const CHOICES: [(&str, &str); 7] = [
    ("auto", "minimal, switched away from singularities"),
    ("minimal", "minimal, as in the paper"),
    ("minimal-swapped", "minimal, end block swapped"),
    ("classical", "base, links, end effector; redundant directions"),
    ("poe", "product of exponentials, without singularities"),
    ("static", "static camera of the rig, rigid extrinsics"),
    ("cluster", "gimbal camera and static camera in one window"),
];

#[derive(Debug)]
pub(super) struct AddRunDialog {
    choice: usize,
    encoder: bool,
    calibrate: bool,
    timeshift: bool,
    first_estimates: bool,
    window: usize,
    passes: usize,
    name: String,
}

impl Default for AddRunDialog {
    fn default() -> Self {
        let standard = RunSpec::default();
        Self {
            choice: 3,
            encoder: standard.encoder,
            calibrate: standard.calibrate,
            timeshift: standard.timeshift,
            first_estimates: standard.first_estimates,
            window: standard.window,
            passes: standard.passes,
            name: String::new(),
        }
    }
}

impl AddRunDialog {
    /// Specification of the run, as on the command line.
    fn written(&self) -> String {
        let mut options = Vec::new();
        if !self.encoder {
            options.push("encoder=off".to_owned());
        }
        if !self.calibrate {
            options.push("calibrate=off".to_owned());
        }
        if self.timeshift && self.calibrate {
            options.push("timeshift=on".to_owned());
        }
        if !self.first_estimates {
            options.push("first-estimates=off".to_owned());
        }
        if self.window != RunSpec::default().window {
            options.push(format!("window={}", self.window));
        }
        if self.passes != RunSpec::default().passes {
            options.push(format!("passes={}", self.passes));
        }
        if !self.name.trim().is_empty() {
            options.push(format!("name={}", self.name.trim()));
        }
        let name = CHOICES[self.choice].0;
        if options.is_empty() { name.to_owned() } else { format!("{name}:{}", options.join(",")) }
    }

    /// Draws the dialog and pushes the command that adds the run. Returns true if it stays open.
    pub(super) fn ui(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>) -> bool {
        let theme = *ctx.theme;
        let title = "Add a run on the same log and tracks";
        let modal = Modal { name: "add run", title, width: 430.0 };
        let contents = modal.ui(ui, &theme, |ui| {
            ui.add_space(4.0);
            self.fields_ui(ui, &theme);
            let written = self.written();
            let parsed: Result<RunSpec, _> = written.parse();
            ui.add_space(6.0);
            match &parsed {
                Ok(_) => ui.label(RichText::new(format!("--run {written}")).monospace().color(theme.text_weak)),
                Err(error) => ui.add(egui::Label::new(RichText::new(error.to_string()).color(theme.error)).wrap()),
            };
            ui.add_space(6.0);
            if let (true, Ok(spec)) = (accept_or_cancel_ui(ui, "Add run", parsed.is_ok()), parsed) {
                ctx.commands.push(Command::AddRun(spec));
            }
        });
        contents.1
    }

    fn fields_ui(&mut self, ui: &mut Ui, theme: &crate::gui::theme::Theme) {
        Grid::new("add run").num_columns(2).spacing(vec2(12.0, 6.0)).show(ui, |ui| {
            let name = ui.label("Parameterization");
            let combo = ComboBox::from_id_salt("parameterization").width(260.0).selected_text(CHOICES[self.choice].0);
            let shown = combo.show_ui(ui, |ui| {
                for (number, (name, meaning)) in CHOICES.iter().enumerate() {
                    ui.selectable_value(&mut self.choice, number, *name).on_hover_text(*meaning);
                }
            });
            shown.response.labelled_by(name.id);
            ui.end_row();
            ui.label("");
            ui.label(RichText::new(CHOICES[self.choice].1).color(theme.text_weak));
            ui.end_row();
            ui.label("Use");
            ui.checkbox(&mut self.encoder, "Encoder readings");
            ui.end_row();
            ui.label("Estimate");
            ui.checkbox(&mut self.calibrate, "Calibration parameters");
            ui.end_row();
            ui.label("");
            ui.add_enabled_ui(self.calibrate, |ui| {
                ui.checkbox(&mut self.timeshift, "Time offsets of cameras and encoders")
            });
            ui.end_row();
            ui.label("Linearization");
            ui.checkbox(&mut self.first_estimates, "First-estimate Jacobians (FEJ)")
                .on_hover_text("Off: the prior gains spurious information about unobservable directions");
            ui.end_row();
            let name = ui.label("Keyframes in the window");
            ui.add(egui::DragValue::new(&mut self.window).range(4..=30)).labelled_by(name.id);
            ui.end_row();
            let name = ui.label("Passes over the log");
            ui.add(egui::DragValue::new(&mut self.passes).range(RunSpec::PASSES)).labelled_by(name.id).on_hover_text(
                "Each pass starts with the calibration and the biases of the previous pass; the last pass is shown",
            );
            ui.end_row();
            let name = ui.label("Name");
            let edit = TextEdit::singleline(&mut self.name).hint_text("automatic").desired_width(260.0);
            ui.add(edit).labelled_by(name.id);
            ui.end_row();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_is_understood() {
        for (choice, (name, _)) in CHOICES.iter().enumerate() {
            let dialog = AddRunDialog { choice, encoder: false, window: 12, passes: 2, ..AddRunDialog::default() };
            let spec: RunSpec = dialog.written().parse().unwrap();
            assert_eq!(spec.parameterization.name(), *name);
            assert!(!spec.encoder && spec.calibrate);
            assert_eq!((spec.window, spec.passes), (12, 2));
        }
    }
}
