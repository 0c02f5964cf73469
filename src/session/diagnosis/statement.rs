//! Causes in words, with the values that their trials estimate.

use super::hypotheses::TrialHypothesis;
use super::ranking::RankedTrial;
use super::refinement::estimated_lens;
use super::trial::{DiagnosedRun, TrialResult};
use crate::calibration::transform_distance;
use crate::estimator::SensorParameters;
use crate::faults::{Fault, FaultKind, Subject};
use crate::gimbal::{ParameterId, ParameterPart, Quantity};

/// Statement and remedy of a cause; `from_s` is the stamp from which on its change acts, `None` for the whole run.
pub(super) fn texts(run: &DiagnosedRun<'_>, trial: &RankedTrial, from_s: Option<f64>) -> (String, String) {
    let subject = Subject { rig: run.rig, camera_key: run.camera_key };
    let faults = faults(run, &trial.hypothesis, &trial.result).into_iter();
    let in_words = if trial.beyond_search { Subject::sentence_beyond_search } else { Subject::sentence };
    let sentences = faults.map(|fault| in_words(&subject, &Fault { since_s: from_s, ..fault }));
    let (statements, remedies): (Vec<String>, Vec<String>) =
        sentences.map(|sentence| (sentence.statement, sentence.remedy)).unzip();
    (statements.join(", and "), remedies.join("; "))
}

/// Faults that a trial undoes, with the values that it estimates or assumes.
fn faults(run: &DiagnosedRun<'_>, hypothesis: &TrialHypothesis, result: &TrialResult) -> Vec<Fault> {
    let (cause, changes) = (hypothesis.cause, &hypothesis.changes);
    let values = match cause {
        _ if changes.estimated.contains(&SensorParameters::Intrinsics) => {
            estimated_lens(run, changes, result).map_or_else(Vec::new, Vec::from)
        }
        _ if !changes.corrections.is_empty() => return changes.corrections.clone(),
        FaultKind::Shutter => {
            let readout = ParameterId { part: ParameterPart::Camera(0), quantity: Quantity::Readout };
            let (readout_s, sigma_s) = result.calibration.get(&readout).copied().unwrap_or_default();
            vec![readout_s, sigma_s]
        }
        FaultKind::Chain => chain_change(run, result).map_or_else(Vec::new, Vec::from),
        FaultKind::ImuNoise => vec![changes.imu_noise],
        FaultKind::EncoderNoise => vec![changes.encoder_noise],
        _ => Vec::new(),
    };
    vec![Fault::new(cause, &values)]
}

/// Distance in metres and angle in radians between the camera's poses by the rig and by a trial, at its last joint angles.
fn chain_change(run: &DiagnosedRun<'_>, result: &TrialResult) -> Option<[f64; 2]> {
    let (found, given) = (result.chain.as_ref()?, run.rig.chain_of_camera(run.camera_key)?);
    let angles = &result.joints_rad.last()?.1;
    let fits = found.links.len() == angles.len() && given.links.len() == angles.len();
    fits.then(|| transform_distance(&found.imu_from_camera(angles), &given.imu_from_camera(angles)).into())
}
