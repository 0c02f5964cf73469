//! Hypotheses that undo the faults which the check of a log measures.

use super::axes::PlausibleAxes;
use super::hypotheses::{Cause, TrialHypothesis, ZOOM_S, axes_hypotheses, flips, uses_encoders, wider_chain_priors};
use super::trial::DiagnosedRun;
use super::tuning::rounded;
use crate::estimator::SensorParameters;
use crate::geometry::ns_from_seconds;
use crate::log_check::{FaultySource, Finding, MeasuredFault, Severity};
use crate::session::plan::{ForkChanges, LONGEST_SHIFT_S, MeasurementCorrection};

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
        let mut all: Vec<MeasurementCorrection> = Vec::new();
        for finding in findings {
            let of_faults: Vec<Vec<TrialHypothesis>> =
                finding.faults.iter().filter_map(|fault| hypotheses(run, fault)).collect();
            let undone: Vec<TrialHypothesis> = of_faults.concat();
            undoing.has_irreversible |=
                undone.is_empty() && !of_faults.is_empty() && finding.severity == Severity::Error;
            undoing.since = undoing.since.or_else(|| undone.iter().find_map(|it| it.from));
            if let ([_], Some(first)) = (&*finding.faults, undone.first().filter(|it| it.from.is_none())) {
                all.extend(first.changes.corrections.iter().cloned());
            }
            undoing.hypotheses.extend(undone);
        }
        let is_known = undoing.hypotheses.iter().any(|it| it.changes.corrections == all);
        if all.len() > 1 && !is_known {
            let first = undoing.hypotheses.first().map_or(Cause::Clocks, |it| it.cause);
            undoing.hypotheses.push(TrialHypothesis::corrections(first, all));
        }
        undoing
    }
}

/// Hypotheses for one fault, none if no change of a run undoes it; `None` if the run does not use what is faulty.
fn hypotheses(run: &DiagnosedRun<'_>, fault: &MeasuredFault) -> Option<Vec<TrialHypothesis>> {
    let of_run = |camera_key: &str| (camera_key == run.camera_key).then_some(());
    let of_joints = || uses_encoders(run).then_some(());
    let step_at = |time_s: f64| run.step_at(ns_from_seconds(time_s));
    let one = |cause, correction| vec![TrialHypothesis::correction(cause, correction)];
    Some(match fault {
        MeasuredFault::FocalLength { camera_key, ratio } => {
            of_run(camera_key)?;
            one(Cause::Focal, MeasurementCorrection::Focal(rounded(*ratio)))
        }
        MeasuredFault::Zoom { camera_key, since_s, ratio } => {
            of_run(camera_key)?;
            let zoom = |over_s: f64| {
                let zoom =
                    TrialHypothesis::correction(Cause::Zoom, MeasurementCorrection::Zoom(rounded(*ratio), over_s));
                // The time is that at which half of the change has been reached.
                TrialHypothesis { parameters: 2, ..zoom }.starting(step_at(since_s - 0.5 * over_s))
            };
            ZOOM_S.map(zoom).to_vec()
        }
        MeasuredFault::PrincipalPoint { camera_key } => {
            of_run(camera_key)?;
            column(run, Cause::Intrinsics, SensorParameters::Intrinsics, run.spec.intrinsics, 4)?
        }
        MeasuredFault::Readout { camera_key } => {
            of_run(camera_key)?;
            column(run, Cause::Shutter, SensorParameters::Readout, run.spec.readout, 1)?
        }
        MeasuredFault::Orientation { camera_key } => {
            of_run(camera_key)?;
            if run.spec.calibrate { wider_chain_priors(run).collect() } else { Vec::new() }
        }
        MeasuredFault::ImagesTurned { camera_key } => {
            of_run(camera_key)?;
            flips().collect()
        }
        MeasuredFault::CameraShift { camera_key, shift_s } => {
            of_run(camera_key)?;
            shift(Cause::CameraClock, *shift_s, MeasurementCorrection::CameraShift)
        }
        MeasuredFault::JointShift { shift_s } => {
            of_joints()?;
            shift(Cause::EncoderClock, *shift_s, MeasurementCorrection::JointShift)
        }
        MeasuredFault::JointsReversed(joints) => {
            of_joints()?;
            let reversed = joints.iter().map(|joint| MeasurementCorrection::Reversed(joint.clone()));
            vec![TrialHypothesis::corrections(Cause::JointReversed, reversed.collect())]
        }
        MeasuredFault::JointsExchanged(pairs) => {
            of_joints()?;
            let swapped =
                pairs.iter().map(|[first, second]| MeasurementCorrection::Swapped(first.clone(), second.clone()));
            vec![TrialHypothesis::corrections(Cause::JointsSwapped, swapped.collect())]
        }
        MeasuredFault::JointOffset { joint, offset_rad, since_s } => {
            of_joints()?;
            let offset = TrialHypothesis::correction(
                Cause::JointOffset,
                MeasurementCorrection::Offset(joint.clone(), rounded(*offset_rad)),
            );
            vec![since_s.map_or(offset.clone(), |since_s| offset.starting(step_at(since_s)))]
        }
        MeasuredFault::JointUnit(factor) => {
            of_joints()?;
            one(Cause::JointScale, MeasurementCorrection::JointScale(*factor))
        }
        MeasuredFault::GyroscopeScale(factor) => {
            one(Cause::GyroscopeScale, MeasurementCorrection::GyroscopeScale(rounded(*factor)))
        }
        MeasuredFault::AccelerometerScale(factor) => {
            one(Cause::AccelerometerScale, MeasurementCorrection::AccelerometerScale(rounded(*factor)))
        }
        MeasuredFault::GyroscopeAxes(axes) => {
            axes_hypotheses(&PlausibleAxes { gyroscope: vec![*axes], ..PlausibleAxes::default() })
        }
        MeasuredFault::AccelerometerAxes(axes) => {
            axes_hypotheses(&PlausibleAxes { accelerometer: vec![*axes], ..PlausibleAxes::default() })
        }
        MeasuredFault::Irreversible(source) => {
            match source {
                FaultySource::Imu => {}
                FaultySource::Joints => of_joints()?,
                FaultySource::Camera(camera_key) => of_run(camera_key)?,
            }
            Vec::new()
        }
    })
}

