//! The causes that a diagnosis tries: each is a change of the run, with its number of parameters.

use std::collections::BTreeMap;

use super::axes::PlausibleAxes;
use super::trial::DiagnosedRun;
use crate::estimator::SensorParameters;
use crate::faults::{Fault, FaultKind};
use crate::sensors::CameraMount;
use crate::session::plan::ForkChanges;

/// A change of the run that undoes one cause.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TrialHypothesis {
    pub(super) cause: FaultKind,
    pub(super) changes: ForkChanges,
    /// Number of values that the change takes from the recording.
    pub(super) parameters: usize,
    /// Step from which on the change acts; `None` for the whole run.
    pub(super) from: Option<usize>,
}

impl TrialHypothesis {
    pub(super) fn corrections(cause: FaultKind, corrections: Vec<Fault>) -> Self {
        let parameters = corrections.len();
        Self { cause, changes: ForkChanges { corrections, ..ForkChanges::default() }, parameters, from: None }
    }

    pub(super) fn correction(fault: Fault) -> Self {
        Self::corrections(fault.kind, vec![fault])
    }

    pub(super) fn change(cause: FaultKind, changes: ForkChanges, parameters: usize) -> Self {
        Self { cause, changes, parameters, from: None }
    }

    /// The same change from a step on, whose choice is one more parameter.
    pub(super) fn starting(&self, step: usize) -> Self {
        Self { parameters: self.parameters + 1, from: Some(step), ..self.clone() }
    }

    /// Change of the focal length over a time in seconds.
    pub(super) fn zoom(factor: f64, over_s: f64) -> Self {
        Self { parameters: 2, ..Self::correction(Fault::new(FaultKind::Zoom, &[factor, over_s])) }
    }
}

/// Seconds over which a changing focal length is tried to change at first.
pub(super) const ZOOM_S: f64 = 1.0;
/// Factors on the standard deviations of the chain.
const CHAIN_FACTORS: [f64; 2] = [5.0, 25.0];

/// Hypotheses for a run. `lost` is true if the run has hardly a window: then errors are tried that no run survives.
pub(super) fn first_hypotheses(run: &DiagnosedRun<'_>, lost: Option<&PlausibleAxes>) -> Vec<TrialHypothesis> {
    let mut all = estimated_columns(run);
    let joints = if uses_encoders(run) { run.rig.joint_names() } else { Vec::new() };
    if !joints.is_empty() {
        use FaultKind::{EncoderClock, JointReversed, JointScale, JointsSwapped};
        all.extend(corrections(&[JointReversed, JointsSwapped, JointScale, EncoderClock], &joints));
        all.extend(noises(FaultKind::EncoderNoise, |changes| &mut changes.encoder_noise));
    }
    all.extend(noises(FaultKind::ImuNoise, |changes| &mut changes.imu_noise));
    all.extend(corrections(&[FaultKind::CameraClock, FaultKind::Focal, FaultKind::ImageRegion], &[]));
    // Errors with which a run hardly initializes.
    if let Some(axes) = lost {
        all.extend(corrections(&[FaultKind::ImageFlip], &[]));
        all.extend(axes_hypotheses(axes));
        all.extend(corrections(&[FaultKind::AccelerometerScale, FaultKind::GyroscopeScale], &[]));
    }
    all
}

/// Corrections of these kinds with the values of the table.
pub(super) fn corrections(kinds: &[FaultKind], joints: &[String]) -> Vec<TrialHypothesis> {
    kinds.iter().flat_map(|kind| kind.trials(joints)).map(TrialHypothesis::correction).collect()
}

/// Larger assumed noise, by the factors of the table.
fn noises(cause: FaultKind, field: fn(&mut ForkChanges) -> &mut f64) -> impl Iterator<Item = TrialHypothesis> {
    cause.row().trials.iter().map(move |factor| {
        let mut changes = ForkChanges::default();
        *field(&mut changes) = *factor;
        TrialHypothesis::change(cause, changes, 1)
    })
}

