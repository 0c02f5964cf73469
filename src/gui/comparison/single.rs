//! The panel with one run: its errors over time, and suggested runs for a comparison.

use egui::{Button, Label, Rect, RichText, ScrollArea, Ui, UiBuilder, WidgetInfo, vec2};

use super::errors::Errors;
use super::numbers;
use super::row::MIN_HEIGHT;
use super::scores::Scores;
use crate::gui::{Dialog, PanelContext};
use crate::sensors::{CameraMount, Rig};
use crate::session::{Command, RunRecord, RunSpec};

/// Panel width in points from which the errors over time are shown to the right of the numbers.
const MIN_WIDTH_FOR_BOTH: f32 = 700.0;
/// Largest height of a row in points.
const MAX_HEIGHT: f32 = 120.0;

/// Suggested runs for a comparison: specification as on the command line, and purpose.
const OFFERS: [(&str, &str); 5] = [
    ("classical", "redundant directions of the classical parameterization"),
    ("auto:encoder=off", "contribution of the encoder readings"),
    ("auto:calibrate=off", "gain of the online calibration over the rig's values"),
    ("static", "accuracy of the rig's rigid camera, without the gimbal"),
    ("auto:first-estimates=off", "spurious information that first-estimate Jacobians avoid"),
];

const PREVIEW: &str = "Two to four runs share log, tracks and cursor. Shown are the accuracy of each with the best of each row \
    marked, the first difference and the first notable divergence of 14 quantities, differences over time, images and \
    scenes side by side, and lost directions with common rows.";

/// State of the panel with one run.
#[derive(Debug, Default)]
pub(super) struct Single {
    errors: Errors,
}

impl Single {
    /// Draws suggestions, numbers and errors over time. Returns the requested dialog.
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, scores: &Scores) -> Option<Dialog> {
        const GAP: f32 = 12.0;
        let run = ctx.recording.runs.first()?;
        self.errors.read(ctx);
        let all = ui.available_rect_before_wrap();
        ui.advance_cursor_after_rect(all);
        let wide = all.width() >= MIN_WIDTH_FOR_BOTH;
        let (left, right) = all.split_left_right_at_fraction(if wide { 0.46 } else { 1.0 });
        let mut asked = None;
        let mut at = |rect: Rect, draw: &mut dyn FnMut(&mut Ui)| {
            ui.scope_builder(UiBuilder::new().max_rect(rect), |ui| {
                ui.set_clip_rect(ui.clip_rect().intersect(rect));
                draw(ui);
            });
        };
        let own = if wide { left.with_max_x(left.right() - GAP) } else { left };
        at(own, &mut |ui| {
            ScrollArea::vertical().id_salt("offers").auto_shrink(false).show(ui, |ui| {
                if !ctx.presentation.is_figure() {
                    asked = offers_ui(ui, ctx, run);
                    ui.add_space(6.0);
                }
                numbers::accuracy_ui(ui, ctx, scores);
                if !wide {
                    ui.add_space(6.0);
                    self.over_time_ui(ui, ctx, MIN_HEIGHT);
                }
            });
        });
        if wide {
            at(right, &mut |ui| {
                let rows = self.errors.row_count().max(1);
                let height = (ui.available_height() - 20.0) / rows as f32 - 3.0;
                ScrollArea::vertical().id_salt("over time").auto_shrink(false).show(ui, |ui| {
                    self.over_time_ui(ui, ctx, height.clamp(MIN_HEIGHT, MAX_HEIGHT));
                });
            });
        }
        asked
    }

    fn over_time_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, height: f32) {
        let title = if self.errors.has_ground_truth() {
            format!("Errors over time, against the {}", ctx.recording.truth_name())
        } else {
            "Values over time".to_owned()
        };
        ui.label(RichText::new(title).color(ctx.theme.text_strong));
        self.errors.all_rows_ui(ui, ctx, height);
    }
}

/// Lists runs that a click adds, and the dialogs for others.
fn offers_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord) -> Option<Dialog> {
    let theme = *ctx.theme;
    let mut asked = None;
    ui.label(RichText::new("Nothing to compare yet: add a run or fork this one").color(theme.text_strong));
    for (text, question) in OFFERS {
        let Some(spec) = offered(text, &ctx.recording.rig, run) else { continue };
        ui.horizontal(|ui| {
            let button = ui.add(Button::new(format!("Add {text}")).min_size(vec2(182.0, 20.0)));
            button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("Add run {text}")));
            if button.on_hover_text(format!("--run {text}")).clicked() {
                ctx.commands.push(Command::AddRun(spec));
            }
            ui.add(Label::new(RichText::new(question).color(theme.text)).wrap());
        });
    }
    ui.horizontal(|ui| {
        for (text, dialog, hover) in [
            ("Add another run…", Dialog::AddRun, "Choose parameterization and options (A)"),
            ("Fork at the cursor…", Dialog::Fork, "Continue from this frame with changes, as a new run (F)"),
        ] {
            if ui.button(text).on_hover_text(hover).clicked() {
                asked = Some(dialog);
            }
        }
    });
    ui.add(Label::new(RichText::new(PREVIEW).color(theme.text_weak)).wrap());
    asked
}

/// Specification of a suggested run; `None` if the log lacks its inputs or if it equals `run`.
fn offered(text: &str, rig: &Rig, run: &RunRecord) -> Option<RunSpec> {
    let spec: RunSpec = text.parse().ok()?;
    let has_encoders = rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.encoder_sigma_rad.is_some());
    let has_static = rig.cameras.iter().any(|camera| matches!(camera.mount, CameraMount::Static { .. }));
    let possible = match text {
        "static" => has_static && rig.gimbal.is_some(),
        "auto:encoder=off" => has_encoders,
        "classical" => rig.gimbal.is_some(),
        _ => true,
    };
    (possible && spec.to_string() != run.spec.to_string()).then_some(spec)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn offers_fit_the_rig() {
        let recording = sample_recording_of(120, &["auto"]);
        let run = &recording.runs[0];
        for (text, _) in OFFERS {
            assert!(text.parse::<RunSpec>().is_ok(), "{text}");
        }
        assert!(offered("classical", &recording.rig, run).is_some());
        let mut rigid = (*recording.rig).clone();
        rigid.gimbal = None;
        assert!(offered("classical", &rigid, run).is_none() && offered("auto:encoder=off", &rigid, run).is_none());
        let classical = sample_recording_of(60, &["classical"]);
        assert!(offered("classical", &classical.rig, &classical.runs[0]).is_none());
    }
}
