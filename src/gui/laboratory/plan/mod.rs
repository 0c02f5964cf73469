//! Planned motion of joints and vehicle: its curves, whose points are dragged, and the σ that it leaves.

mod bar;
mod begin;
mod curves;
mod edited;
mod planned_run;
mod settings;
mod table;
#[cfg(test)]
mod tests;
mod worker;

use std::sync::Arc;

use egui::{RichText, Ui, UiBuilder, vec2};

use self::curves::{CurveInputs, Curves};
use self::edited::EditedMotion;
use self::planned_run::PlannedRun;
use self::settings::PlanSettings;
use self::table::ShownPrediction;
use self::worker::{MotionSigmas, PlanSearch, RunningSearch, SearchState};
use super::request::MotionRequest;
use crate::gui::PanelContext;
use crate::gui::units::fixed;
use crate::observability::laboratory::{
    MotionLimits, MotionPrediction, MotionProblem, MotionStart, PlannedRow, ReachedLimit,
};
use crate::simulation::{MotionSplines, PrescribedMotion};
use crate::table::csv;

/// Changes with coarse windows that a search tries.
const TRIALS: usize = 1500;
/// Width of the panel in points from which curves and table are side by side.
const WIDE: f32 = 1040.0;
/// Ratio of the width that the curves have then.
const CURVES_RATIO: f32 = 0.4;
/// Gap between curves and table in points.
const GAP: f32 = 12.0;
/// Heights of the curves below each other, and reserved below the curves, in points.
const CURVES_HEIGHT: f32 = 400.0;
const BELOW_CURVES: f32 = 40.0;
/// Least half width of a change in seconds, and the largest.
const WIDTHS_S: [f64; 2] = [0.1, 5.0];

/// Problem and limits of searches, and true if they run on threads of their own.
#[derive(Clone, Copy)]
struct PlanInputs<'a> {
    problem: &'a Arc<MotionProblem>,
    limits: &'a MotionLimits,
    in_background: bool,
}

/// State of the planned motion.
pub(super) struct PlanView {
    settings: PlanSettings,
    run: PlannedRun,
    edited: Option<EditedMotion>,
    /// Start and duration that the motion was made for.
    made: Option<(MotionStart, f64)>,
    curves: Curves,
    /// Half width of a change in seconds.
    width_s: f64,
    predictions: MotionSigmas,
    /// Prediction before the last change of the motion.
    before: Option<MotionPrediction>,
    search: Option<RunningSearch>,
    trials: usize,
    /// Limits with the values that the motion reaches.
    reached: Option<(MotionSplines, MotionLimits, Vec<ReachedLimit>)>,
    /// Motion of a file that is to be shown.
    opened: Option<Arc<PrescribedMotion>>,
    /// File of the motion as typed; `None` before the first frame.
    path: Option<String>,
    /// Result of reading the last file, and true for a problem.
    message: Option<(String, bool)>,
    pub(super) request: Option<MotionRequest>,
}

impl Default for PlanView {
    fn default() -> Self {
        Self {
            settings: PlanSettings::default(),
            run: PlannedRun::default(),
            edited: None,
            made: None,
            curves: Curves::default(),
            width_s: 1.0,
            predictions: MotionSigmas::default(),
            before: None,
            search: None,
            trials: TRIALS,
            reached: None,
            opened: None,
            path: None,
            message: None,
            request: None,
        }
    }
}

impl PlanView {
    /// The same motion for a figure, without threads.
    pub(super) fn view_copy(&self) -> Self {
        Self {
            settings: self.settings.clone(),
            edited: self.edited.clone(),
            made: self.made,
            width_s: self.width_s,
            opened: self.opened.clone(),
            ..Self::default()
        }
    }

