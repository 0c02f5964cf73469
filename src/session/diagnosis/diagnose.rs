//! The search for a cause: a run is computed again with one change each, first on some seconds, then the best changes with
//! refined values on more of them.
//!
//! The trials use the tracks of the run, so that their likelihoods compare equal measurements and a trial takes a few
//! milliseconds per image. Tracks depend little on a wrong rig: the front end falls back to the images where the predicted
//! rotation disagrees. Changes of the rig are corrections of the measurements, so that they act from any step on and are
//! forks in the window as well.
//!
//! The faults that the check of the log measures come first: if undoing them brings the residuals back to their noise, two
//! independent measurements agree, and no other causes are tried.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::axes::plausible_axes;
use super::cost_bound::{CostBound, acts_at_once};
use super::hypotheses::{TrialHypothesis, changes_at, each_cause_first, first_hypotheses};
use super::measured::{LogFaults, Undoing};
use super::ranking::{RankedTrial, by_cause, decide};
use super::refinement::refined;
use super::scoring::{LOST, Trials, scored};
use super::span::{confirmed_span, screened_span};
use super::statement::texts;
use super::trial::{DiagnosedRun, SpanStates, TrialResult, TrialSpan, initialized_ns};
use super::tuning::{moved, tuned};
use crate::faults::{Explanation as _, FaultKind};
use crate::geometry::seconds_from_ns;
use crate::log_check::Finding;
use crate::sensors::Rig;
use crate::session::engine::{Computation, History};
use crate::session::misfit::agreement::{self, AgreementValue};
use crate::session::misfit::{Misfit, StepMisfit};
use crate::session::plan::ForkChanges;
use crate::session::record::{Diagnosis, DiagnosisVerdict, RankedCause, RunRecord, TruthAgreement, WaitingReason};
use crate::session::result::truth;

/// Causes that are computed again on more of the run.
const CONFIRMED: usize = 6;
/// Trials between two reports of the progress.
const AT_ONCE: usize = 8;
/// Ratio of the progress after the first trials, and of the processor time that they may use.
const SCREENED: f64 = 0.6;
/// Processor time of the trials in seconds unless another one is given: with the run and the check of the log about a minute.
pub const TRIALS_S: f64 = 40.0;
/// Rounds of refined values.
const ROUNDS: usize = 4;
/// Causes in a diagnosis.
const REPORTED: usize = 8;

/// Progress of a diagnosis: a ratio from 0 to 1 and what is computed.
type OnProgress<'a> = dyn FnMut(f64, &str) -> ControlFlow<()> + 'a;

/// Finds the cause of residuals of a computed run that disagree with their noise.
///
/// `on_progress` may end it; the result then has what is known so far. `log_faults` is shared by the runs of a log, whose
/// check is the same. Trials end after about `trials_s` seconds of processor time; the estimate of it is the same on every
/// machine. `None` if the recording has no such run.
pub fn diagnose(
    computation: &Computation,
    run: usize,
    log_faults: &LogFaults,
    trials_s: f64,
    on_progress: &mut OnProgress<'_>,
) -> Option<Diagnosis> {
    let recording = computation.recording();
    let record = recording.runs.get(run)?;
    let check = || log_faults.of(&recording.log_path, &recording.rig).to_vec();
    let mut diagnosis = diagnose_run(&recording.rig, record, computation.history(run)?, &check, trials_s, on_progress);
    diagnosis.log = recording.log_name();
    Some(diagnosis)
}

/// Diagnosis of a run with its history, without the name of the log; `check` finds the log's faults.
pub(in crate::session) fn diagnose_run(
    rig: &Rig,
    record: &RunRecord,
    history: &History,
    check: &dyn Fn() -> Vec<Finding>,
    trials_s: f64,
    on_progress: &mut OnProgress<'_>,
) -> Diagnosis {
    let interrupted = AtomicBool::new(false);
    let inputs: Vec<_> = (0..record.steps.len()).map_while(|step| history.inputs().get(step)).collect();
    let of_run = (&record.spec, &*record.camera_key);
    let diagnosed = DiagnosedRun::new(rig, of_run, inputs, trials_s, &interrupted);
    let mut search = Search {
        run: &diagnosed,
        history,
        record,
        check,
        trials: 0,
        causes: BTreeMap::new(),
        has_ended: false,
        on_progress,
    };
    let mut diagnosis = Diagnosis::before_trials(record.spec.label.clone());
    search.fill(&mut diagnosis);
    diagnosis.trials = search.trials;
    diagnosis.interrupted = search.is_interrupted();
    diagnosis.ended_after_s = (!diagnosis.interrupted && search.has_ended).then_some(trials_s);
    diagnosis.not_tried = search.causes.into_iter().filter(|(_, is_tried)| !is_tried).map(|(cause, _)| cause).collect();
    diagnosis
}

