//! Faults that the check of a log finds, and hypotheses that undo those which it measures.

use std::cell::OnceCell;
use std::path::Path;
use std::sync::Arc;

use super::axes::PlausibleAxes;
use super::hypotheses::{
    TrialHypothesis, ZOOM_S, axes_hypotheses, corrections, estimate, uses_encoders, wider_chain_priors,
};
use super::trial::DiagnosedRun;
use super::tuning::rounded;
use crate::faults::{Fault, FaultKind, Sensor, Severity};
use crate::flight_log::FlightLog;
use crate::geometry::ns_from_seconds;
use crate::log_check::{Finding, Verdict};
use crate::sensors::Rig;
use crate::session::engine::check_log;

/// Faults of a sensor that disagrees with all others: no change of a run undoes them.
const ISOLATED: [FaultKind; 2] = [FaultKind::UnusableImu, FaultKind::UnusableJoints];

/// Changes that undo measured faults.
#[derive(Debug, Default)]
pub(super) struct Undoing {
    /// One or a few for each fault, and one for all of them that have no alternative together.
    pub(super) hypotheses: Vec<TrialHypothesis>,
    /// Step from which on the first fault that has a beginning acts.
    pub(super) since: Option<usize>,
    /// True if an error is not among them: no change of a run undoes it.
    pub(super) has_irreversible: bool,
}

impl Undoing {
    /// Changes for the faults of findings that concern a run.
    pub(super) fn of(run: &DiagnosedRun<'_>, findings: &[Finding]) -> Self {
        let mut undoing = Self::default();
        let mut all: Vec<Fault> = Vec::new();
        for finding in findings {
            let of_faults: Vec<Vec<TrialHypothesis>> =
                finding.faults.iter().filter_map(|fault| hypotheses(run, fault)).collect();
            let undone: Vec<TrialHypothesis> = of_faults.concat();
            let is_isolated = finding.faults.iter().any(|fault| ISOLATED.contains(&fault.kind));
            let is_certain = finding.severity == Severity::Error || is_isolated;
            undoing.has_irreversible |= undone.is_empty() && !of_faults.is_empty() && is_certain;
            undoing.since = undoing.since.or_else(|| undone.iter().find_map(|it| it.from));
            if let ([_], Some(first)) = (&*finding.faults, undone.first().filter(|it| it.from.is_none())) {
                all.extend(first.changes.corrections.iter().cloned());
            }
            undoing.hypotheses.extend(undone);
        }
        let is_known = undoing.hypotheses.iter().any(|it| it.changes.corrections == all);
        if all.len() > 1 && !is_known {
            let first = undoing.hypotheses.first().map_or(FaultKind::Clocks, |it| it.cause);
            undoing.hypotheses.push(TrialHypothesis::corrections(first, all));
        }
        undoing
    }
}

/// Hypotheses for one fault, none if no change of a run undoes it; `None` if the run does not use what is faulty.
fn hypotheses(run: &DiagnosedRun<'_>, fault: &Fault) -> Option<Vec<TrialHypothesis>> {
    let row = fault.kind.row();
    let is_used = match (row.sensor, &fault.camera) {
        (Sensor::Joints, _) => uses_encoders(run),
        (_, Some(key)) => key == run.camera_key,
        _ => true,
    };
    if !is_used {
        return None;
    }
    let step_at = |time_s: f64| run.step_at(ns_from_seconds(time_s));
    // The sizes of units are exact.
    let digits = |value: &f64| if fault.kind == FaultKind::JointScale { *value } else { rounded(*value) };
    let values: Vec<f64> = fault.values.iter().map(digits).collect();
    Some(match (fault.kind, values.as_slice()) {
        (FaultKind::PrincipalPoint | FaultKind::Intrinsics | FaultKind::Shutter, _) => {
            let is_shutter = fault.kind == FaultKind::Shutter;
            let estimate = estimate(run, if is_shutter { fault.kind } else { FaultKind::Intrinsics })?;
            if run.spec.calibrate { vec![estimate] } else { Vec::new() }
        }
        (FaultKind::Chain, _) if run.spec.calibrate => wider_chain_priors(run).collect(),
        (FaultKind::ImageFlip, _) => corrections(&[fault.kind], &[]),
        (FaultKind::FocalPieces, [_, _, _, factor]) => {
            // The time is that at which half of the change has been reached.
            vec![TrialHypothesis::zoom(*factor, ZOOM_S).starting(step_at(fault.values[2] - 0.5 * ZOOM_S))]
        }
        (FaultKind::GyroscopeAxes, _) => axes_hypotheses(&PlausibleAxes {
            gyroscope: fault.axes().into_iter().collect(),
            ..PlausibleAxes::default()
        }),
        (FaultKind::JointReversed | FaultKind::JointsSwapped, _) => {
            vec![TrialHypothesis::corrections(fault.kind, fault.of_single_joints())]
        }
        _ => {
            let corrected = Fault { values, camera: None, since_s: None, ..fault.clone() };
            if !corrected.can_be_corrected(run.rig.joint_names().len()) {
                return Some(Vec::new());
            }
            let hypothesis = TrialHypothesis::correction(corrected);
            vec![fault.since_s.map_or_else(|| hypothesis.clone(), |since_s| hypothesis.starting(step_at(since_s)))]
        }
    })
}

