//! The answer of a run in one sentence: trust in its results, the cause of a doubt, and the required accuracy.
//!
//! It is made in one place from what the check of the log measured, from the run's residuals and from its calibration.
//! Window, command line, report and files begin with it.

use serde::Serialize;

use super::truth;
use crate::faults::{Area, Fault, FaultKind, Sensor};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::gimbal::ParameterId;
use crate::log_check::{Finding, MOST_LIKELY, Trust, joint_statement, problems};
use crate::observability::Determination;
use crate::sensors::Rig;
use crate::session::misfit::agreement::{self, AgreementValue};
use crate::session::misfit::{Misfit, StepMisfit};
use crate::session::plan::ForkChanges;
use crate::session::record::{RankedCause, Recording, RunRecord, StepRecord, optional_seconds};

/// Fewest steps with a window from which the residuals of a run are judged: the first windows settle.
const JUDGED_STEPS: usize = 40;
/// Ratio of a mean residual to its limit from which results are useless: the error is then several times the noise.
const USELESS_RATIO: f64 = 4.0;

/// Source of a finding about a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingSource {
    /// The check of the log and its rig.
    Check,
    /// Measurements that the rig names and the log lacks.
    Streams,
    Initialization,
    /// Residuals that disagree with their noise.
    Residuals,
    GroundTruth,
    /// A diagnosis: what explains residuals that disagree with their noise.
    Diagnosis,
}

/// Reason why results of a run are doubtful or useless.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunFinding {
    pub trust: Trust,
    pub source: FindingSource,
    /// The reason in one sentence.
    pub statement: String,
    /// Measured values with units.
    pub evidence: String,
    /// Instruction; empty if none is known.
    pub remedy: String,
    /// Stamp from which on it holds, in nanoseconds since the log began (in files seconds); `None` for the whole run.
    #[serde(rename = "since_s", serialize_with = "optional_seconds")]
    pub since_ns: Option<i64>,
    /// Stamp up to which it holds, as `since_ns`; `None` for the end of the run.
    #[serde(rename = "until_s", serialize_with = "optional_seconds")]
    pub until_ns: Option<i64>,
    /// Finding of the check with the faults of measurements or rig.
    #[serde(skip)]
    pub checked: Option<Finding>,
    /// Cause that a diagnosis found.
    #[serde(skip)]
    pub cause: Option<RankedCause>,
}

impl RunFinding {
    /// Statement and remedy in one line, without the evidence.
    pub fn sentence(&self) -> String {
        let remedy = if self.remedy.is_empty() { String::new() } else { format!("; {}", self.remedy) };
        format!("{}{remedy}", self.statement)
    }

    /// True for a finding of the check about measurements or rig that residuals follow from: it is said before them, also
    /// where they are worse than it says. Images and motion are rather conditions of a flight, and no residual depends on
    /// the ground truth.
    fn is_cause(&self) -> bool {
        let of_measurements = |finding: &Finding| !matches!(finding.area, Area::Images | Area::Motion);
        self.checked.as_ref().is_some_and(of_measurements) && !self.is_about_ground_truth()
    }

    /// True if it concerns errors against the ground truth, which the estimate does not depend on.
    pub(super) fn is_about_ground_truth(&self) -> bool {
        self.source == FindingSource::GroundTruth || self.checked.as_ref().is_some_and(is_about_ground_truth)
    }

    /// Time from which on all later results are affected, in seconds since the log began; `None` for the whole run, and for a
    /// finding of the check about single messages.
    fn onset_s(&self) -> Option<f64> {
        self.checked.as_ref().map_or_else(|| self.since_ns.map(seconds_from_ns), Finding::since_s)
    }

    /// Subject of its fault; `None` for a finding of the run itself.
    pub fn area(&self) -> Option<Area> {
        let of_cause = || self.cause.as_ref().map(|cause| cause.cause.row().area);
        self.checked.as_ref().map(|finding| finding.area).or_else(of_cause)
    }

    /// Fault of measurements or rig; `None` if none is known.
    pub fn fault(&self) -> Option<&Fault> {
        let of_cause = || self.cause.as_ref().map(|cause| &cause.changes.corrections);
        self.checked.as_ref().map(|finding| &finding.faults).or_else(of_cause)?.first()
    }