/// A search in progress.
struct Search<'a, 'b> {
    run: &'a DiagnosedRun<'a>,
    history: &'a History,
    record: &'a RunRecord,
    check: &'a dyn Fn() -> Vec<Finding>,
    trials: usize,
    /// Causes among the hypotheses so far; true for those that were tried.
    causes: BTreeMap<FaultKind, bool>,
    /// True if the processor time of the trials has ended before the last one.
    has_ended: bool,
    on_progress: &'a mut OnProgress<'b>,
}

impl Search<'_, '_> {
    fn fill(&mut self, diagnosis: &mut Diagnosis) {
        let given = &*self.record.misfits;
        if given.is_empty() {
            return;
        }
        diagnosis.verdict = DiagnosisVerdict::Unexplained;
        let misfit = Misfit::of(given, initialized_ns(given).unwrap_or_default());
        diagnosis.values = agreement::values(&misfit);
        diagnosis.accuracy = truth::accuracy(self.record);
        if initialized_ns(given).is_none() {
            diagnosis.waiting = waiting_reasons(self.record);
        } else if agreement::agrees(&misfit, given) {
            diagnosis.verdict = DiagnosisVerdict::Agrees;
            diagnosis.ground_truth = truth::disagreement(self.record);
        }
        let onset = if diagnosis.verdict == DiagnosisVerdict::Agrees { None } else { agreement::onset(given) };
        diagnosis.onset_s = onset.map(|step| self.stamp_s(step));
        self.report(0.03, "check of the log");
        if !self.is_interrupted() {
            diagnosis.log_faults = (self.check)();
            let ends = diagnosis.verdict == DiagnosisVerdict::Agrees || self.undo_measured(diagnosis, given, onset);
            if !ends {
                self.search(diagnosis, given, misfit.tracked_ratio() < LOST, onset);
            }
        }
    }

    /// Undoes the faults that the check of the log measures. True if that explains the residuals, or if an error can only be
    /// corrected in the log: then no other causes are tried.
    fn undo_measured(&mut self, diagnosis: &mut Diagnosis, given: &[StepMisfit], onset: Option<usize>) -> bool {
        let undoing = Undoing::of(self.run, &diagnosis.log_faults);
        let span = screened_span(self.run, self.history, given, undoing.since.or(onset));
        if let Some(span) = span.filter(|_| !undoing.hypotheses.is_empty())
            && let Some((span, trials)) = self.best_of(&span, given, undoing.hypotheses, Vec::new())
        {
            let best = RankedTrial::best(&trials.others);
            if best.is_some_and(|best| agreement::disagreement(&best.misfit) <= 1.0) {
                self.conclude(diagnosis, &span, trials);
                diagnosis.measured = diagnosis.explaining > 0;
                if diagnosis.measured {
                    return true;
                }
            }
        }
        if undoing.has_irreversible {
            diagnosis.verdict = DiagnosisVerdict::LogFault;
        }
        undoing.has_irreversible
    }

    /// Tries all causes and fills the diagnosis with the best ones.
    fn search(&mut self, diagnosis: &mut Diagnosis, given: &[StepMisfit], lost: bool, onset: Option<usize>) {
        let Some(span) = screened_span(self.run, self.history, given, onset) else { return };
        let axes = lost.then(|| plausible_axes(self.run, span.steps.clone()));
        let mut hypotheses = first_hypotheses(self.run, axes.as_ref());
        let mut of_whole_run = Vec::new();
        if let Some(onset) = onset {
            let later = changes_at(onset, &hypotheses);
            // The joint angles of runs that hardly use the encoders are what offsets are taken from.
            let begins = |it: &TrialHypothesis| {
                it.cause != FaultKind::EncoderNoise && later.iter().any(|other| other.cause == it.cause)
            };
            (of_whole_run, hypotheses) = hypotheses.into_iter().partition(begins);
            hypotheses.extend(later);
        }
        each_cause_first(&mut hypotheses);
        if let Some((span, trials)) = self.best_of(&span, given, hypotheses, of_whole_run) {
            self.conclude(diagnosis, &span, trials);
        }
    }

