//! Verdicts on the calibration parameters of a run, followed over the whole flight, and the table of them.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::flight_parameter::FlightParameter;
use super::recording::Recording;
use super::run::RunRecord;
use super::step::StepRecord;
use crate::gimbal::{ParameterId, ParameterNames, Parameterization};
use crate::observability::laboratory::{Advice, Situation, advise};
use crate::observability::{
    Correlations, Determination, LossCause, ParameterState, RankReport, Redundancy, exciting_motion, parameter_states,
};
use crate::sensors::{RequiredAccuracy, Rig};
use crate::text::Named as _;

/// Ratio of predicted and present σ from which a motion does not help.
const MIN_EFFECT_RATIO: f64 = 0.98;

/// Verdicts of a run so far: each step is read once, in time order, and the cursor has no effect.
#[derive(Clone, Debug, Default)]
pub struct FlightVerdicts {
    required: RequiredAccuracy,
    parameters: BTreeMap<ParameterId, Followed>,
    /// Values at the first step of each parameter, angles in (−π, π].
    starts: BTreeMap<ParameterId, f64>,
    redundancy: Redundancy,
    last: Option<Arc<StepRecord>>,
    /// Last step with a rank report.
    ranked: Option<Arc<StepRecord>>,
}

/// One parameter since it is estimated without interruption.
#[derive(Clone, Copy, Debug)]
struct Followed {
    verdict: Determination,
    /// Stamp of the first step of the present verdict.
    since_ns: i64,
    windows: Windows,
}

/// Numbers of windows with a rank report.
#[derive(Clone, Copy, Debug, Default)]
struct Windows {
    all: usize,
    /// The window constrains the parameter less than a prior of 10° or 3 cm.
    uninformed: usize,
    /// Unobservable with a rank deficit by stationary joints.
    joints: usize,
    /// Unobservable with a rank deficit by free joint angles.
    absorbed: usize,
}

impl Windows {
    fn count(&mut self, state: ParameterState, rank: &RankReport) {
        self.all += 1;
        self.uninformed += usize::from(matches!(state, ParameterState::Uninformed | ParameterState::Unobservable));
        if state == ParameterState::Unobservable {
            let absorbed = rank.deficit_absorbed > 0;
            self.absorbed += usize::from(absorbed);
            self.joints += usize::from(!absorbed && rank.deficit_joints > 0);
        }
    }

    fn cause(self) -> LossCause {
        if 2 * self.absorbed > self.all {
            LossCause::FreeJointAngles
        } else if 2 * self.joints > self.all {
            LossCause::StationaryJoints
        } else {
            LossCause::Motion
        }
    }
}

impl FlightVerdicts {
    /// Verdicts before the first step.
    pub fn new(required: RequiredAccuracy) -> Self {
        Self { required, ..Self::default() }
    }

    /// Verdicts after all steps of a run.
    pub fn of_run(run: &RunRecord, required: &RequiredAccuracy) -> Self {
        let mut verdicts = Self::new(required.clone());
        run.steps.iter().for_each(|step| verdicts.push(step));
        verdicts
    }

    /// Reads the next step of the run.
    pub fn push(&mut self, step: &Arc<StepRecord>) {
        let states = parameter_states(step.rank.as_ref());
        if let Some(rank) = &step.rank {
            self.redundancy = Redundancy::of_step(&step.report, rank);
            self.ranked = Some(Arc::clone(step));
        }
        let mut parameters = BTreeMap::new();
        let ranked = self.ranked.as_ref().and_then(|ranked| ranked.rank.as_ref());
        for (parameter, verdict) in step.determinations_with(&self.required, ranked, &self.redundancy) {
            let since = Followed { verdict, since_ns: step.report.stamp_ns, windows: Windows::default() };
            let mut followed = self.parameters.get(&parameter).copied().unwrap_or(since);
            if followed.verdict != verdict {
                followed = Followed { windows: followed.windows, ..since };
            }
            let state = states.as_ref().and_then(|states| states.get(&parameter));
            if let (Some(state), Some(rank)) = (state, &step.rank) {
                followed.windows.count(*state, rank);
            }
            parameters.insert(parameter, followed);
        }
        let calibration = &step.report.calibration;
        for (parameter, value) in calibration.parameters.iter().zip(&calibration.values) {
            self.starts.entry(*parameter).or_insert_with(|| parameter.principal_value(*value));
        }
        self.parameters = parameters;
        self.last = Some(Arc::clone(step));
    }

    /// Last step of the run with a rank report.
    pub fn ranked_step(&self) -> Option<&Arc<StepRecord>> {
        self.ranked.as_ref()
    }

