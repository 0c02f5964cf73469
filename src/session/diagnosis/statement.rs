//! Causes in words, with the values that their trials estimate.

use super::hypotheses::TrialHypothesis;
use super::trial::{DiagnosedRun, TrialResult};
use crate::calibration::transform_distance;
use crate::faults::{FaultKind, Subject};
use crate::gimbal::{ParameterId, ParameterPart, Quantity};

/// Statement and remedy of a cause; `from_s` is the stamp from which on its change acts, `None` for the whole run.
pub(super) fn texts(
    run: &DiagnosedRun<'_>,
    hypothesis: &TrialHypothesis,
    result: &TrialResult,
    from_s: Option<f64>,
) -> (String, String) {
    let camera = run.camera_key;
    let subject = Subject { rig: run.rig, camera_key: camera };
    let (statement, remedy) = match hypothesis.changes.corrections.as_slice() {
        [first, rest @ ..] if hypothesis.cause != FaultKind::Intrinsics => {
            let (statement, remedy) = subject.by_residuals(first);
            match rest.first().map(|second| subject.by_residuals(second)) {
                Some((second, other)) => (format!("{statement}, and {second}"), format!("{remedy}; {other}")),
                None => (statement, remedy),
            }
        }
        _ => subject.by_estimate(hypothesis.cause, &estimates(run, hypothesis, result)),
    };
    let Some(from_s) = from_s else { return (statement, remedy) };
    let remedy = match hypothesis.cause {
        FaultKind::Focal | FaultKind::Zoom => format!(
            "fix the zoom of {camera}; of this recording use --duration {from_s:.1}, or the rest with another rig"
        ),
        _ => format!("{remedy}; it holds from {from_s:.2} s on, before that the rig is right"),
    };
    (format!("{statement} from {from_s:.2} s on"), remedy)
}

/// Values of a cause that its trial estimates or assumes, with their standard deviations.
fn estimates(run: &DiagnosedRun<'_>, hypothesis: &TrialHypothesis, result: &TrialResult) -> Vec<(f64, f64)> {
    let changes = &hypothesis.changes;
    let of_camera = |quantities: &[Quantity]| -> Vec<(f64, f64)> {
        let parameter = |quantity: &Quantity| ParameterId { part: ParameterPart::Camera(0), quantity: *quantity };
        quantities.iter().filter_map(|quantity| result.calibration.get(&parameter(quantity)).copied()).collect()
    };
    match hypothesis.cause {
        FaultKind::Shutter => of_camera(&[Quantity::Readout]),
        FaultKind::Intrinsics => of_camera(&[Quantity::Fx, Quantity::Fy, Quantity::Cx, Quantity::Cy]),
        FaultKind::Chain => chain_change(run, result).map_or_else(Vec::new, |pair| pair.map(|it| (it, 0.0)).to_vec()),
        FaultKind::ImuNoise => vec![(changes.imu_noise, 0.0)],
        FaultKind::EncoderNoise => vec![(changes.encoder_noise, 0.0)],
        _ => Vec::new(),
    }
}

/// Distance in metres and angle in radians between the camera's poses by the rig and by a trial, at its last joint angles.
fn chain_change(run: &DiagnosedRun<'_>, result: &TrialResult) -> Option<[f64; 2]> {
    let (found, given) = (result.chain.as_ref()?, run.rig.chain_of_camera(run.camera_key)?);
    let angles = &result.joints_rad.last()?.1;
    let fits = found.links.len() == angles.len() && given.links.len() == angles.len();
    fits.then(|| transform_distance(&found.imu_from_camera(angles), &given.imu_from_camera(angles)).into())
}