    /// Changes of a fork that undo the fault, and the stamp of its first step in nanoseconds since the log began; `None` if
    /// no fault is known or no constant correction undoes it.
    pub fn correction(&self, rig: &Rig) -> Option<(ForkChanges, i64)> {
        if let Some(cause) = self.cause.as_ref().filter(|cause| !cause.beyond_search) {
            return Some((cause.changes.clone(), cause.from_ns));
        }
        let [fault] = self.checked.as_ref()?.faults.as_slice() else { return None };
        if !fault.can_be_corrected(rig.joint_names().len()) {
            return None;
        }
        let corrections = match fault.kind {
            FaultKind::JointReversed | FaultKind::JointsSwapped => fault.of_single_joints(),
            _ => vec![Fault { camera: None, since_s: None, ..fault.clone() }],
        };
        Some((ForkChanges { corrections, ..ForkChanges::default() }, fault.since_s.map_or(0, ns_from_seconds)))
    }
}

/// Parameters of a run against the required accuracy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Requirement {
    /// Number of parameters whose standard deviation is at most the required one.
    pub met: usize,
    /// Number of estimated parameters, without those that are redundant in the parameterization.
    pub parameters: usize,
    /// Required accuracy in words, such as `5 mm and 0.1°`.
    pub required: String,
    /// Parameter with the largest ratio of σ to the required accuracy, with its σ; `None` if all meet it.
    pub worst: Option<String>,
    #[serde(skip)]
    pub worst_parameter: Option<ParameterId>,
    /// Time from which on all parameters meet it, in seconds since the log began.
    pub since_s: Option<f64>,
}

/// Answer of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Answer {
    pub trust: Trust,
    /// The answer in one sentence.
    pub sentence: String,
    /// First thing to do about it; empty if nothing is known.
    pub remedy: String,
    /// Findings with the largest effect first.
    pub findings: Vec<RunFinding>,
    /// `None` for a run without estimated calibration.
    pub requirement: Option<Requirement>,
}

impl Answer {
    /// Answer of a run as far as it is computed; `Recording::check` has the findings of the check if they are known.
    pub fn of_run(recording: &Recording, run: &RunRecord) -> Self {
        let check = recording.check.as_ref().map_or(&[][..], |findings| findings.as_slice());
        Self::of(&recording.rig, check, run)
    }

    /// True for a trusted run whose parameters all reach the required accuracy.
    pub fn meets_requirement(&self) -> bool {
        self.trust == Trust::Trusted && self.requirement.as_ref().is_none_or(|it| it.met == it.parameters)
    }

    /// Findings that the sentence names: the first one, or causes that are about equally likely.
    pub fn named(&self) -> &[RunFinding] {
        let likely = self.findings.iter().take_while(|it| it.statement.starts_with(MOST_LIKELY)).count();
        &self.findings[..likely.max(1).min(self.findings.len())]
    }

    /// True if residuals or start of the run are the first reason to doubt, for which neither the check nor a diagnosis has a
    /// cause.
    pub fn is_unexplained(&self) -> bool {
        let source = self.findings.first().map(|first| first.source);
        matches!(source, Some(FindingSource::Residuals | FindingSource::Initialization))
    }

    /// The same from the findings of the check of the log.
    pub(in crate::session) fn of(rig: &Rig, check: &[Finding], run: &RunRecord) -> Self {
        let mut findings: Vec<RunFinding> = check_findings(rig, check, run).collect();
        findings.extend(missing_joint_angles(rig, run));
        findings.extend(with_diagnosis(run, initialization(run).into_iter().chain(disagreement(run)).collect()));
        // A stable sort: the sources have the order of what they say about a cause.
        findings.sort_by_key(|finding| (!finding.is_cause(), std::cmp::Reverse(finding.trust)));
        let trust = findings.iter().map(|finding| finding.trust).max().unwrap_or_default();
        let requirement = requirement(rig, run);
        let sentence = match (findings.first(), &requirement) {
            (Some(first), _) => trust.sentence(first.onset_s(), &statement(&findings)),
            (None, Some(requirement)) => requirement.sentence(),
            (None, None) => fixed_sentence(run),
        };
        let remedy = findings.first().map_or_else(String::new, |first| first.remedy.clone());
        Self { trust, sentence, remedy, findings, requirement }
    }
}

/// Statement of the first finding; causes that are about equally likely are one statement.
fn statement(findings: &[RunFinding]) -> String {
    let of_source = findings.chunk_by(|one, other| one.source == other.source).next().unwrap_or_default();
    joint_statement(&of_source.iter().map(|it| it.statement.as_str()).collect::<Vec<_>>())
}

