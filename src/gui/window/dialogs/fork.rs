//! The dialog that forks a run at the cursor with changes.

use std::collections::BTreeMap;

use egui::{DragValue, Grid, RichText, TextEdit, Ui, vec2};

use super::modal::{Modal, accept_or_cancel_ui};
use crate::estimator::SensorParameters;
use crate::gimbal::ParameterGroup;
use crate::gui::PanelContext;
use crate::gui::units::seconds;
use crate::gui::widgets::choice_ui;
use crate::session::{Command, FORK_PARAMETERIZATIONS, ForkChanges, RunSpec};
use crate::text::{Field, Key, Label, Named as _, nearest_name, written_items};

/// First entry of the list: the parent's parameterization.
const AS_BEFORE: &str = "unchanged";

/// Key of the noise that is typed in degrees here and stored in radians.
const JOINT_NOISE: &str = "joint-noise";

#[derive(Debug, Default)]
pub(super) struct ForkDialog {
    /// Index in the list; 0 for the parent's parameterization.
    choice: usize,
    changes: ForkChanges,
    /// Values of the other keys, as typed.
    texts: BTreeMap<&'static str, String>,
    joint_noise_deg: f64,
    name: String,
}

impl ForkDialog {
    /// A dialog in which one key has a value.
    pub(super) fn with_text(key: &'static str, value: String) -> Self {
        Self { texts: [(key, value)].into(), ..Self::default() }
    }

    /// Changes as text, for the command.
    fn written(&self) -> String {
        let mut parts = Vec::new();
        if let Some(choice) = self.choice.checked_sub(1).and_then(|index| FORK_PARAMETERIZATIONS.get(index)) {
            parts.push(choice.name().to_owned());
        }
        for (key, text) in &self.texts {
            let words = text.split([',', ' ']).filter(|word| !word.is_empty());
            if *key == "set" {
                // Users may write an equals sign there.
                parts.extend(words.map(|value| format!("set={}", value.replacen('=', ":", 1))));
            } else if !text.trim().is_empty() {
                parts.push(format!("{key}={}", words.collect::<Vec<_>>().join("+")));
            }
        }
        if self.joint_noise_deg != 0.0 {
            parts.push(format!("{JOINT_NOISE}={}deg", self.joint_noise_deg));
        }
        parts.extend(written_items(ForkChanges::KEYS, &self.changes, &ForkChanges::default()));
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
        let run = ctx.run_number();
        let parent = ctx.selected_run().map_or_else(String::new, |run| run.spec.label.clone());
        let title = format!("Fork {parent} at {} s", seconds(ctx.cursor_ns));
        let modal = Modal { name: "fork", title: &title, width: 470.0 };
        let contents = modal.ui(ui, &theme, |ui| {
            ui.add_space(4.0);
            self.fields_ui(ui, ctx);
            let written = self.written();
            let parsed: Result<ForkChanges, String> =
                written.parse().map_err(|error: crate::session::ForkError| error.to_string());
            let checked = parsed.and_then(|changes| match unknown_name(&changes, ctx) {
                Some(problem) => Err(problem),
                None => Ok(changes),
            });
            let asked = checked.and_then(|changes| Ok((changes, self.label()?)));
            ui.add_space(6.0);
            match &asked {
                Ok(_) if written.is_empty() => ui.label(RichText::new("No changes").color(theme.text_weak)),
                Ok((changes, _)) => ui.label(RichText::new(changes.to_string()).monospace().color(theme.text_weak)),
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
            let text = |choice: &usize| names[*choice].to_owned();
            choice_ui(ui, "Parameterization", 260.0, &mut self.choice, 0..names.len(), text);
            ui.end_row();
            let parameter = selected.0.map_or_else(|| "yaw.alpha".to_owned(), |parameter| ctx.names().name(parameter));
            let feature = selected.1.map_or_else(|| "12 15".to_owned(), |id| id.0.to_string());
            let sensors = sensors_of(ctx).join(" ");
            let camera = second_camera(ctx).unwrap_or_else(|| "cluster runs only: one of the two cameras".to_owned());
            let text_ui = |ui: &mut Ui, label: &str, text: &mut String, hint: &str| {
                let name = ui.label(label);
                ui.add(TextEdit::singleline(text).hint_text(hint).desired_width(260.0)).labelled_by(name.id);
                ui.end_row();
            };
            let is_text = |key: &Key<ForkChanges>| matches!(key.field, Field::Other(..)) && key.name != JOINT_NOISE;
            for (key, label) in labelled().filter(|(key, _)| is_text(key)) {
                let hint = match key.name {
                    "estimate" => sensors.clone(),
                    "set" => format!("{parameter}=1deg"),
                    "drop" => feature.clone(),
                    "without" => camera.clone(),
                    _ => parameter.clone(),
                };
                text_ui(ui, label.text, self.texts.entry(key.name).or_default(), &hint);
            }
            text_ui(ui, "Name", &mut self.name, "automatic");
            for (key, label) in labelled().filter(|(key, _)| !is_text(key)) {
                let mut drag_ui = |value: DragValue<'_>| {
                    let name = ui.label(label.text);
                    ui.add(value).labelled_by(name.id);
                };
                match &key.field {
                    Field::Switch(on) => {
                        ui.label(label.group);
                        ui.checkbox(on(&mut self.changes), label.text);
                    }
                    Field::Factor(factor, range) => {
                        let factor = DragValue::new(factor(&mut self.changes));
                        drag_ui(factor.range(range.clone()).speed(0.02).prefix("× "));
                    }
                    _ => drag_ui(DragValue::new(&mut self.joint_noise_deg).range(0.0..=45.0).speed(0.05).suffix("°")),
                }
                ui.end_row();
            }
        });
    }
}