/// Result of the check of a log, made for the first run that needs it.
#[derive(Debug, Default)]
pub struct LogFaults {
    found: OnceCell<Vec<Finding>>,
}

impl LogFaults {
    /// Faults among the findings of a check.
    pub fn among(findings: &[Finding]) -> Self {
        Self { found: OnceCell::from(Verdict::of(findings).first) }
    }

    /// At most three errors and warnings of the check, those with the largest effect on a result first; none if the log can
    /// no longer be read.
    pub(super) fn of(&self, log_path: &Path, rig: &Rig) -> &[Finding] {
        self.found.get_or_init(|| {
            let Ok(log) = FlightLog::open(log_path) else { return Vec::new() };
            check_log(&Arc::new(log), rig).verdict().first
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::log_check::{Area, Basis, FindingInterval};
    use crate::session::plan::RunSpec;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    fn finding(severity: Severity, faults: &[Fault]) -> Finding {
        let (title, evidence, remedy) = Default::default();
        let (area, interval, faults) = (Area::Time, FindingInterval::default(), faults.to_vec());
        Finding { severity, area, title, evidence, remedy, interval, basis: Basis::Measured, faults }
    }

    /// Texts of the changes that undo faults in a run, and whether an error cannot be undone.
    fn undone(spec: &str, findings: &[Finding]) -> (Vec<String>, bool) {
        let rig = synthetic_tracks(&SyntheticOptions { duration_s: 0.1, ..SyntheticOptions::default() }).given_rig;
        let spec: RunSpec = spec.parse().unwrap();
        let interrupted = AtomicBool::new(false);
        let run = DiagnosedRun::new(&rig, (&spec, "cam0"), Vec::new(), 1.0, &interrupted);
        let undoing = Undoing::of(&run, findings);
        (undoing.hypotheses.iter().map(|it| it.changes.to_string()).collect(), undoing.has_irreversible)
    }

    fn focal(camera_key: &str) -> Fault {
        Fault::new(FaultKind::Focal, &[0.769_23]).of_camera(camera_key)
    }

    #[test]
    fn faults_of_what_a_run_does_not_use_are_left_out() {
        let reversed = Fault::from(FaultKind::JointReversed).of_joints(&["yaw".to_owned()]);
        let joints = Fault::from(FaultKind::UnusableJoints);
        let errors = [focal("cam7"), reversed, joints].map(|fault| finding(Severity::Error, &[fault]));
        assert_eq!(undone("auto:encoder=off", &errors), (Vec::new(), false));
        assert_eq!(undone("auto", &errors), (vec!["correct=reversed:yaw".to_owned()], true));
        let exchanged = |key: &str| Fault::from(FaultKind::ImagesExchanged).of_camera(key);
        let of_two = |other: &str| [finding(Severity::Error, &[exchanged(other), exchanged("cam8")])];
        assert_eq!(undone("auto", &of_two("cam0")), (Vec::new(), true));
        assert_eq!(undone("auto", &of_two("cam7")), (Vec::new(), false));
        let readout = finding(Severity::Error, &[Fault::from(FaultKind::Shutter).of_camera("cam0")]);
        assert_eq!(undone("auto:readout=on", &[readout]), (Vec::new(), false));
    }

    #[test]
    fn faults_are_undone_alone_and_together() {
        let shift = Fault::new(FaultKind::CameraClock, &[-0.04]).of_camera("cam0");
        let both =
            [finding(Severity::Error, &[focal("cam0")]), finding(Severity::Warning, std::slice::from_ref(&shift))];
        let texts = ["correct=focal:0.7692", "correct=camera-shift:-0.04s", "correct=focal:0.7692+camera-shift:-0.04s"];
        assert_eq!(undone("auto", &both), (texts.map(str::to_owned).to_vec(), false));
        // Alternatives exclude each other.
        let either = [finding(Severity::Error, &[focal("cam0"), shift])];
        assert_eq!(undone("auto", &either), (texts[..2].iter().map(|&text| text.to_owned()).collect(), false));
    }

    #[test]
    fn a_delay_beyond_the_samples_of_a_fork_is_for_the_log_to_correct() {
        let late = finding(Severity::Error, &[Fault::new(FaultKind::EncoderClock, &[-0.08])]);
        assert_eq!(undone("auto", std::slice::from_ref(&late)), (Vec::new(), true));
        assert_eq!(undone("auto", &[Finding { severity: Severity::Warning, ..late }]), (Vec::new(), false));
    }
}
