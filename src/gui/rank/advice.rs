//! Since when the weakest direction has been lost, and what to fly against it.

use std::sync::Arc;

use egui::{RichText, Ui};

use super::verdict::parameters_of;
use crate::geometry::seconds_from_ns;
use crate::gui::PanelContext;
use crate::gui::step_work::{REPAINT, StepWork};
use crate::observability::laboratory::{Advice, Situation, advise};
use crate::observability::steps_lost;
use crate::session::{RunRecord, StepRecord};

/// Candidates shown behind the best one.
const OTHERS_SHOWN: usize = 3;

/// What was found out about one step; another step is asked anew.
#[derive(Debug, Default)]
pub(super) struct AdviceUi {
    since: Option<(Arc<StepRecord>, Option<String>)>,
    advice: StepWork<Advice>,
}

impl AdviceUi {
    /// Draws how long the weakest direction has been lost, and what to fly against it: worked out once the cursor rests,
    /// in the background or while the caller waits.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        ctx: &PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        in_background: bool,
    ) {
        let fresh = |known: &Arc<StepRecord>| Arc::ptr_eq(known, step);
        if !self.since.as_ref().is_some_and(|(known, _)| fresh(known)) {
            self.since = Some((Arc::clone(step), since(run, step)));
        }
        if let Some((_, Some(text))) = &self.since {
            ui.add(egui::Label::new(RichText::new(text).color(ctx.theme.text)).truncate()).on_hover_text(text);
        }
        let Some(rank) = &step.rank else { return };
        if !self.advice.is_known(step) {
            if ctx.playback.playing {
                return;
            }
            self.advice.ask(step, "advice", in_background, || {
                let situation = Situation::of_step(&step.report, rank, &ctx.recording.rig, &run.camera_key);
                move || situation.as_ref().and_then(advise)
            });
        }
        if !self.advice.is_known(step) {
            ui.label(RichText::new("Linearizing candidate motions…").color(ctx.theme.text_weak));
            ui.ctx().request_repaint_after(REPAINT);
            return;
        }
        match self.advice.of(step) {
            None => {
                ui.label(RichText::new("No motion can tell more about this calibration").color(ctx.theme.text_weak));
            }
            Some(advice) => {
                let sentence = format!("Fly next: {}", advice.sentence().unwrap_or_default());
                let response = ui.add(egui::Label::new(RichText::new(sentence).color(ctx.theme.text_strong)).wrap());
                response.on_hover_text(
                    "Candidate motions of vehicle and joints, linearized from here and ordered by what they would leave \
                     of the direction that is known least of all that some motion can tell",
                );
                for candidate in advice.candidates.iter().skip(1).take(OTHERS_SHOWN) {
                    let text = format!("{:.0} % left: {}", 100.0 * candidate.remaining, candidate.words);
                    ui.add(egui::Label::new(RichText::new(text).small().color(ctx.theme.text_weak)).truncate());
                }
            }
        }
    }
}

/// The weakest direction and the first second from which on it was null or weak without interruption.
fn since(run: &RunRecord, step: &Arc<StepRecord>) -> Option<String> {
    let rank = step.rank.as_ref()?;
    let weak = rank.directions.iter().find(|direction| !direction.structural);
    let direction = weak.or_else(|| rank.directions.first())?;
    let before = run.steps.partition_point(|other| other.report.stamp_ns < step.report.stamp_ns);
    let earlier = run.steps[..before].iter().rev();
    let lost = steps_lost(&rank.names, &direction.weights, earlier.map(|step| step.rank.as_ref()));
    let first = run.steps.get(before - lost)?;
    let kind = if direction.structural { "null" } else { "weak" };
    let named = parameters_of(&rank.names, direction, 2);
    Some(format!("{named}: {kind} without interruption since {:.2} s", seconds_from_ns(first.report.stamp_ns)))
}
