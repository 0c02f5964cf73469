//! How long the least observable direction has been unobservable, and the suggested excitation.

use std::sync::Arc;

use egui::{RichText, Ui};

use crate::geometry::seconds_from_ns;
use crate::gui::PanelContext;
use crate::gui::step_work::{REPAINT, StepWork};
use crate::observability::laboratory::{Advice, Situation, advise};
use crate::observability::steps_lost;
use crate::session::{RunRecord, StepRecord};

/// Number of alternatives shown below the best motion.
const OTHERS_SHOWN: usize = 3;

/// Seconds without a move of the cursor before advice is computed in the background.
const CURSOR_IDLE_S: f64 = 0.15;
/// Minimum period in seconds of the computation while the cursor moves.
const MIN_PERIOD_S: f64 = 1.0;

/// The results for one step.
#[derive(Debug)]
struct StepAdvice {
    /// Text: since when the least observable direction has been unobservable.
    since: Option<String>,
    /// The suggested excitation.
    advice: Option<Advice>,
}

/// The results for one step; they are computed again for another step.
#[derive(Debug, Default)]
pub(super) struct AdviceUi {
    /// Id of the run.
    run: Option<u64>,
    results: StepWork<StepAdvice>,
    /// The step at the cursor, and when the cursor reached it, in seconds of the window's clock.
    seen: Option<(Arc<StepRecord>, f64)>,
    /// Start of the last computation, in seconds of the window's clock.
    requested_s: f64,
}

impl AdviceUi {
    /// Draws since when the least observable direction has been unobservable, and the suggested excitation.
    ///
    /// Both are computed while the caller waits, or in the background: then for the step at which the cursor rests, and
    /// once per second while it moves. The results of an earlier step stay until then, with its stamp. Without `room`
    /// only the best motion is shown, the alternatives in a tooltip.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        ctx: &PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        in_background: bool,
        room: bool,
    ) {
        if self.run != Some(run.id) {
            *self = Self { run: Some(run.id), ..Self::default() };
        }
        let now_s = ui.input(|input| input.time);
        if !self.seen.as_ref().is_some_and(|(seen, _)| Arc::ptr_eq(seen, step)) {
            self.seen = Some((Arc::clone(step), now_s));
        }
        self.results.receive();
        if !self.results.has_result(step) {
            if !in_background || self.is_due(now_s) {
                self.requested_s = now_s;
                self.request(ctx, run, step, in_background);
            }
            if !self.results.has_result(step) {
                ui.ctx().request_repaint_after(REPAINT);
            }
        }
        let Some((of, results)) = self.results.last() else {
            if step.rank.is_some() {
                ui.label(RichText::new("Linearizing candidate motions…").color(ctx.theme.text_weak));
            }
            return;
        };
        let time = if Arc::ptr_eq(of, step) {
            String::new()
        } else {
            format!(" at {:.2} s", seconds_from_ns(of.report.stamp_ns))
        };
        if let Some(text) = results.and_then(|results| results.since.as_ref()) {
            ui.add(egui::Label::new(RichText::new(text).color(ctx.theme.text)).truncate()).on_hover_text(text);
        }
        if of.rank.is_some() {
            advice_ui(ui, ctx, results.and_then(|results| results.advice.as_ref()), &time, room);
        }
    }

    /// Whether a computation in the background is due.
    fn is_due(&self, now_s: f64) -> bool {
        let rests = self.seen.as_ref().is_some_and(|(_, since_s)| now_s - since_s >= CURSOR_IDLE_S);
        let first = self.results.last().is_none();
        !self.results.is_busy() && (first || rests || now_s - self.requested_s >= MIN_PERIOD_S)
    }

    fn request(&mut self, ctx: &PanelContext<'_>, run: &RunRecord, step: &Arc<StepRecord>, in_background: bool) {
        self.results.request(step, "advice", in_background, || {
            let before = run.steps.partition_point(|other| other.report.stamp_ns < step.report.stamp_ns);
            let earlier: Arc<[Arc<StepRecord>]> = run.steps[..before].into();
            let situation = step
                .rank
                .as_ref()
                .and_then(|rank| Situation::of_step(&step.report, rank, &ctx.recording.rig, &run.camera_key));
            let step = Arc::clone(step);
            move || Some(StepAdvice { since: since(&earlier, &step), advice: situation.as_ref().and_then(advise) })
        });
    }
}

/// The suggested excitation; `time` is the stamp it was computed for, where that is not the cursor's.
fn advice_ui(ui: &mut Ui, ctx: &PanelContext<'_>, advice: Option<&Advice>, time: &str, room: bool) {
    let Some(advice) = advice else {
        ui.label(RichText::new("No candidate motion constrains this calibration further").color(ctx.theme.text_weak));
        return;
    };
    let sentence = format!("Suggested excitation{time}: {}", advice.sentence().unwrap_or_default());
    let response = ui.add(egui::Label::new(RichText::new(sentence).color(ctx.theme.text_strong)).wrap());
    let others: Vec<String> =
        advice.candidates.iter().skip(1).take(OTHERS_SHOWN).map(|candidate| advice.line(candidate)).collect();
    let listed = if room { String::new() } else { format!("\n{}", others.join("\n")) };
    response.on_hover_text(format!(
        "Predicted σ of the least observable direction after {:.0} s of a motion of vehicle and joints, linearized at \
         the estimate of this step; smallest σ first{listed}",
        advice.duration_s
    ));
    for text in others.into_iter().filter(|_| room) {
        ui.add(egui::Label::new(RichText::new(text).small().color(ctx.theme.text_weak)).truncate());
    }
}

/// Since when the least observable direction, which the verdict names, has been null or weak without interruption;
/// `before` are the run's earlier steps.
fn since(before: &[Arc<StepRecord>], step: &StepRecord) -> Option<String> {
    let rank = step.rank.as_ref()?;
    let weak = rank.directions.iter().find(|direction| !direction.structural);
    let direction = weak.or_else(|| rank.directions.first())?;
    let lost = steps_lost(&rank.parameters, &direction.weights, before.iter().rev().map(|step| step.rank.as_ref()));
    let first_ns = before.get(before.len() - lost).map_or(step.report.stamp_ns, |first| first.report.stamp_ns);
    let kind = if direction.structural { "Unobservable" } else { "Weak" };
    Some(format!("{kind} since {:.2} s without interruption", seconds_from_ns(first_ns)))
}
