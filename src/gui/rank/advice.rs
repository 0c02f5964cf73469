//! Duration of the least observable direction, and the suggested excitation.

use std::sync::Arc;
use std::time::Duration;

use egui::{RichText, Ui};

use super::sections::{fact_ui, section_ui};
use crate::geometry::seconds_from_ns;
use crate::gimbal::ParameterId;
use crate::gui::PanelContext;
use crate::gui::derived::step_advice::step_advice;
use crate::gui::derived::step_work::{REPAINT, StepWork};
use crate::gui::theme::ROW_HEIGHT;
use crate::observability::laboratory::Advice;
use crate::session::{LostSince, Recording, RunRecord, StepRecord};

/// Number of alternatives to the best motion.
const OTHERS_SHOWN: usize = 3;

/// Text shown if no motion helps.
const NO_MOTION: &str = "No candidate motion constrains this calibration further";

/// When advice is computed in the background.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// Seconds without cursor movement after which it is computed.
    cursor_idle_s: f64,
    /// Minimum period in seconds of the computation while the cursor moves.
    min_period_s: f64,
}

impl Pace {
    const STANDARD: Self = Self { cursor_idle_s: 0.15, min_period_s: 1.0 };
    /// While runs compute, which need the processors: a cursor that follows them moves four times a second.
    const BESIDE_RUNS: Self = Self { cursor_idle_s: 0.8, min_period_s: 5.0 };

    fn of(recording: &Recording) -> Self {
        if recording.is_computing() { Self::BESIDE_RUNS } else { Self::STANDARD }
    }
}

#[derive(Debug)]
struct RankAdvice {
    /// Start of the present loss of observability.
    since: Option<LostSince>,
    advice: Option<Arc<Advice>>,
}

/// Results for one step; recomputed for another step.
#[derive(Debug, Default)]
pub(super) struct AdviceUi {
    run: Option<u64>,
    results: StepWork<RankAdvice>,
    /// Step at the cursor, and the time when the cursor reached it, in seconds of the window's clock.
    seen: Option<(Arc<StepRecord>, f64)>,
    /// Start of the last computation, in seconds of the window's clock.
    requested_s: f64,
}

