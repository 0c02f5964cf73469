//! The dialog that forks a run at the cursor with changes.

use egui::{ComboBox, DragValue, Grid, RichText, TextEdit, Ui, vec2};

use super::modal::{Modal, accept_or_cancel_ui};
use crate::estimator::SensorColumns;
use crate::gui::PanelContext;
use crate::gui::units::seconds;
use crate::session::{Command, FORK_PARAMETERIZATIONS, ForkChanges, RunSpec};

/// First entry of the list: the parent's parameterization.
const AS_BEFORE: &str = "unchanged";

#[derive(Debug)]
pub(super) struct ForkDialog {
    /// Index in the list; 0 for the parent's parameterization.
    choice: usize,
    estimated: String,
    frozen: String,
    values: String,
    dropped: String,
    without: String,
    encoder: bool,
    joint_noise_deg: f64,
    imu_noise: f64,
    pixel_noise: f64,
    encoder_noise: f64,
    name: String,
}

impl Default for ForkDialog {
    fn default() -> Self {
        Self {
            choice: 0,
            estimated: String::new(),
            frozen: String::new(),
            values: String::new(),
            dropped: String::new(),
            without: String::new(),
            encoder: true,
            joint_noise_deg: 0.0,
            imu_noise: 1.0,
            pixel_noise: 1.0,
            encoder_noise: 1.0,
            name: String::new(),
        }
    }
}

impl ForkDialog {
    /// Changes as text.
    fn written(&self) -> String {
        let mut parts = Vec::new();
        if let Some(choice) = self.choice.checked_sub(1).and_then(|index| FORK_PARAMETERIZATIONS.get(index)) {
            parts.push(choice.name().to_owned());
        }
        let list = |text: &str| text.split([',', ' ', '+']).filter(|it| !it.is_empty()).collect::<Vec<_>>().join("+");
        for (key, text) in [
            ("estimate", &self.estimated),
            ("freeze", &self.frozen),
            ("drop", &self.dropped),
            ("without", &self.without),
        ] {
            if !text.trim().is_empty() {
                parts.push(format!("{key}={}", list(text)));
            }
        }
        for value in self.values.split([',', ' ']).filter(|value| !value.is_empty()) {
            // An equals sign is accepted, too.
            parts.push(format!("set={}", value.replacen('=', ":", 1)));
        }
        if !self.encoder {
            parts.push("encoder=off".to_owned());
        }
        if self.joint_noise_deg != 0.0 {
            parts.push(format!("joint-noise={}deg", self.joint_noise_deg));
        }
        let factors =
            [("imu-noise", self.imu_noise), ("pixel-noise", self.pixel_noise), ("encoder-noise", self.encoder_noise)];
        parts
            .extend(factors.iter().filter(|(_, factor)| *factor != 1.0).map(|(key, factor)| format!("{key}={factor}")));
        parts.join(",")
    }

    /// Label of the fork; `None` for an automatic one; an error if it is no valid folder name.
    fn label(&self) -> Result<Option<String>, String> {
        let name = self.name.trim();
        if name.is_empty() {
            return Ok(None);
        }
        let spec: Result<RunSpec, _> = format!("auto:name={name}").parse();
        spec.map(|spec| Some(spec.label)).map_err(|error| error.to_string())
    }

    /// Draws the dialog and pushes the command that forks the run. Returns true if it stays open.
    pub(super) fn ui(&mut self, ui: &Ui, ctx: &mut PanelContext<'_>) -> bool {
        let theme = *ctx.theme;
        let run = ctx.selection.run.min(ctx.recording.runs.len().saturating_sub(1));
        let parent = ctx.recording.runs.get(run).map_or_else(String::new, |run| run.spec.label.clone());
        let title = format!("Fork {parent} at {} s", seconds(ctx.cursor_ns));
        let modal = Modal { name: "fork", title: &title, width: 470.0 };
        let contents = modal.ui(ui, &theme, |ui| {
            ui.add_space(4.0);
            self.fields_ui(ui, ctx);
            let written = self.written();
            let parsed: Result<ForkChanges, String> =
                written.parse().map_err(|error: crate::session::ForkError| error.to_string());
            let asked = parsed.and_then(|changes| Ok((changes, self.label()?)));
            ui.add_space(6.0);
            match &asked {
                Ok(_) if written.is_empty() => ui.label(RichText::new("No changes").color(theme.text_weak)),
                Ok(_) => ui.label(RichText::new(&written).monospace().color(theme.text_weak)),
                Err(problem) => ui.add(egui::Label::new(RichText::new(problem).color(theme.error)).wrap()),
            };
            ui.add_space(6.0);
            if let (true, Ok((changes, label))) = (accept_or_cancel_ui(ui, "Fork", asked.is_ok()), asked) {
                ctx.commands.push(Command::Fork { run, changes, label });
            }
        });
        contents.1
    }