    /// Shows the motion of a file from the next frame on.
    pub(super) fn open(&mut self, motion: PrescribedMotion) {
        self.opened = Some(Arc::new(motion));
    }

    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, in_background: bool) {
        let is_figure = ctx.presentation.is_figure();
        let problem = match self.prepare(ui, ctx, in_background) {
            Ok(problem) => problem,
            Err(text) => {
                if !is_figure {
                    self.settings_ui(ui);
                }
                ui.label(RichText::new(text).color(ctx.theme.warn));
                return;
            }
        };
        let limits = self.settings.limits(problem.situation());
        if !is_figure {
            self.bar_ui(ui, ctx, PlanInputs { problem: &problem, limits: &limits, in_background });
            self.settings_ui(ui);
        }
        let whole = ui.available_rect_before_wrap();
        if whole.width() < WIDE {
            self.curves_ui(ui, ctx, &problem, &limits, CURVES_HEIGHT);
            self.predict(ui, &problem, in_background);
            self.table_ui(ui, ctx, &problem);
            return;
        }
        let left = whole.with_max_x(whole.left() + CURVES_RATIO * whole.width());
        let right = whole.with_min_x(left.right() + GAP);
        // The same for every position of the scroll bar.
        let above = whole.top() - ui.min_rect().top();
        let height = (ui.clip_rect().height() - above - BELOW_CURVES).max(0.0);
        let drawn = ui.scope_builder(UiBuilder::new().max_rect(left), |ui| {
            self.curves_ui(ui, ctx, &problem, &limits, height);
        });
        self.predict(ui, &problem, in_background);
        let table = ui.scope_builder(UiBuilder::new().max_rect(right), |ui| self.table_ui(ui, ctx, &problem));
        let bottom = drawn.response.rect.bottom().max(table.response.rect.bottom());
        ui.allocate_space(vec2(0.0, (bottom - ui.cursor().top()).max(0.0)));
    }

    /// The values of the table.
    pub(super) fn csv_table(&mut self, ctx: &PanelContext<'_>) -> String {
        let context = egui::Context::default();
        let Ok(problem) = self.run.update(ctx, &self.settings) else { return String::new() };
        self.make_motion(&problem);
        if let Some(edited) = &self.edited {
            self.predictions.request(&problem, edited.current(), &context, false);
        }
        let rows = self.predictions.last().map(|prediction| PlannedRow::all(prediction, None));
        rows.map_or_else(String::new, |rows| csv(&PlannedRow::columns(String::new()), rows))
    }

    /// Problem of the selected run, with a motion of its joints and duration.
    fn prepare(&mut self, ui: &Ui, ctx: &PanelContext<'_>, in_background: bool) -> Result<Arc<MotionProblem>, String> {
        let problem = self.run.update(ctx, &self.settings)?;
        self.make_motion(&problem);
        // The duration of an opened file is a new one.
        let problem = self.run.update(ctx, &self.settings).unwrap_or(problem);
        self.follow_search();
        self.predict(ui, &problem, in_background);
        Ok(problem)
    }

    /// Takes over the motion of a search.
    fn follow_search(&mut self) {
        let (Some(search), Some(edited)) = (&mut self.search, &mut self.edited) else { return };
        match search.poll() {
            None => {}
            Some(SearchState::Running(better)) => edited.preview(better),
            Some(SearchState::Done(found)) => {
                let before = search.before.clone();
                let found = found.unwrap_or_else(|| before.clone());
                edited.replace_since(before, found);
                self.search = None;
            }
        }
    }

    /// Starts a search from the motion; the table then shows its effect.
    fn start_search(
        &mut self,
        ui: &Ui,
        kind: PlanSearch,
        PlanInputs { problem, limits, in_background }: PlanInputs<'_>,
    ) {
        let Some(edited) = &self.edited else { return };
        self.before = self.predictions.last().cloned();
        let motion = edited.current();
        self.search = Some(RunningSearch::start(kind, problem, limits, motion, ui.ctx(), in_background));
        ui.ctx().request_repaint();
    }

    fn predict(&mut self, ui: &Ui, problem: &Arc<MotionProblem>, in_background: bool) {
        if let Some(edited) = &self.edited {
            self.predictions.request(problem, edited.current(), ui.ctx(), in_background);
        }
    }

    fn curves_ui(
        &mut self,
        ui: &mut Ui,
        ctx: &PanelContext<'_>,
        problem: &MotionProblem,
        limits: &MotionLimits,
        height: f32,
    ) {
        let Some(edited) = &mut self.edited else { return };
        let is_held = edited.held().is_some();
        ui.spacing_mut().item_spacing.y = 2.0;
        let inputs = CurveInputs {
            situation: problem.situation(),
            limits,
            width_s: self.width_s,
            is_editable: self.search.is_none(),
        };
        let motion = edited.current().clone();
        self.curves.ui(ui, ctx, edited, &inputs, height);
        let is_begun = edited.held().is_some() || *edited.current() != motion;
        if is_begun && !is_held {
            self.before = self.predictions.last().cloned();
        }
        self.limits_ui(ui, ctx, problem, limits);
    }

    /// Lists the limits that the motion exceeds.
    fn limits_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>, problem: &MotionProblem, limits: &MotionLimits) {
        let Some(motion) = self.edited.as_ref().map(EditedMotion::current) else { return };
        if self.reached.as_ref().is_none_or(|(of, under, _)| of != motion || under != limits) {
            let names = problem.situation().joint_names();
            self.reached = Some((motion.clone(), limits.clone(), limits.compare(motion, &names)));
        }
        let reached = self.reached.as_ref().map_or(&[][..], |(_, _, reached)| reached);
        let exceeded: Vec<String> = reached.iter().filter(|limit| !limit.is_kept()).map(limit_text).collect();
        let (text, color) = if exceeded.is_empty() {
            ("✔ within all limits".to_owned(), ctx.theme.ok)
        } else {
            (format!("✖ beyond {}", exceeded.join("; ")), ctx.theme.error)
        };
        ui.add(egui::Label::new(RichText::new(text).small().color(color)).wrap());
    }

    fn table_ui(&self, ui: &mut Ui, ctx: &mut PanelContext<'_>, problem: &MotionProblem) {
        let Some(now) = self.predictions.last() else {
            ui.label(RichText::new("Predicting σ…").color(ctx.theme.text_weak));
            return;
        };
        let same_rows = |before: &&MotionPrediction| {
            before.motion.parameters.len() == now.motion.parameters.len() && before.both.is_some() == now.both.is_some()
        };
        let before = self.before.as_ref().filter(same_rows);
        let shown = ShownPrediction { situation: problem.situation(), now, before, flight: self.run.flight() };
        table::headline_ui(ui, ctx.theme, &shown);
        table::ui(ui, ctx, &shown);
    }
}

/// A limit with the value that the motion reaches, in degrees or metres.
fn limit_text(limit: &ReachedLimit) -> String {
    let (factor, unit) = match limit.unit.strip_prefix("rad") {
        Some(per) => (1_f64.to_degrees(), format!("°{per}")),
        None => (1.0, format!(" {}", limit.unit)),
    };
    let [reached, allowed] = [limit.reached, limit.limit].map(|value| fixed(value * factor, 2));
    format!("{}: {reached} of {allowed}{unit}", limit.quantity)
}