impl AdviceUi {
    /// Computes the duration of the least observable direction and the suggested excitation.
    ///
    /// Both are computed while the caller waits, or in the background: then for the step at which the cursor stops, and
    /// once per second while it moves. The results of an earlier step stay until then.
    pub(super) fn update(
        &mut self,
        ui: &Ui,
        ctx: &PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        in_background: bool,
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
            let wait_s = self.due_after_s(Pace::of(ctx.recording), now_s);
            if !in_background || wait_s <= 0.0 && !self.results.is_busy() {
                self.requested_s = now_s;
                self.request(ctx, run, step, in_background);
            }
            if self.results.is_busy() {
                ui.ctx().request_repaint_after(REPAINT);
            } else if !self.results.has_result(step) {
                ui.ctx().request_repaint_after(Duration::from_secs_f64(wait_s.max(0.0)).max(REPAINT));
            }
        }
    }

    /// Start of the loss of observability of the step's least observable direction; `None` until it is computed.
    pub(super) fn since(&self, step: &Arc<StepRecord>) -> Option<LostSince> {
        let (of, results) = self.results.last()?;
        results.filter(|_| Arc::ptr_eq(of, step))?.since
    }

    /// Draws the suggested excitation, with the stamp of its step if that is not the cursor's.
    pub(super) fn ui(&self, ui: &mut Ui, ctx: &PanelContext<'_>, step: &Arc<StepRecord>) {
        let Some((of, results)) = self.results.last() else {
            ui.label(RichText::new("Linearizing candidate motions…").color(ctx.theme.text_weak));
            return;
        };
        let time = if Arc::ptr_eq(of, step) {
            String::new()
        } else {
            format!(" at {:.2} s", seconds_from_ns(of.report.stamp_ns))
        };
        let Some(rank) = &of.rank else { return };
        let advice = results.and_then(|results| results.advice.as_deref());
        match rank.sensor_excitation() {
            Some((parameter, motion)) => sensor_advice_ui(ui, ctx, parameter, motion, advice, &time),
            None => advice_ui(ui, ctx, advice, &time),
        }
    }

    /// Draws the alternatives to the suggested excitation.
    pub(super) fn alternatives_ui(&self, ui: &mut Ui, ctx: &PanelContext<'_>) {
        let advice = self.results.last().and_then(|(_, results)| results?.advice.as_deref());
        let lines = advice.map(alternatives).filter(|lines| !lines.is_empty());
        let Some(lines) = lines else { return };
        section_ui(ui, ctx.theme, ctx.presentation, "Other excitations", ROW_HEIGHT * lines.len() as f32, |ui| {
            for text in lines {
                ui.add(egui::Label::new(RichText::new(text).small().color(ctx.theme.text)).wrap());
            }
        });
    }

    /// Suggested excitation for a step of a run; `None` until it is computed.
    pub(super) fn sentence(&self, run: u64, step: &StepRecord) -> Option<String> {
        if self.run != Some(run) || !self.results.has_result(step) {
            return None;
        }
        let (_, results) = self.results.last()?;
        let sentence = results.and_then(|results| results.advice.as_deref()).and_then(Advice::sentence);
        Some(sentence.unwrap_or_else(|| NO_MOTION.to_owned()))
    }

    /// Seconds until a computation in the background is due, not positive if it is.
    fn due_after_s(&self, pace: Pace, now_s: f64) -> f64 {
        let Some((_, since_s)) = self.seen.as_ref().filter(|_| self.results.last().is_some()) else { return 0.0 };
        let at_rest_s = since_s + pace.cursor_idle_s - now_s;
        let moving_s = self.requested_s + pace.min_period_s - now_s;
        at_rest_s.min(moving_s)
    }

    fn request(&mut self, ctx: &PanelContext<'_>, run: &RunRecord, step: &Arc<StepRecord>, in_background: bool) {
        self.results.request(step, "advice", in_background, || {
            let before = run.steps.partition_point(|other| other.report.stamp_ns < step.report.stamp_ns);
            let earlier: Arc<[Arc<StepRecord>]> = run.steps[..before].into();
            let (step, rig, camera) = (Arc::clone(step), Arc::clone(&ctx.recording.rig), run.camera_key.clone());
            move || {
                let (since, advice) = (LostSince::of(&earlier, &step), step_advice(&step, &rig, &camera));
                Some(RankAdvice { since, advice })
            }
        });
    }
}

/// Draws the suggested excitation; `time` is the stamp for which it was computed if that is not the cursor's.
fn advice_ui(ui: &mut Ui, ctx: &PanelContext<'_>, advice: Option<&Advice>, time: &str) {
    let Some(advice) = advice else {
        ui.label(RichText::new(NO_MOTION).color(ctx.theme.text_weak));
        return;
    };
    let response = fact_ui(
        ui,
        ctx.theme,
        &format!("Suggested excitation{time}: "),
        &advice.sentence().unwrap_or_default(),
        ctx.theme.text_strong,
    );
    response.on_hover_text(format!(
        "Predicted σ of the least observable direction after {:.0} s of a motion of vehicle and joints, linearized at \
         the estimate of this step; smallest σ first\n{}",
        advice.duration_s,
        alternatives(advice).join("\n")
    ));
}

/// Draws the motion for the least observable sensor parameter, and the suggested excitation of the chain.
fn sensor_advice_ui(
    ui: &mut Ui,
    ctx: &PanelContext<'_>,
    parameter: ParameterId,
    motion: &str,
    advice: Option<&Advice>,
    time: &str,
) {
    let name = ctx.names().name(parameter);
    let chain = advice.and_then(Advice::sentence).map_or_else(String::new, |chain| format!("; for the chain {chain}"));
    let label = format!("Suggested excitation{time}: ");
    fact_ui(ui, ctx.theme, &label, &format!("for {name} {motion}{chain}"), ctx.theme.text_strong);
}

/// The motions after the best one, one line each.
fn alternatives(advice: &Advice) -> Vec<String> {
    advice.candidates.iter().skip(1).take(OTHERS_SHOWN).map(|candidate| advice.line(candidate)).collect()
}
