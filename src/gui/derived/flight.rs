//! Calibration tables of the runs over the whole flight, computed once for all panels.

use std::sync::{Arc, Mutex, PoisonError};

use egui::Context;

use super::follow::Follower;
use super::step_advice::{next_motion, step_advice, step_motion};
use super::step_work::{REPAINT, StepWork};
use crate::gimbal::ParameterId;
use crate::gui::parameter_names::place_of;
use crate::observability::Determination;
use crate::observability::laboratory::{ADVICE_DURATION_S, Advice, SufficientMotion};
use crate::sensors::RequiredAccuracy;
use crate::session::{Answer, FlightParameter, FlightVerdicts, Recording, RunRecord, StepRecord, Withheld, add_errors};

/// Calibration tables of all runs; clones share them.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlightTables {
    /// True if the suggested motions are computed on another thread, as in the window; screenshots wait for them.
    in_background: bool,
    runs: Arc<Mutex<Vec<FlightTable>>>,
}

impl PartialEq for FlightTables {
    /// Always equal: the tables follow from the recording.
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

/// Verdicts of one run so far, independent of the cursor.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlightReport {
    /// In the order of the chain's groups.
    pub(crate) rows: Arc<[FlightParameter]>,
    pub(crate) history: Arc<DeterminationHistory>,
    /// True if motions for the chain are still being computed.
    pub(crate) waits_for_advice: bool,
}

/// Ratio of σ and required accuracy, and verdict of each parameter at each step.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeterminationHistory {
    /// Stamps of the steps, in nanoseconds since the log began.
    pub(crate) stamps_ns: Vec<i64>,
    /// Parameters along the chain and in groups; an order that does not depend on the values.
    pub(crate) parameters: Vec<ParameterHistory>,
    /// Changes when steps are removed.
    pub(crate) epoch: u64,
}

#[derive(Clone, Debug)]
pub(crate) struct ParameterHistory {
    pub(crate) parameter: ParameterId,
    /// σ over required accuracy by step; NaN where the parameter is not estimated.
    pub(crate) ratios: Vec<f32>,
    pub(crate) verdicts: Vec<Determination>,
}

/// Log time after which the motion that is still needed is computed again while the log is being written, the duration of a
/// move of that motion.
const LIVE_PERIOD_NS: i64 = (1e9 * ADVICE_DURATION_S) as i64;

/// Motion that brings the parameters of a run to the required accuracy.
#[derive(Clone, Debug)]
pub(crate) struct NeededMotion {
    pub(crate) motion: Arc<SufficientMotion>,
    /// Step after which it begins.
    pub(crate) after: Arc<StepRecord>,
    /// Stamp of the newest step when it became known, in nanoseconds since the log began.
    pub(crate) known_ns: i64,
}

#[derive(Debug, Default)]
struct FlightTable {
    follower: Follower,
    required: RequiredAccuracy,
    withheld: Option<Withheld>,
    verdicts: FlightVerdicts,
    /// Verdicts of all steps, not withheld.
    history: Arc<DeterminationHistory>,
    advice: StepWork<Arc<Advice>>,
    motion: StepWork<Arc<SufficientMotion>>,
    /// Step of the last result of `motion`, and stamp of the newest step when it was received.
    motion_known: Option<(Arc<StepRecord>, i64)>,
    /// True if `motion` belongs to a flight that goes on.
    live: bool,
    /// True if `report` contains the motions of the last step's advice.
    advised: bool,
    report: FlightReport,
}

impl FlightTables {
    /// Computes the suggested motions on another thread from now on.
    pub(crate) fn compute_in_background(&mut self) {
        self.in_background = true;
    }

    /// Table of a run after all its steps so far; the suggested motions follow after the end of the run.
    pub(crate) fn report(
        &self,
        ctx: &Context,
        recording: &Recording,
        run: &RunRecord,
        answer: &Answer,
    ) -> FlightReport {
        let number = recording.runs.iter().position(|other| other.id == run.id).unwrap_or(0);
        let mut runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        runs.truncate(recording.runs.len());
        if runs.len() <= number {
            runs.resize_with(number + 1, FlightTable::default);
        }
        let table = &mut runs[number];
        table.read(recording, run, answer.withheld(), self.in_background);
        if table.report.waits_for_advice {
            ctx.request_repaint_after(REPAINT);
        }
        table.report.clone()
    }

