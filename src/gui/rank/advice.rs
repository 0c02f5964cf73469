//! Since when the weakest direction has been lost, and what to fly against it.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread::Builder;
use std::time::Duration;

use egui::{RichText, Ui};

use super::verdict::parameters_of;
use crate::geometry::seconds_from_ns;
use crate::gui::PanelContext;
use crate::observability::laboratory::{Advice, Situation, advise};
use crate::observability::steps_lost;
use crate::session::{RunRecord, StepRecord};

/// Candidates shown behind the best one.
const OTHERS_SHOWN: usize = 3;
/// How often it is looked whether the advice has come.
const REPAINT: Duration = Duration::from_millis(50);

/// What was found out about one step; another step is asked anew.
#[derive(Debug, Default)]
pub(super) struct AdviceUi {
    since: Option<(Arc<StepRecord>, Option<String>)>,
    advice: Option<(Arc<StepRecord>, Option<Advice>)>,
    coming: Option<(Arc<StepRecord>, Receiver<Option<Advice>>)>,
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
        if !self.advice.as_ref().is_some_and(|(known, _)| fresh(known)) {
            if ctx.playback.playing {
                return;
            }
            if !self.coming.as_ref().is_some_and(|(known, _)| fresh(known)) {
                let situation = Situation::of_step(&step.report, rank, &ctx.recording.rig, &run.camera_key);
                self.coming = Some((Arc::clone(step), asked(situation.as_ref(), in_background)));
            }
            let told = self.coming.as_ref().map(|(_, coming)| coming.try_recv());
            if let Some(Err(TryRecvError::Empty)) = told {
                ui.label(RichText::new("Linearizing candidate motions…").color(ctx.theme.text_weak));
                ui.ctx().request_repaint_after(REPAINT);
                return;
            }
            self.advice = Some((Arc::clone(step), told.and_then(Result::ok).flatten()));
            self.coming = None;
        }
        match self.advice.as_ref().and_then(|(_, advice)| advice.as_ref()) {
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

/// The advice for a situation, as soon as it is there.
fn asked(situation: Option<&Situation>, in_background: bool) -> Receiver<Option<Advice>> {
    let (sender, receiver) = channel();
    let later = sender.clone();
    let given = situation.cloned();
    let work = move || drop(later.send(given.as_ref().and_then(advise)));
    let started = in_background && Builder::new().name("advice".to_owned()).spawn(work).is_ok();
    if !started {
        // Nobody else has the receiver.
        drop(sender.send(situation.and_then(advise)));
    }
    receiver
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