    /// Verdict on each parameter of the last step.
    pub fn verdicts(&self) -> impl Iterator<Item = (ParameterId, Determination)> {
        self.parameters.iter().map(|(parameter, followed)| (*parameter, followed.verdict))
    }

    /// Table of the parameters at the end of the steps that were read, in groups, otherwise in column order.
    ///
    /// `advice` belongs to [`Self::ranked_step`]; without it no motion is suggested for the chain.
    pub fn table(&self, names: &ParameterNames, advice: Option<&Advice>) -> Vec<FlightParameter> {
        let Some(last) = &self.last else { return Vec::new() };
        let calibration = &last.report.calibration;
        let correlations = self.ranked.as_ref().and_then(|step| step.rank.as_ref()).and_then(Correlations::new);
        let finite = |values: &[f64], index: usize| values.get(index).copied().filter(|value| value.is_finite());
        let mut rows: Vec<FlightParameter> = Vec::new();
        for (index, parameter) in calibration.parameters.iter().enumerate() {
            let Some(followed) = self.parameters.get(parameter) else { continue };
            let (sigma, prior_sigma) = (finite(&calibration.sigmas, index), finite(&calibration.prior_sigmas, index));
            let cause = match followed.verdict {
                Determination::Redundant => Some(LossCause::Parameterization),
                verdict => verdict.is_improvable().then(|| followed.windows.cause()),
            };
            let required = self.required.of(*parameter);
            let ranked = self.ranked.as_ref().and_then(|step| step.rank.as_ref());
            let correlated = correlations.as_ref().map_or_else(String::new, |all| all.text(*parameter, names));
            rows.push(FlightParameter {
                parameter: *parameter,
                name: names.name(*parameter),
                group: parameter.group().name(),
                dimension: parameter.dimension(),
                value: self.starts.get(parameter).copied().map_or(f64::NAN, |start| {
                    parameter.value_near(start, calibration.values.get(index).copied().unwrap_or(f64::NAN))
                }),
                sigma,
                prior_sigma,
                ratio: sigma.zip(prior_sigma).map(|(sigma, prior_sigma)| sigma / prior_sigma),
                flight_sigma: ranked
                    .map(|rank| calibration.sigma_scale * rank.flight_sigma(*parameter))
                    .filter(|sigma| sigma.is_finite()),
                sigma_scale: calibration.sigma_scale,
                error: None,
                required,
                verdict: followed.verdict,
                since_ns: (followed.verdict != Determination::Initializing).then_some(followed.since_ns),
                cause,
                reason: cause.map_or_else(String::new, |cause| {
                    let partners = self.redundancy.partners(*parameter);
                    let partners: Vec<String> = partners.into_iter().map(|it| names.name(it)).collect();
                    reason(cause, followed.windows, &partners, &correlated)
                }),
                remedy: cause
                    .map_or_else(String::new, |cause| remedy(cause, *parameter, calibration.parameterization, advice)),
            });
        }
        rows.sort_by_key(|row| row.parameter.group());
        rows
    }
}

impl StepRecord {
    /// Verdicts on the parameters of this step against a required accuracy, in column order.
    pub fn determinations(&self, required: &RequiredAccuracy) -> Vec<(ParameterId, Determination)> {
        let rank = self.rank.as_ref();
        let redundancy = rank.map_or_else(Redundancy::default, |rank| Redundancy::of_step(&self.report, rank));
        self.determinations_with(required, rank, &redundancy)
    }

    /// The same with σ by the measurements alone and the redundant parameters of an earlier step, if this one has no rank
    /// report.
    fn determinations_with(
        &self,
        required: &RequiredAccuracy,
        rank: Option<&RankReport>,
        redundancy: &Redundancy,
    ) -> Vec<(ParameterId, Determination)> {
        let calibration = &self.report.calibration;
        let fixed =
            |parameter: &ParameterId| self.rank.as_ref().is_some_and(|rank| rank.fixed_parameters.contains(parameter));
        let verdict = |(index, parameter): (usize, &ParameterId)| {
            let sigma = calibration.sigmas.get(index).copied().unwrap_or(f64::NAN);
            let flight_sigma =
                rank.map_or(f64::INFINITY, |rank| calibration.sigma_scale * rank.flight_sigma(*parameter));
            let verdict = if fixed(parameter) {
                Determination::Fixed
            } else {
                Determination::of(sigma, flight_sigma, required.of(*parameter), redundancy.contains(*parameter))
            };
            (*parameter, verdict)
        };
        calibration.parameters.iter().enumerate().map(verdict).collect()
    }
}