/// Findings about the residuals or the start of a run, after the causes that a diagnosis found for them.
fn with_diagnosis(run: &RunRecord, mut findings: Vec<RunFinding>) -> Vec<RunFinding> {
    let unexplained = |it: &&mut RunFinding| it.source != FindingSource::GroundTruth;
    let trust = findings.iter().map(|it| it.trust).max().unwrap_or_default();
    let (Some(first), Some(diagnosis)) = (findings.iter_mut().find(unexplained), &run.diagnosis) else {
        return findings;
    };
    // The check states the faults that it measures itself.
    if diagnosis.is_open() || diagnosis.explaining == 0 || diagnosis.measured {
        first.remedy = format!("diagnosis: {}", diagnosis.headline());
        return findings;
    }
    let explaining = diagnosis.causes.iter().take(diagnosis.explaining);
    let causes = explaining.map(|cause| RunFinding {
        trust,
        source: FindingSource::Diagnosis,
        statement: if diagnosis.explaining == 1 { cause.statement.clone() } else { cause.as_alternative() },
        evidence: format!("with this change: {}", cause.text()),
        remedy: cause.remedy.clone(),
        since_ns: cause.since_ns,
        until_ns: None,
        checked: None,
        cause: Some(cause.clone()),
    });
    causes.chain(findings).collect()
}

/// Sentence about a trusted run without estimated parameters.
fn fixed_sentence(run: &RunRecord) -> String {
    if run.steps.iter().any(|step| step.report.newest().is_some()) {
        let mark = Trust::Trusted.mark();
        format!("{mark} Nothing speaks against the estimate; the calibration is fixed at the values of the rig")
    } else {
        "… Waiting for the first estimate".to_owned()
    }
}

/// Findings of the check that concern a run and that the run does not correct.
fn check_findings<'a>(rig: &'a Rig, check: &'a [Finding], run: &'a RunRecord) -> impl Iterator<Item = RunFinding> + 'a {
    let relevant =
        problems(check).into_iter().filter(|finding| concerns(finding, rig, run) && !is_undone(finding, run));
    relevant.filter_map(|finding| {
        let trust = Trust::after(finding);
        (trust > Trust::Trusted).then(|| RunFinding {
            trust: if is_about_ground_truth(finding) { Trust::Doubtful } else { trust },
            source: FindingSource::Check,
            statement: finding.title.clone(),
            evidence: finding.evidence.clone(),
            remedy: finding.remedy.clone(),
            since_ns: finding.interval.since_s.or_else(|| finding.since_s()).map(ns_from_seconds),
            until_ns: finding.interval.until_s.map(ns_from_seconds),
            checked: Some(finding.clone()),
            cause: None,
        })
    })
}

/// True if the ground truth is the subject of the title of a finding; others name it as what they are measured by.
fn is_about_ground_truth(finding: &Finding) -> bool {
    const SUBJECTS: [&str; 3] =
        ["the ground truth ", "the world of the ground truth ", "unexplained: the rotations of the ground truth "];
    SUBJECTS.iter().any(|subject| finding.title.starts_with(subject))
}

/// True unless a finding is about a camera or about joint angles that the run does not use. The title of a finding names
/// its camera.
fn concerns(finding: &Finding, rig: &Rig, run: &RunRecord) -> bool {
    let uses_joints = run.spec.encoder && run.steps.last().is_none_or(|step| has_joints(step));
    let of_joints = |kind: FaultKind| kind.row().sensor == Sensor::Joints;
    let about_joints = match finding.faults.as_slice() {
        [] => finding.area == Area::Encoders,
        faults => faults.iter().all(|fault| of_joints(fault.kind)),
    };
    if about_joints && !uses_joints {
        return false;
    }
    let names = |key: &str| {
        finding.title.split(|letter: char| !letter.is_alphanumeric() && letter != '_').any(|word| word == key)
    };
    let used = run.last_camera_keys();
    let named: Vec<&str> = rig.cameras.iter().map(|it| it.key.as_str()).filter(|key| names(key)).collect();
    named.is_empty() || named.iter().any(|key| used.contains(key))
}

fn has_joints(step: &StepRecord) -> bool {
    !step.report.calibration.classical.links.is_empty()
}

/// True if the run corrects a fault of the finding, or estimates the values that it concerns, and its residuals agree with
/// their noise.
fn is_undone(finding: &Finding, run: &RunRecord) -> bool {
    let corrected = |kind: FaultKind| {
        run.origin.as_ref().is_some_and(|origin| origin.changes.corrections.iter().any(|fault| fault.kind == kind))
    };
    let estimated = |kind: FaultKind| match kind {
        FaultKind::Focal | FaultKind::PrincipalPoint | FaultKind::Intrinsics => run.spec.intrinsics,
        FaultKind::CameraClock | FaultKind::EncoderClock | FaultKind::Clocks => run.spec.timeshift,
        FaultKind::Shutter => run.spec.readout,
        _ => false,
    };
    let is_changed = finding.faults.iter().any(|fault| corrected(fault.kind) || estimated(fault.kind));
    is_changed && judged(run).is_some_and(|(misfit, steps)| agreement::agrees(&misfit, steps))
}