/// Hypotheses of changes at a step.
pub(super) fn changes_at(step: usize, first: &[TrialHypothesis]) -> Vec<TrialHypothesis> {
    use FaultKind::{Chain, ImageFlip, ImuAxes, Intrinsics};
    let changes = first.iter().filter(|it| !matches!(it.cause, Chain | ImageFlip | ImuAxes | Intrinsics));
    let mut all: Vec<TrialHypothesis> = changes.map(|it| it.starting(step)).collect();
    for factor in FaultKind::Zoom.row().trials {
        all.push(TrialHypothesis::zoom(*factor, ZOOM_S).starting(step));
    }
    all
}

/// Orders hypotheses so that each cause is tried with one value before any is tried with a second one.
pub(super) fn each_cause_first(hypotheses: &mut [TrialHypothesis]) {
    let mut counts: BTreeMap<(FaultKind, bool), usize> = BTreeMap::new();
    hypotheses.sort_by_cached_key(|it| {
        let count = counts.entry((it.cause, it.from.is_some())).or_default();
        *count += 1;
        *count
    });
}

/// True if the run reads joint angles.
pub(super) fn uses_encoders(run: &DiagnosedRun<'_>) -> bool {
    let gimbal = run.rig.gimbal.as_ref();
    on_gimbal(run) && run.spec.encoder && gimbal.is_some_and(|it| it.topic.is_some() && it.encoder_sigma_rad.is_some())
}

fn on_gimbal(run: &DiagnosedRun<'_>) -> bool {
    run.rig.camera(run.camera_key).is_ok_and(|camera| camera.mount == CameraMount::Gimbal)
}

/// Parameters that the run could estimate, and a wider prior of the chain.
fn estimated_columns(run: &DiagnosedRun<'_>) -> Vec<TrialHypothesis> {
    use FaultKind::{Clocks, ImuIntrinsics, Intrinsics, Shutter};
    if !run.spec.calibrate {
        return Vec::new();
    }
    let columns = [Clocks, Shutter, Intrinsics, ImuIntrinsics].into_iter().filter_map(|cause| estimate(run, cause));
    columns.chain(wider_chain_priors(run)).collect()
}

/// Estimate of the parameters whose error is a cause; `None` if the run estimates them.
pub(super) fn estimate(run: &DiagnosedRun<'_>, cause: FaultKind) -> Option<TrialHypothesis> {
    let spec = run.spec;
    let (columns, is_estimated, parameters) = match cause {
        FaultKind::Clocks => (SensorParameters::Timeshift, spec.timeshift, 1 + usize::from(uses_encoders(run))),
        FaultKind::Shutter => (SensorParameters::Readout, spec.readout, 1),
        FaultKind::Intrinsics => {
            let count = run.rig.camera(run.camera_key).map_or(4, |camera| camera.model.intrinsic_count());
            (SensorParameters::Intrinsics, spec.intrinsics, count)
        }
        FaultKind::ImuIntrinsics => (SensorParameters::ImuIntrinsics, spec.imu_intrinsics, 15),
        _ => return None,
    };
    let changes = ForkChanges { estimated: [columns].into(), ..ForkChanges::default() };
    (!is_estimated).then(|| TrialHypothesis::change(cause, changes, parameters))
}

/// Wider priors of the chain.
pub(super) fn wider_chain_priors(run: &DiagnosedRun<'_>) -> impl Iterator<Item = TrialHypothesis> {
    let parameters = if on_gimbal(run) { 6 + 4 * run.rig.joint_names().len() } else { 6 };
    CHAIN_FACTORS.into_iter().map(move |chain_prior| {
        let changes = ForkChanges { chain_prior, ..ForkChanges::default() };
        TrialHypothesis::change(FaultKind::Chain, changes, parameters)
    })
}

/// Axes of gyroscope and accelerometer together, and of each alone.
pub(super) fn axes_hypotheses(axes: &PlausibleAxes) -> Vec<TrialHypothesis> {
    let of_axes = |kind, axes| TrialHypothesis::correction(Fault::of_axes(kind, axes));
    let of_gyroscope = axes
        .gyroscope
        .iter()
        .flat_map(|axes| [FaultKind::ImuAxes, FaultKind::GyroscopeAxes].map(|kind| of_axes(kind, *axes)));
    let of_accelerometer = axes.accelerometer.iter().map(|axes| of_axes(FaultKind::AccelerometerAxes, *axes));
    of_gyroscope.chain(of_accelerometer).collect()
}