/// Reason for which a parameter is not determined: its cause and the parameters that it is confused with.
fn reason(cause: LossCause, windows: Windows, partners: &[String], correlated: &str) -> String {
    if cause == LossCause::Parameterization {
        return format!("the same motion as {}", partners.join(" and "));
    }
    let percent = 100.0 * windows.uninformed as f64 / windows.all.max(1) as f64;
    let with = (!correlated.is_empty()).then(|| format!("correlated with {correlated}"));
    let uninformed = (percent >= 0.5).then(|| format!("uninformed in {percent:.0} % of the windows"));
    let causes: Vec<String> = uninformed.into_iter().chain(with).collect();
    if causes.is_empty() {
        return format!("{}: every window informs it, but too little", cause.name());
    }
    format!("{}: {}", cause.name(), causes.join("; "))
}

/// Change of flight, record or run that would determine a parameter; empty if none is known.
fn remedy(
    cause: LossCause,
    parameter: ParameterId,
    parameterization: Parameterization,
    advice: Option<&Advice>,
) -> String {
    match (cause, exciting_motion(parameter)) {
        (LossCause::Parameterization, _) if parameterization == Parameterization::Classical => {
            "use a parameterization without redundancy: run minimal".to_owned()
        }
        (LossCause::Parameterization, _) => "fix one of these parameters".to_owned(),
        (LossCause::FreeJointAngles, _) => "record the joint angles".to_owned(),
        (_, Some(motion)) => motion.to_owned(),
        (_, None) => {
            let Some(advice) = advice else { return String::new() };
            match advice.for_parameter(parameter) {
                Some((best, ratio)) if ratio < MIN_EFFECT_RATIO => {
                    format!("σ −{:.0} %: {} for {:.0} s", 100.0 * (1.0 - ratio), best.words, advice.duration_s)
                }
                Some(_) => format!("no candidate motion of {:.0} s reduces σ by 2 %", advice.duration_s),
                None => String::new(),
            }
        }
    }
}

/// Suggested excitation for the chain after a step of a run; `None` if no parameter is estimated.
pub fn flight_advice(step: &StepRecord, rig: &Rig, camera_key: &str) -> Option<Advice> {
    let situation = Situation::of_step(&step.report, step.rank.as_ref()?, rig, camera_key)?;
    advise(&situation)
}

/// Calibration table of a run after its last step, verdicts not withheld.
pub(in crate::session) fn flight_rows(recording: &Recording, run: &RunRecord) -> Vec<FlightParameter> {
    let verdicts = FlightVerdicts::of_run(run, &recording.rig.required_accuracy);
    let improvable = verdicts.verdicts().any(|(_, verdict)| verdict.is_improvable());
    let ranked = verdicts.ranked_step().filter(|_| improvable);
    let advice = ranked.and_then(|step| flight_advice(step, &recording.rig, &run.camera_key));
    let mut rows = verdicts.table(&recording.rig.parameter_names(), advice.as_ref());
    add_errors(&mut rows, recording, run);
    rows
}

/// Enters the errors of the last step against the ground truth, where it is known.
pub fn add_errors(rows: &mut [FlightParameter], recording: &Recording, run: &RunRecord) {
    let (Some(truth), Some(last)) = (&recording.ground_truth_rig, run.steps.last()) else { return };
    let values = run.values_in(truth, &recording.rig, &last.report.calibration).unwrap_or_default();
    for row in rows {
        let true_value = values.iter().find(|(parameter, _)| *parameter == row.parameter);
        row.error = true_value.map(|(_, value)| row.dimension.difference(row.value, *value));
    }
}

/// For example `; σ × 1.35`: the factor on standard deviations; empty without one.
fn scale_text(rows: &[FlightParameter]) -> String {
    let scale = rows.first().map_or(1.0, |row| row.sigma_scale);
    if scale > 1.0 { format!("; σ × {scale:.2}") } else { String::new() }
}

/// Number of parameters by verdict: `18 parameters: 13 determined, 5 weakly determined; σ × 1.35`.
pub fn flight_headline(rows: &[FlightParameter]) -> String {
    let counted = Determination::all().filter_map(|verdict| {
        let count = rows.iter().filter(|row| row.verdict == verdict).count();
        (count > 0).then(|| format!("{count} {}", verdict.name()))
    });
    let noun = if rows.len() == 1 { "parameter" } else { "parameters" };
    format!("{} {noun}: {}{}", rows.len(), counted.collect::<Vec<_>>().join(", "), scale_text(rows))
}

/// Parameter with the largest ratio of σ and required accuracy among those that another flight could improve.
pub fn least_determined(rows: &[FlightParameter]) -> Option<&FlightParameter> {
    let improvable = rows.iter().filter(|row| row.verdict.is_improvable());
    improvable.max_by(|a, b| a.of_required().unwrap_or(0.0).total_cmp(&b.of_required().unwrap_or(0.0)))
}