/// A rig with joints and a log without joint angles: the joints are then free unknowns.
fn missing_joint_angles(rig: &Rig, run: &RunRecord) -> Option<RunFinding> {
    let last = run.steps.last()?;
    let read = |step: &StepRecord| step.report.newest().is_some_and(|newest| newest.encoder_angles_rad.is_some());
    let estimated = run.steps.iter().filter(|step| step.report.newest().is_some()).count();
    let has_sigma = rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.encoder_sigma_rad.is_some());
    if !run.spec.encoder || !has_sigma || !has_joints(last) || estimated < JUDGED_STEPS {
        return None;
    }
    (!run.steps.iter().any(|step| read(step))).then(|| RunFinding {
        trust: Trust::Doubtful,
        source: FindingSource::Streams,
        statement: "no joint angles in this log".to_owned(),
        evidence: format!("0 of {estimated} estimated frames have joint angles; they are free unknowns"),
        remedy: "record the joint angles, or name their topic in the rig".to_owned(),
        since_ns: None,
        until_ns: None,
        checked: None,
        cause: None,
    })
}

/// A run that never initialized, or that started again.
fn initialization(run: &RunRecord) -> Option<RunFinding> {
    let finding =
        |trust, statement: String, evidence: String, remedy: &str, [since_ns, until_ns]: [Option<i64>; 2]| RunFinding {
            trust,
            source: FindingSource::Initialization,
            statement,
            evidence,
            remedy: remedy.to_owned(),
            since_ns,
            until_ns,
            checked: None,
            cause: None,
        };
    let initialized = run.steps.iter().any(|step| step.report.newest().is_some());
    if !initialized {
        if !run.has_ended() {
            return None;
        }
        let reasons = run.waiting_reasons();
        let statement = match reasons.first() {
            Some((reason, images)) => {
                format!("the run never initialized: {reason} ({images} of {} images)", run.steps.len())
            }
            None => "the run never initialized: no image reached the estimator".to_owned(),
        };
        let others: Vec<String> =
            reasons.iter().skip(1).map(|(reason, images)| format!("{reason} ({images} images)")).collect();
        return Some(finding(Trust::NotUsable, statement, others.join("; "), "", [None; 2]));
    }
    let restarts = run.steps.last().map_or(0, |step| step.report.restarts);
    let first = run.steps.iter().find(|step| step.report.restarts > 0)?;
    let stamp_ns = first.report.stamp_ns;
    let last = run.steps.partition_point(|step| step.report.restarts < restarts);
    let tracks_again = run.steps.iter().skip(last).find(|step| step.report.newest().is_some());
    let until_ns = tracks_again.map(|step| step.report.stamp_ns);
    let times = if restarts == 1 { "once".to_owned() } else { format!("{restarts} times") };
    Some(finding(
        Trust::Doubtful,
        format!("the estimator failed and started again, {times}"),
        format!("first at {:.2} s", seconds_from_ns(stamp_ns)),
        "diagnose the run",
        [Some(stamp_ns), until_ns],
    ))
}

/// Residuals of a run over the steps that are judged; `None` while there are too few.
fn judged(run: &RunRecord) -> Option<(Misfit, &[StepMisfit])> {
    let initialized_ns = run.misfits.iter().find(|step| step.tracking)?.stamp_ns;
    let misfit = Misfit::of(&run.misfits, initialized_ns);
    (misfit.tracked >= JUDGED_STEPS).then_some((misfit, run.misfits.as_slice()))
}

