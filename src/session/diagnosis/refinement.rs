//! Values of causes from the trials so far: better hypotheses of the same kinds.

use super::hypotheses::TrialHypothesis;
use super::ranking::RankedTrial;
use super::scoring::Trials;
use super::trial::{DiagnosedRun, TrialResult};
use super::tuning::rounded;
use crate::estimator::SensorParameters;
use crate::faults::{Explanation as _, Fault, FaultKind, LONGEST_SHIFT_S};
use crate::gimbal::{ParameterId, ParameterPart, Quantity};
use crate::session::plan::ForkChanges;

/// Smallest shift that is worth a trial, in seconds.
const LEAST_SHIFT_S: f64 = 5e-4;
/// Smallest relative change of the focal length that is worth a trial.
const LEAST_FOCAL: f64 = 2e-3;
/// Smallest offset of a joint that is worth a trial, in radians (1°).
const LEAST_OFFSET_RAD: f64 = 0.017;
/// Smallest and largest factor on the noise of the encoders that is worth a trial.
const NOISE_FACTORS: [f64; 2] = [1.1, 1e3];
/// Fewest steps on either side of a change of a joint's offset.
const STEPS_BESIDE: usize = 15;

/// Hypotheses of the same kinds with values that the columns and residuals of the trials estimate.
pub(super) fn refined(run: &DiagnosedRun<'_>, trials: &Trials) -> Vec<TrialHypothesis> {
    let (mut all, candidates) = (Vec::new(), &trials.others);
    for candidate in candidates {
        let changes = &candidate.hypothesis.changes;
        if changes.estimated.contains(&SensorParameters::Timeshift) {
            all.extend(shifts(run, &candidate.result));
        }
        if changes.estimated.contains(&SensorParameters::Intrinsics) {
            let factor = focal(run, candidate).map(rounded);
            all.extend(factor.map(|factor| TrialHypothesis::correction(Fault::new(FaultKind::Focal, &[factor]))));
        }
    }
    let best_of = |cause: FaultKind| {
        let of_cause = candidates.iter().filter(|it| it.hypothesis.cause == cause && it.hypothesis.from.is_none());
        RankedTrial::best(of_cause)
    };
    if let Some(best) = best_of(FaultKind::Focal).filter(|_| run.spec.calibrate && !run.spec.intrinsics) {
        // The columns of the intrinsics find the rest of the error from here; the result is refined once more.
        let estimated = [SensorParameters::Intrinsics].into();
        let changes = ForkChanges { estimated, ..best.hypothesis.changes.clone() };
        all.push(TrialHypothesis::change(FaultKind::Intrinsics, changes, best.hypothesis.parameters + 4));
    }
    if let Some(best) = best_of(FaultKind::EncoderNoise) {
        let factor = best.hypothesis.changes.encoder_noise * best.misfit.factors[1].mean_square().sqrt();
        if factor > NOISE_FACTORS[0] && factor < NOISE_FACTORS[1] {
            let changes = ForkChanges { encoder_noise: rounded(factor), ..ForkChanges::default() };
            all.push(TrialHypothesis::change(FaultKind::EncoderNoise, changes, 1));
        }
    }
    let noises =
        candidates.iter().filter(|it| it.hypothesis.cause == FaultKind::EncoderNoise && it.hypothesis.from.is_none());
    let widest = noises
        .max_by(|one, other| one.hypothesis.changes.encoder_noise.total_cmp(&other.hypothesis.changes.encoder_noise));
    if let Some(widest) = widest.filter(|widest| trials.is_promising(widest)) {
        all.extend(offsets(run, &widest.result));
    }
    all
}

/// Value of a column of a trial.
fn value(result: &TrialResult, part: ParameterPart, quantity: Quantity) -> Option<f64> {
    result.calibration.get(&ParameterId { part, quantity }).map(|(value, _)| *value)
}

/// Shifts of each clock alone and of both from the columns of time offsets.
fn shifts(run: &DiagnosedRun<'_>, result: &TrialResult) -> Vec<TrialHypothesis> {
    let given_s = run.rig.camera(run.camera_key).map_or(0.0, |camera| camera.timeshift_cam_imu_s);
    let camera = value(result, ParameterPart::Camera(0), Quantity::Timeshift).map(|total_s| total_s - given_s);
    let encoder = value(result, ParameterPart::Encoder, Quantity::Timeshift);
    let usable = |shift_s: &f64| (LEAST_SHIFT_S..=LONGEST_SHIFT_S).contains(&shift_s.abs());
    let fault = |kind, shift_s: Option<f64>| shift_s.filter(usable).map(|it| Fault::new(kind, &[rounded(it)]));
    let both = [fault(FaultKind::CameraClock, camera), fault(FaultKind::EncoderClock, encoder)];
    let mut all: Vec<TrialHypothesis> = both.iter().flatten().cloned().map(TrialHypothesis::correction).collect();
    if let [Some(camera), Some(encoder)] = both {
        all.push(TrialHypothesis::corrections(FaultKind::Clocks, vec![camera, encoder]));
    }
    all
}

