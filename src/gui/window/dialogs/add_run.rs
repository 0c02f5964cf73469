//! The dialog that adds a run on the same log.

use egui::{Checkbox, DragValue, Grid, RichText, TextEdit, Ui, vec2};

use super::modal::{Modal, accept_or_cancel_ui};
use crate::gui::PanelContext;
use crate::gui::widgets::hinted_choice_ui;
use crate::session::{Command, ParameterizationChoice, RunSpec};
use crate::text::{Field, Named as _};

#[derive(Debug)]
pub(super) struct AddRunDialog {
    spec: RunSpec,
    name: String,
}

impl Default for AddRunDialog {
    fn default() -> Self {
        let spec = RunSpec { parameterization: ParameterizationChoice::Classical, ..RunSpec::default() };
        Self { spec, name: String::new() }
    }
}

impl AddRunDialog {
    /// Specification of the run, as on the command line.
    fn written(&self) -> String {
        let mut spec = self.spec.clone();
        for key in RunSpec::KEYS.iter().filter(|key| self.spec.excludes(key.name)) {
            if let Field::Switch(on) = key.field {
                *on(&mut spec) = false;
            }
        }
        let settings = spec.settings();
        let separator = if settings.contains(':') { ',' } else { ':' };
        match self.name.trim() {
            "" => settings,
            name => format!("{settings}{separator}name={name}"),
        }
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
            let choice = &mut self.spec.parameterization;
            let (offered, text) = (ParameterizationChoice::all(), |it: &ParameterizationChoice| it.name().to_owned());
            hinted_choice_ui(ui, "Parameterization", 260.0, choice, offered, text, |it| it.summary());
            ui.end_row();
            ui.label("");
            ui.label(RichText::new(choice.summary()).color(theme.text_weak));
            ui.end_row();
            for key in RunSpec::KEYS {
                let Some(label) = &key.label else { continue };
                let response = match &key.field {
                    Field::Switch(on) => {
                        ui.label(label.group);
                        let enabled = !self.spec.excludes(key.name);
                        ui.add_enabled(enabled, Checkbox::new(on(&mut self.spec), label.text))
                    }
                    Field::Count(count, range) => {
                        let name = ui.label(label.text);
                        ui.add(DragValue::new(count(&mut self.spec)).range(range.clone())).labelled_by(name.id)
                    }
                    Field::Factor(..) | Field::Numbers(..) | Field::Other(..) => continue,
                };
                if !label.hint.is_empty() {
                    response.on_hover_text(label.hint);
                }
                ui.end_row();
            }
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
        for parameterization in ParameterizationChoice::all() {
            let spec =
                RunSpec { parameterization, encoder: false, window: 12, passes: 2, ..AddRunDialog::default().spec };
            let spec: RunSpec = AddRunDialog { spec, name: String::new() }.written().parse().unwrap();
            assert_eq!(spec.parameterization, parameterization);
            assert!(!spec.encoder && spec.calibrate);
            assert_eq!((spec.window, spec.passes), (12, 2));
        }
    }
}