/// Residuals that disagree with their noise; or, if they agree, a ground truth that does not fit.
fn disagreement(run: &RunRecord) -> Option<RunFinding> {
    let (misfit, steps) = judged(run)?;
    if agreement::agrees(&misfit, steps) {
        let text = if run.has_ended() { truth::disagreement(run) } else { None };
        return text.map(|text| RunFinding {
            trust: Trust::Doubtful,
            source: FindingSource::GroundTruth,
            statement: format!("the ground truth {text}"),
            evidence: "the residuals agree with their noise".to_owned(),
            remedy: "check stamps and frame of the ground truth".to_owned(),
            since_ns: None,
            until_ns: None,
            checked: None,
            cause: None,
        });
    }
    let mut wrong: Vec<AgreementValue> = agreement::values(&misfit).into_iter().filter(|it| !it.agrees()).collect();
    wrong.sort_by(|one, other| (other.value / other.limit).total_cmp(&(one.value / one.limit)));
    let largest_ratio = wrong.first().map_or(0.0, |value| value.value / value.limit);
    let statement = match wrong.first() {
        Some(value) => format!("the residuals disagree with their noise: {}", in_words(value)),
        None => "the residuals disagree with their noise in a part of the run".to_owned(),
    };
    let stamp_ns = |step: Option<usize>| step.and_then(|step| steps.get(step)).map(|step| step.stamp_ns);
    Some(RunFinding {
        trust: if largest_ratio > USELESS_RATIO { Trust::NotUsable } else { Trust::Doubtful },
        source: FindingSource::Residuals,
        statement,
        evidence: wrong.iter().map(in_words).collect::<Vec<_>>().join("; "),
        remedy: "diagnose the run".to_owned(),
        since_ns: stamp_ns(agreement::onset(steps)),
        until_ns: stamp_ns(agreement::end(steps)),
        checked: None,
        cause: None,
    })
}

/// For example `reprojection residual, median in px 5.50, at most 0.5 when sound`.
fn in_words(value: &AgreementValue) -> String {
    if value.name.ends_with("ratio") {
        let name = value.name.trim_end_matches(", ratio");
        return format!("{name} {:.0} %, at most {:.0} % when sound", 100.0 * value.value, 100.0 * value.limit);
    }
    format!("{} {:.2}, at most {} when sound", value.name, value.value, value.limit)
}

/// Parameters of the last step against the required accuracy; `None` without estimated ones.
fn requirement(rig: &Rig, run: &RunRecord) -> Option<Requirement> {
    let required = &rig.required_accuracy;
    let last = run.steps.last().filter(|_| run.spec.calibrate)?;
    let determinations = last.determinations(required);
    let counts = |verdict: &Determination| {
        !matches!(verdict, Determination::Redundant | Determination::Fixed | Determination::Initializing)
    };
    let left_out: Vec<bool> = determinations.iter().map(|(_, verdict)| !counts(verdict)).collect();
    let calibration = &last.report.calibration;
    let names = rig.parameter_names();
    let counted: Vec<(usize, ParameterId)> =
        (0..).zip(&calibration.parameters).filter(|(column, _)| !left_out[*column]).map(|(i, it)| (i, *it)).collect();
    let ratio = |(column, parameter): &(usize, ParameterId)| calibration.sigmas[*column] / required.of(*parameter);
    let worst = counted.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b))).filter(|worst| ratio(worst) > 1.0);
    let met = determinations.iter().filter(|(_, verdict)| verdict.is_met()).count();
    let all_meet = |step: &StepRecord| {
        let calibration = &step.report.calibration;
        calibration.parameters.len() == left_out.len()
            && calibration
                .parameters
                .iter()
                .zip(&calibration.sigmas)
                .zip(&left_out)
                .all(|((parameter, sigma), left_out)| *left_out || *sigma <= required.of(*parameter))
    };
    let since = run.steps.iter().rev().take_while(|step| all_meet(step)).last();
    (!counted.is_empty()).then(|| Requirement {
        met,
        parameters: counted.len(),
        required: required.text_for(counted.iter().map(|(_, parameter)| *parameter)),
        worst: worst.map(|(column, parameter)| {
            format!("{} ± {}", names.name(*parameter), parameter.shown().sigma(calibration.sigmas[*column]))
        }),
        worst_parameter: worst.map(|(_, parameter)| *parameter),
        since_s: since.filter(|_| met == counted.len()).map(|step| seconds_from_ns(step.report.stamp_ns)),
    })
}

impl Requirement {
    /// For example `⚠ 6 of 18 parameters within 5 mm and 0.1°, worst pitch.a ± 7.4 mm`.
    fn sentence(&self) -> String {
        let Self { met, parameters, required, worst, since_s, .. } = self;
        let mark = if met == parameters { Trust::Trusted.mark() } else { Trust::Doubtful.mark() };
        let worst = worst.as_ref().map_or_else(String::new, |worst| format!(", worst {worst}"));
        let since = since_s.map_or_else(String::new, |since_s| format!(", since {since_s:.1} s"));
        format!("{mark} {met} of {parameters} parameters within {required}{worst}{since}")
    }
}
