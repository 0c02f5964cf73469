//! A slider that moves the chain along a null or weak direction: the scene shows the chain slide, the image shows what
//! becomes of the reprojections.

use std::sync::Arc;

use egui::{RichText, Slider, Ui};

use super::verdict::parameters_of;
use crate::gui::PanelContext;
use crate::gui::units::figure;
use crate::observability::{RankReport, chain_of_step, slide};
use crate::session::{RunRecord, StepRecord};

/// Farthest move, in units of 10° and 3 cm along the unit direction.
const FARTHEST: f64 = 2.0;
/// Seconds that the play button takes from one end to the other and back.
const PERIOD_S: f64 = 4.0;

/// State of the slider.
#[derive(Debug, Default)]
pub(super) struct SliderUi {
    /// Place among the step's directions.
    direction: usize,
    amount: f64,
    playing: bool,
}

impl SliderUi {
    /// Draws the slider and leaves the moved chain in the selection.
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord, step: &Arc<StepRecord>) {
        let Some(rank) = step.rank.as_ref().filter(|rank| !rank.directions.is_empty()) else {
            ctx.selection.slide = None;
            return;
        };
        self.direction = self.direction.min(rank.directions.len() - 1);
        ui.horizontal(|ui| {
            let play = if self.playing { "⏸" } else { "▶" };
            if ui.small_button(play).on_hover_text("Move the chain to and fro along the direction").clicked() {
                self.playing = !self.playing;
            }
            let named = |index: usize| direction_name(rank, index);
            egui::ComboBox::from_id_salt("direction of the slider")
                .selected_text(named(self.direction))
                .width(0.45 * ui.available_width())
                .show_ui(ui, |ui| {
                    for index in 0..rank.directions.len() {
                        ui.selectable_value(&mut self.direction, index, named(index));
                    }
                });
            let slider = Slider::new(&mut self.amount, -FARTHEST..=FARTHEST).show_value(false);
            let slider = ui.add(slider).on_hover_text("Move the chain along this direction, by up to 20° and 6 cm");
            if slider.double_clicked() {
                self.amount = 0.0;
            }
        });
        if self.playing {
            let time_s = ui.input(|input| input.time);
            self.amount = FARTHEST * (std::f64::consts::TAU * time_s / PERIOD_S).sin();
            ui.ctx().request_repaint();
        }
        let moved = (self.amount != 0.0).then(|| {
            let chain = chain_of_step(&step.report, rank)?;
            let camera = ctx.recording.rig.camera(&run.camera_key).ok()?;
            slide(&step.report, &camera.model, &chain, &rank.directions[self.direction].weights, self.amount)
        });
        ctx.selection.slide = moved.flatten().map(Arc::new);
        if let Some(slide) = &ctx.selection.slide {
            let text = format!(
                "moved by {:+.2}: reprojections change by up to {} px, {} px to first order",
                slide.amount,
                figure(slide.largest_px),
                figure(slide.largest_first_order_px)
            );
            ui.add(egui::Label::new(RichText::new(text).small().color(ctx.theme.text)).truncate());
        }
    }
}

fn direction_name(rank: &RankReport, index: usize) -> String {
    let direction = &rank.directions[index];
    let kind = if direction.structural { "null" } else { "weak" };
    format!("{kind} {}", parameters_of(&rank.names, direction, 2))
}