    fn fields_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>) {
        let selected = (ctx.selection.parameter, ctx.selection.feature);
        Grid::new("fork").num_columns(2).spacing(vec2(12.0, 6.0)).show(ui, |ui| {
            let names: Vec<&str> =
                std::iter::once(AS_BEFORE).chain(FORK_PARAMETERIZATIONS.iter().map(|choice| choice.name())).collect();
            let name = ui.label("Parameterization");
            let combo = ComboBox::from_id_salt("fork parameterization").width(260.0).selected_text(names[self.choice]);
            let shown = combo.show_ui(ui, |ui| {
                for (number, name) in names.iter().enumerate() {
                    ui.selectable_value(&mut self.choice, number, *name);
                }
            });
            shown.response.labelled_by(name.id);
            ui.end_row();
            let parameter = selected.0.map_or_else(|| "yaw.alpha".to_owned(), |parameter| ctx.names().name(parameter));
            let feature = selected.1.map_or_else(|| "12 15".to_owned(), |id| id.0.to_string());
            let sensors = SensorColumns::ALL.map(SensorColumns::key).join(" ");
            let value = format!("{parameter}=1deg");
            let camera = second_camera(ctx).unwrap_or_else(|| "cluster runs only: one of the two cameras".to_owned());
            for (label, text, hint) in [
                ("Estimate sensors", &mut self.estimated, &sensors),
                ("Freeze parameters", &mut self.frozen, &parameter),
                ("Set parameters", &mut self.values, &value),
                ("Drop features", &mut self.dropped, &feature),
                ("Exclude camera", &mut self.without, &camera),
                ("Name", &mut self.name, &"automatic".to_owned()),
            ] {
                let name = ui.label(label);
                ui.add(TextEdit::singleline(text).hint_text(hint).desired_width(260.0)).labelled_by(name.id);
                ui.end_row();
            }
            ui.label("Use from the cursor on");
            ui.checkbox(&mut self.encoder, "Encoder readings");
            ui.end_row();
            let name = ui.label("Added joint noise, σ");
            ui.add(DragValue::new(&mut self.joint_noise_deg).range(0.0..=45.0).speed(0.05).suffix("°"))
                .labelled_by(name.id);
            ui.end_row();
            for (label, factor) in [
                ("Assumed IMU noise", &mut self.imu_noise),
                ("Assumed pixel noise", &mut self.pixel_noise),
                ("Assumed encoder noise", &mut self.encoder_noise),
            ] {
                let name = ui.label(label);
                let drag = DragValue::new(factor).range(0.001..=1000.0).speed(0.02).prefix("× ");
                ui.add(drag).labelled_by(name.id);
                ui.end_row();
            }
        });
    }
}

/// The second camera of the shown run.
fn second_camera(ctx: &PanelContext<'_>) -> Option<String> {
    let run = ctx.recording.runs.get(ctx.selection.run)?;
    let step = run.step_at(ctx.cursor_ns)?;
    step.report.calibration.rigid_cameras.first().map(|(key, _)| key.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_filled_in_is_understood() {
        let dialog = ForkDialog {
            choice: 4,
            frozen: "yaw.alpha, yaw.d".to_owned(),
            values: "pitch.a=30mm roll.a:1deg".to_owned(),
            dropped: "12 15".to_owned(),
            without: "cam1".to_owned(),
            encoder: false,
            joint_noise_deg: 0.5,
            imu_noise: 2.0,
            ..ForkDialog::default()
        };
        let changes: ForkChanges = dialog.written().parse().unwrap();
        let expected = "classical,freeze=yaw.alpha+yaw.d,set=pitch.a:30mm,set=roll.a:1deg,drop=12+15,without=cam1,encoder=off,\
                        joint-noise=0.5deg,imu-noise=2";
        assert_eq!(changes, expected.parse().unwrap());
        assert_eq!(ForkDialog::default().written(), "");
        let named = |name: &str| ForkDialog { name: name.to_owned(), ..ForkDialog::default() }.label();
        assert_eq!(named(" "), Ok(None));
        assert_eq!(named("mine"), Ok(Some("mine".to_owned())));
        assert!(named("a/b").unwrap_err().contains("name"));
    }
}