    /// Trials of hypotheses on a span, and of the best ones with refined values on more of the run, which is returned with
    /// them. The hypotheses of `of_whole_run` are tried if another one of their cause is promising. `None` if the run itself
    /// could not be computed.
    fn best_of(
        &mut self,
        span: &TrialSpan,
        given: &[StepMisfit],
        hypotheses: Vec<TrialHypothesis>,
        mut of_whole_run: Vec<TrialHypothesis>,
    ) -> Option<(TrialSpan, Trials)> {
        let bound = |given: &TrialResult| CostBound::of_run(&given.steps);
        let mut states = SpanStates::new(self.run, span);
        let first = self.candidates(&mut states, hypotheses, (0.05, 0.75 * SCREENED), None, &bound)?;
        of_whole_run.retain(|it| {
            first.others.iter().any(|other| other.hypothesis.cause == it.cause && first.is_promising(other))
        });
        let first = self.candidates(&mut states, of_whole_run, (0.75 * SCREENED, SCREENED), Some(first), &bound)?;
        let span = confirmed_span(self.run, given, span);
        let mut states = SpanStates::new(self.run, &span);
        let mut tried: Vec<TrialHypothesis> = by_cause(&first.given, first.others.clone())
            .into_iter()
            .filter(|candidate| first.is_promising(candidate) || !acts_at_once(&candidate.hypothesis.changes))
            .take(CONFIRMED)
            .map(|candidate| candidate.hypothesis)
            .collect();
        let mut next = refined(self.run, &first);
        let best = RankedTrial::best(&first.others);
        let bound = |given: &TrialResult| CostBound::of_best(&given.steps, &best?.result.steps);
        let mut confirmed: Option<Trials> = None;
        for round in 0..ROUNDS {
            next.retain(|it| !tried.contains(it));
            let now: Vec<TrialHypothesis> =
                if round == 0 { tried.iter().cloned().chain(next.iter().cloned()).collect() } else { next.clone() };
            if now.is_empty() || self.is_over(1.0) {
                break;
            }
            tried.append(&mut next);
            let progress = SCREENED + (1.0 - SCREENED) * round as f64 / ROUNDS as f64;
            let until = SCREENED + (1.0 - SCREENED) * (round + 1) as f64 / ROUNDS as f64;
            let Some(trials) = self.candidates(&mut states, now, (progress, until), confirmed.take(), &bound) else {
                break;
            };
            next = refined(self.run, &trials);
            next.extend(tuned(&trials));
            next.extend(moved(&trials));
            confirmed = Some(trials);
        }
        Some((span, confirmed.unwrap_or(first)))
    }

    /// Computes trials of a span, with those that are already there, and scores all on one scale; trials beyond the bound
    /// that the run itself gives are left out. `None` if the run itself could not be computed.
    fn candidates(
        &mut self,
        states: &mut SpanStates<'_>,
        hypotheses: Vec<TrialHypothesis>,
        (from, to): (f64, f64),
        known: Option<Trials>,
        bound: &dyn Fn(&TrialResult) -> Option<CostBound>,
    ) -> Option<Trials> {
        let (given, mut done) = match known {
            Some(known) => {
                (known.given.result, known.others.into_iter().map(|it| (it.hypothesis, it.result)).collect())
            }
            None => (states.trial(0, &ForkChanges::default(), None)?, Vec::new()),
        };
        let mut bound = bound(&given);
        let count = hypotheses.len();
        let mut open = hypotheses;
        for it in &open {
            self.causes.entry(it.cause).or_insert(false);
        }
        while !open.is_empty() && !self.is_over(if to > SCREENED { 1.0 } else { SCREENED }) {
            let rest = open.split_off(AT_ONCE.min(open.len()));
            self.causes.extend(open.iter().map(|it| (it.cause, true)));
            states.prepare(open.iter().filter_map(|it| it.from));
            let states = &*states;
            let trial = |it: TrialHypothesis| {
                let result = states.trial(it.from.unwrap_or_default(), &it.changes, bound.as_ref())?;
                Some((it, result))
            };
            self.trials += open.len();
            let some: Vec<(TrialHypothesis, TrialResult)> = open.into_par_iter().filter_map(trial).collect();
            done.extend(some);
            if let Some(bound) = &mut bound {
                bound.tighten(&given.steps, done.iter().map(|(it, result)| (&it.changes, &*result.steps)));
            }
            open = rest;
            let ratio = 1.0 - open.len() as f64 / count as f64;
            let label = done.last().map_or_else(String::new, |(it, _): &(TrialHypothesis, _)| it.changes.to_string());
            self.report(from + (to - from) * ratio, &label);
        }
        Some(scored(given, done))
    }