    /// Motion that brings the parameters of a trusted run to the required accuracy, when the run has ended without reaching
    /// it and the suggested motions of its table are known. While the log is being written, the motion that was needed a few
    /// seconds ago.
    pub(crate) fn motion(
        &self,
        ctx: &Context,
        recording: &Recording,
        run: &RunRecord,
        answer: &Answer,
    ) -> Option<NeededMotion> {
        let live = recording.is_being_written;
        if !(live || run.has_ended()) || !answer.needs_motion() {
            return None;
        }
        if self.report(ctx, recording, run, answer).waits_for_advice {
            return None;
        }
        let number = recording.runs.iter().position(|other| other.id == run.id).unwrap_or(0);
        let mut runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        let table = runs.get_mut(number)?;
        if table.live != live {
            (table.live, table.motion) = (live, StepWork::default());
        }
        let step = table.verdicts.ranked_step()?;
        let newest_ns = step.report.stamp_ns;
        let since_ns = table.motion_known.as_ref().map(|(_, known_ns)| newest_ns - known_ns);
        if live && (table.motion.is_busy() || since_ns.is_some_and(|since_ns| since_ns < LIVE_PERIOD_NS)) {
            table.motion.receive();
            return table.needed_motion(newest_ns);
        }
        table.motion.request(step, "motion", self.in_background, || {
            let (step, rig, camera) = (Arc::clone(step), Arc::clone(&recording.rig), run.camera_key.clone());
            move || if live { next_motion(&step, &rig, &camera) } else { step_motion(&step, &rig, &camera) }
        });
        if table.motion.is_busy() {
            ctx.request_repaint_after(REPAINT);
        }
        let is_of_step = table.motion.has_result(step);
        table.needed_motion(newest_ns).filter(|_| live || is_of_step)
    }
}

impl FlightTable {
    /// The motion that was computed last, at a stamp of the run's newest step.
    fn needed_motion(&mut self, newest_ns: i64) -> Option<NeededMotion> {
        let (after, motion) = self.motion.last()?;
        if !self.motion_known.as_ref().is_some_and(|(step, _)| Arc::ptr_eq(step, after)) {
            self.motion_known = Some((Arc::clone(after), newest_ns));
        }
        let (after, known_ns) = self.motion_known.clone()?;
        Some(NeededMotion { motion: Arc::clone(motion?), after, known_ns })
    }

    /// Reads the new steps of a run, and requests the suggested motions when it has ended.
    fn read(&mut self, recording: &Recording, run: &RunRecord, withheld: Option<Withheld>, in_background: bool) {
        let required = &recording.rig.required_accuracy;
        let is_other_scale = self.required != *required;
        if is_other_scale {
            (self.required, self.follower) = (required.clone(), Follower::default());
        }
        let new_steps = self.follower.new_steps(run);
        let restarted = new_steps.restarted || is_other_scale;
        if restarted {
            (self.advice, self.motion) = (StepWork::default(), StepWork::default());
            self.verdicts = FlightVerdicts::new(required.clone());
            let epoch = self.history.epoch + 1;
            self.history = Arc::new(DeterminationHistory { epoch, ..DeterminationHistory::default() });
        }
        let changed = restarted || !new_steps.steps.is_empty() || withheld != self.withheld;
        if !new_steps.steps.is_empty() {
            let history = Arc::make_mut(&mut self.history);
            for step in new_steps.steps {
                self.verdicts.push(step);
                history.push(step, &self.verdicts, required);
            }
        }
        if changed {
            // Maps of the verdicts are drawn again where their reading of older steps changes.
            if withheld != self.withheld {
                Arc::make_mut(&mut self.history).epoch += 1;
            }
            self.withheld = withheld;
            self.report.history = match &self.withheld {
                Some(withheld) => Arc::new(self.history.withheld(withheld)),
                None => Arc::clone(&self.history),
            };
        }
        let ended = run.has_ended();
        let improvable = self.verdicts.verdicts().any(|(_, verdict)| verdict.is_improvable());
        let step = self.verdicts.ranked_step().filter(|_| ended && improvable && self.withheld.is_none());
        if let Some(step) = step {
            self.advice.request(step, "flight advice", in_background, || {
                let (step, rig, camera) = (Arc::clone(step), Arc::clone(&recording.rig), run.camera_key.clone());
                move || step_advice(&step, &rig, &camera)
            });
        }
        let advised = step.is_some_and(|step| self.advice.has_result(step));
        if changed || advised != self.advised {
            let advice = self.advice.last().and_then(|(_, advice)| advice).filter(|_| advised).map(|advice| &**advice);
            let mut rows = self.verdicts.table(&recording.rig.parameter_names(), advice);
            add_errors(&mut rows, recording, run);
            if let Some(withheld) = &self.withheld {
                withheld.apply(&mut rows);
            }
            self.report.rows = rows.into();
            self.advised = advised;
        }
        self.report.waits_for_advice = step.is_some() && !advised;
    }
}