/// Shift of a clock; none beyond those of which a fork has the samples.
fn shift(cause: Cause, shift_s: f64, correction: fn(f64) -> MeasurementCorrection) -> Vec<TrialHypothesis> {
    let is_possible = shift_s.abs() <= LONGEST_SHIFT_S;
    is_possible.then(|| TrialHypothesis::correction(cause, correction(rounded(shift_s)))).into_iter().collect()
}

/// Estimate of columns, none in a run without calibration; `None` if the run estimates them.
fn column(
    run: &DiagnosedRun<'_>,
    cause: Cause,
    columns: SensorParameters,
    is_estimated: bool,
    parameters: usize,
) -> Option<Vec<TrialHypothesis>> {
    let changes = ForkChanges { estimated: [columns].into(), ..ForkChanges::default() };
    let estimate = run.spec.calibrate.then(|| TrialHypothesis::change(cause, changes, parameters));
    (!is_estimated).then(|| estimate.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::log_check::Area;
    use crate::session::plan::RunSpec;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    fn finding(severity: Severity, faults: &[MeasuredFault]) -> Finding {
        let (title, evidence, remedy) = Default::default();
        Finding { severity, area: Area::Time, title, evidence, remedy, is_assumption: false, faults: faults.to_vec() }
    }

    /// Texts of the changes that undo faults in a run, and whether an error cannot be undone.
    fn undone(spec: &str, findings: &[Finding]) -> (Vec<String>, bool) {
        let rig = synthetic_tracks(&SyntheticOptions { duration_s: 0.1, ..SyntheticOptions::default() }).given_rig;
        let spec: RunSpec = spec.parse().unwrap();
        let interrupted = AtomicBool::new(false);
        let run =
            DiagnosedRun { rig: &rig, spec: &spec, camera_key: "cam0", inputs: Vec::new(), interrupted: &interrupted };
        let undoing = Undoing::of(&run, findings);
        (undoing.hypotheses.iter().map(|it| it.changes.to_string()).collect(), undoing.has_irreversible)
    }

    fn focal(camera_key: &str) -> MeasuredFault {
        MeasuredFault::FocalLength { camera_key: camera_key.to_owned(), ratio: 0.769_23 }
    }

    #[test]
    fn faults_of_what_a_run_does_not_use_are_left_out() {
        let reversed = MeasuredFault::JointsReversed(vec!["yaw".to_owned()]);
        let joints = MeasuredFault::Irreversible(FaultySource::Joints);
        let errors = [focal("cam7"), reversed, joints].map(|fault| finding(Severity::Error, &[fault]));
        assert_eq!(undone("auto:encoder=off", &errors), (Vec::new(), false));
        assert_eq!(undone("auto", &errors), (vec!["correct=reversed:yaw".to_owned()], true));
        let readout = finding(Severity::Error, &[MeasuredFault::Readout { camera_key: "cam0".to_owned() }]);
        assert_eq!(undone("auto:readout=on", &[readout]), (Vec::new(), false));
    }

    #[test]
    fn faults_are_undone_alone_and_together() {
        let shift = MeasuredFault::CameraShift { camera_key: "cam0".to_owned(), shift_s: -0.04 };
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
        let late = finding(Severity::Error, &[MeasuredFault::JointShift { shift_s: -0.08 }]);
        assert_eq!(undone("auto", std::slice::from_ref(&late)), (Vec::new(), true));
        assert_eq!(undone("auto", &[Finding { severity: Severity::Warning, ..late }]), (Vec::new(), false));
    }
}