/// Factor on the rig's focal length from the columns of the intrinsics and the factor that the trial already has.
fn focal(run: &DiagnosedRun<'_>, candidate: &RankedTrial) -> Option<f64> {
    let [factor, ..] = estimated_lens(run, &candidate.hypothesis.changes, &candidate.result)?;
    ((factor - 1.0).abs() > LEAST_FOCAL && (0.1..10.0).contains(&factor)).then_some(factor)
}

/// Values of [`FaultKind::Intrinsics`] from the columns of the intrinsics of a trial and the focal lengths that its changes
/// already correct.
pub(super) fn estimated_lens(run: &DiagnosedRun<'_>, changes: &ForkChanges, result: &TrialResult) -> Option<[f64; 3]> {
    let [fx, fy, cx, cy, ..] = run.rig.camera(run.camera_key).ok()?.model.intrinsics();
    let column = |quantity| value(result, ParameterPart::Camera(0), quantity);
    let ratio = 0.5 * (column(Quantity::Fx)? / fx + column(Quantity::Fy)? / fy);
    let known: f64 = changes.corrections.iter().map(|fault| fault.lens().focal).product();
    // Corrected pixels have the scale of the rig's camera: their errors are smaller by the factor.
    let centre = [(column(Quantity::Cx)? - cx) / fx, (column(Quantity::Cy)? - cy) / fy];
    Some([known * ratio, known * centre[0], known * centre[1]])
}

/// Constant and stepping offsets of each joint, from the joint angles of a trial that hardly uses the readings.
fn offsets(run: &DiagnosedRun<'_>, result: &TrialResult) -> Vec<TrialHypothesis> {
    let mut all = Vec::new();
    for (joint, name) in run.rig.joint_names().into_iter().enumerate() {
        let differences: Vec<(usize, f64)> = result
            .joints_rad
            .iter()
            .filter_map(|(step, angles)| {
                let reading = run.inputs.get(*step)?.joint_angles.as_ref()?;
                Some((*step, angles.get(joint)? - reading.angles_rad.get(joint)?))
            })
            .collect();
        let Some((step, before, after)) = change_point(&differences) else { continue };
        let offset = |offset_rad: f64| {
            TrialHypothesis::correction(Fault::new(FaultKind::JointOffset, &[rounded(offset_rad)]).of_joints([&name]))
        };
        if (after - before).abs() > LEAST_OFFSET_RAD {
            all.push(offset(after - before).starting(step));
        }
        let mean = differences.iter().map(|(_, difference)| difference).sum::<f64>() / differences.len() as f64;
        if mean.abs() > LEAST_OFFSET_RAD {
            all.push(offset(mean));
        }
    }
    all
}

/// Step at which a constant changes with the least squared error, and the means before and after it; `None` with too few
/// values.
fn change_point(values: &[(usize, f64)]) -> Option<(usize, f64, f64)> {
    let mean = |part: &[(usize, f64)]| part.iter().map(|(_, value)| value).sum::<f64>() / part.len() as f64;
    let squares = |part: &[(usize, f64)]| {
        let mean = mean(part);
        part.iter().map(|(_, value)| (value - mean).powi(2)).sum::<f64>()
    };
    let places = STEPS_BESIDE..values.len().checked_sub(STEPS_BESIDE)?;
    let cost = |place: &usize| squares(&values[..*place]) + squares(&values[*place..]);
    let place = places.min_by(|one, other| cost(one).total_cmp(&cost(other)))?;
    Some((values[place].0, mean(&values[..place]), mean(&values[place..])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_of_an_offset_is_found() {
        let values: Vec<(usize, f64)> = (40..140)
            .map(|step| (step, if step < 87 { 0.01 } else { -0.34 } + 0.003 * ((step * 37 % 11) as f64 - 5.0)))
            .collect();
        let (step, before, after) = change_point(&values).unwrap();
        assert_eq!(step, 87);
        assert!((before - 0.01).abs() < 2e-3 && (after + 0.34).abs() < 2e-3, "{before} {after}");
        assert_eq!(change_point(&values[..20]), None);
    }
}