impl DeterminationHistory {
    /// Appends a step that `verdicts` has just read.
    fn push(&mut self, step: &StepRecord, verdicts: &FlightVerdicts, required: &RequiredAccuracy) {
        let row = self.stamps_ns.len();
        self.stamps_ns.push(step.report.stamp_ns);
        let calibration = &step.report.calibration;
        for (parameter, verdict) in verdicts.verdicts() {
            let place = self.parameters.iter().position(|known| known.parameter == parameter).unwrap_or_else(|| {
                let (ratios, verdicts) = (Vec::new(), Vec::new());
                let place = self.parameters.partition_point(|it| place_of(it.parameter) < place_of(parameter));
                self.parameters.insert(place, ParameterHistory { parameter, ratios, verdicts });
                place
            });
            let index = calibration.index_of(parameter);
            let sigma = index.and_then(|index| calibration.sigmas.get(index)).copied().unwrap_or(f64::NAN);
            let history = &mut self.parameters[place];
            history.pad(row);
            history.ratios.push((sigma / required.of(parameter)) as f32);
            history.verdicts.push(verdict);
        }
        for history in &mut self.parameters {
            history.pad(row + 1);
        }
    }

    /// The same history without the verdicts that are withheld.
    fn withheld(&self, withheld: &Withheld) -> Self {
        let mut shown = self.clone();
        for parameter in &mut shown.parameters {
            for (verdict, stamp_ns) in parameter.verdicts.iter_mut().zip(&self.stamps_ns) {
                *verdict = withheld.verdict(*stamp_ns, *verdict);
            }
        }
        shown
    }

    /// Verdicts on a parameter by row; empty if it was never estimated.
    pub(crate) fn verdicts(&self, parameter: ParameterId) -> &[Determination] {
        let history = self.parameters.iter().find(|known| known.parameter == parameter);
        history.map_or(&[], |history| &history.verdicts)
    }

    /// Verdict on a parameter at a row; [`Determination::Initializing`] where it is not estimated.
    pub(crate) fn verdict(&self, parameter: ParameterId, row: Option<usize>) -> Determination {
        let verdict = row.and_then(|row| self.verdicts(parameter).get(row));
        verdict.copied().unwrap_or(Determination::Initializing)
    }

    /// Row at or before a stamp.
    pub(crate) fn row_at(&self, stamp_ns: i64) -> Option<usize> {
        self.stamps_ns.partition_point(|stamp| *stamp <= stamp_ns).checked_sub(1)
    }
}

impl ParameterHistory {
    fn pad(&mut self, rows: usize) {
        self.ratios.resize(rows.max(self.ratios.len()), f32::NAN);
        self.verdicts.resize(rows.max(self.verdicts.len()), Determination::Initializing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;
    use crate::session::{flight_table, summarize};

    /// Window, report and files show the table of one function, also when the window reads the run in pieces.
    #[test]
    fn the_window_has_the_table_of_the_files() {
        let recording = sample_recording_of(70, &["auto", "classical"]);
        let context = Context::default();
        for run in &recording.runs {
            let tables = FlightTables::default();
            let mut growing = run.clone();
            for count in [10, 30, 69] {
                growing.steps.truncate(0);
                growing.steps.extend_from_slice(&run.steps[..count]);
                tables.report(&context, &recording, &growing, &Answer::of_run(&recording, &growing));
            }
            let report = tables.report(&context, &recording, run, &Answer::of_run(&recording, run));
            assert!(!report.waits_for_advice && run.finished);
            assert_eq!(report.rows[..], flight_table(&recording, run)[..]);
            assert_eq!(report.rows[..], summarize(&recording, run, false).calibration.estimability[..]);
            assert!(report.rows.iter().any(|row| !row.remedy.is_empty()));
            let history = &report.history;
            assert_eq!(history.stamps_ns.len(), 70);
            assert_eq!(history.parameters.len(), report.rows.len());
            for row in report.rows.iter() {
                let of = history.parameters.iter().find(|it| it.parameter == row.parameter).unwrap();
                assert_eq!(of.verdicts.last(), Some(&row.verdict), "{}", row.name);
                assert_eq!(of.verdicts[0], Determination::Initializing, "{}", row.name);
                let since = of.verdicts.iter().rposition(|verdict| *verdict != row.verdict).map_or(0, |it| it + 1);
                assert_eq!(row.since_ns, Some(history.stamps_ns[since]), "{}", row.name);
            }
        }
    }
}