/// Message about the first parameter in the changes that the run does not have.
fn unknown_name(changes: &ForkChanges, ctx: &PanelContext<'_>) -> Option<String> {
    let names = ctx.names();
    let report = &ctx.selected_run()?.step_at(ctx.cursor_ns)?.report;
    let mut known = report.calibration.parameters.clone();
    if changes.parameterization.is_some() {
        known.retain(|parameter| parameter.group() != ParameterGroup::Chain);
        known.extend(ctx.recording.parameters());
    }
    // Sensors that the fork begins to estimate.
    let added = |name: &str| {
        !changes.estimated.is_empty()
            && names.parse(name).is_some_and(|parameter| parameter.group() != ParameterGroup::Chain)
    };
    let is_known = |name: &str| added(name) || names.parse(name).is_some_and(|parameter| known.contains(&parameter));
    let mut used = changes.frozen.iter().chain(changes.values.iter().map(|(name, _)| name));
    let unknown = used.find(|name| !is_known(name))?;
    let known: Vec<String> = known.iter().map(|parameter| names.name(*parameter)).collect();
    let near = nearest_name(unknown, known.iter().map(String::as_str));
    let near = near.map_or_else(String::new, |(_, near)| format!("; did you mean '{near}'?"));
    Some(format!("The run has no parameter '{unknown}'{near}"))
}

/// The keys that have a label.
fn labelled() -> impl Iterator<Item = (&'static Key<ForkChanges>, &'static Label)> {
    ForkChanges::KEYS.iter().filter_map(|key| Some((key, key.label.as_ref()?)))
}

/// Keys of the sensor parameters that the run at the cursor can estimate; keys of the IMU on the gimbal only if it has
/// one.
fn sensors_of(ctx: &PanelContext<'_>) -> Vec<&'static str> {
    let newest = ctx.selected_step().and_then(|(_, step)| step.report.newest());
    let has_gimbal_imu = newest.is_some_and(|newest| newest.gimbal_imu.is_some());
    let known = SensorParameters::ALL.into_iter();
    known.filter(|it| *it != SensorParameters::GimbalImu || has_gimbal_imu).map(SensorParameters::key).collect()
}

/// The second camera of the shown run.
fn second_camera(ctx: &PanelContext<'_>) -> Option<String> {
    let (_, step) = ctx.selected_step()?;
    step.report.calibration.further_cameras.first().map(|camera| camera.key.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_filled_in_is_understood() {
        let texts = [
            ("freeze", "yaw.alpha, yaw.d"),
            ("set", "pitch.a=30mm roll.a:1deg"),
            ("drop", "12 15"),
            ("without", "cam1"),
            ("estimate", " "),
        ];
        let dialog = ForkDialog {
            choice: 4,
            changes: ForkChanges { encoder: false, imu_noise: 2.0, ..ForkChanges::default() },
            texts: texts.map(|(key, text)| (key, text.to_owned())).into(),
            joint_noise_deg: 0.5,
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