    /// Decides about the trials of a span and describes the best causes.
    fn conclude(&self, diagnosis: &mut Diagnosis, span: &TrialSpan, trials: Trials) {
        let Trials { given, others } = trials;
        diagnosis.span_s = Some((self.stamp_s(span.steps.start), self.stamp_s(span.steps.end.saturating_sub(1))));
        let mut ranked = by_cause(&given, others);
        // The columns of both clocks only find values for the shifts.
        ranked.retain(|it| it.hypothesis.cause != FaultKind::Clocks || it.hypothesis.changes.estimated.is_empty());
        (diagnosis.verdict, diagnosis.explaining) = decide(&given, &ranked);
        let with_truth = self.run.inputs.iter().any(|input| input.ground_truth.is_some());
        let helps = ranked.into_iter().filter(|it| it.score < given.score).take(REPORTED);
        diagnosis.causes = helps
            .enumerate()
            .map(|(place, candidate)| {
                let accuracy = (with_truth && place < diagnosis.explaining).then(|| self.accuracy(span, &candidate));
                self.ranked_cause(span, &candidate, given.score, accuracy.flatten())
            })
            .collect();
    }

    /// Errors with a change; `None` with another time offset of the camera, because the ground truth of an input is that at
    /// the given one.
    fn accuracy(&self, span: &TrialSpan, candidate: &RankedTrial) -> Option<TruthAgreement> {
        if candidate.hypothesis.changes.corrections.iter().any(|it| it.kind == FaultKind::CameraClock) {
            return None;
        }
        let record = RunRecord::new(self.record.spec.clone(), self.record.camera_key.clone());
        let from = candidate.hypothesis.from.unwrap_or(span.steps.start);
        let record = self.run.recorded(span, from, &candidate.hypothesis.changes, record)?;
        truth::accuracy(&record)
    }

    fn ranked_cause(
        &self,
        span: &TrialSpan,
        candidate: &RankedTrial,
        given: f64,
        accuracy: Option<TruthAgreement>,
    ) -> RankedCause {
        let hypothesis = &candidate.hypothesis;
        let step = hypothesis.from.unwrap_or(if span.is_start { 0 } else { span.steps.start });
        let from_s = hypothesis.from.map(|step| self.stamp_s(step));
        let (statement, remedy) = texts(self.run, candidate, from_s);
        let values: Vec<AgreementValue> = agreement::values(&candidate.misfit);
        RankedCause {
            cause: hypothesis.cause,
            statement,
            remedy,
            changes: hypothesis.changes.clone(),
            from_ns: self.run.inputs.get(step).map_or(0, |input| input.stamp_ns),
            from_s: self.stamp_s(step),
            parameters: hypothesis.parameters,
            since_ns: hypothesis.from.and_then(|step| self.run.inputs.get(step)).map(|input| input.stamp_ns),
            beyond_search: candidate.beyond_search,
            gain: given - candidate.score,
            values,
            accuracy,
        }
    }

    /// True after an interrupt, or once the trials have used a ratio of their processor time.
    fn is_over(&mut self, ratio: f64) -> bool {
        let is_used = self.run.budget.is_used(ratio);
        self.has_ended |= is_used;
        is_used || self.is_interrupted()
    }

    fn is_interrupted(&self) -> bool {
        self.run.interrupted.load(Ordering::Relaxed)
    }

    fn stamp_s(&self, step: usize) -> f64 {
        self.run.inputs.get(step).map_or(0.0, |input| seconds_from_ns(input.stamp_ns))
    }

    fn report(&mut self, ratio: f64, label: &str) {
        if (self.on_progress)(ratio, label).is_break() {
            self.run.interrupted.store(true, Ordering::Relaxed);
        }
    }
}

/// Reasons of all attempts of a run that never initialized, the most frequent first.
fn waiting_reasons(record: &RunRecord) -> Vec<WaitingReason> {
    let reasons = record.waiting_reasons();
    reasons.into_iter().map(|(reason, images)| WaitingReason { reason, images }).collect()
}
