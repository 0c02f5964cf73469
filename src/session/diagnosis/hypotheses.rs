//! The causes that a diagnosis tries: each is a change of the run, with its number of parameters.

use super::axes::PlausibleAxes;
use super::trial::DiagnosedRun;
use crate::estimator::SensorParameters;
use crate::sensors::CameraMount;
use crate::session::plan::{ForkChanges, ImageFlip, ImageHalf, MeasurementCorrection};
use crate::text::Named;

/// Cause of residuals that disagree with their noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    CameraClock,
    EncoderClock,
    /// Both of the above.
    Clocks,
    Shutter,
    Focal,
    Zoom,
    Intrinsics,
    ImageFlip,
    ImageRegion,
    JointReversed,
    JointsSwapped,
    JointScale,
    JointOffset,
    Chain,
    ImuAxes,
    GyroscopeAxes,
    AccelerometerAxes,
    GyroscopeScale,
    AccelerometerScale,
    ImuIntrinsics,
    ImuNoise,
    EncoderNoise,
}

/// Keys in the JSON.
impl Named for Cause {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::CameraClock, "camera_clock"),
        (Self::EncoderClock, "encoder_clock"),
        (Self::Clocks, "clocks"),
        (Self::Shutter, "shutter"),
        (Self::Focal, "focal_length"),
        (Self::Zoom, "zoom"),
        (Self::Intrinsics, "intrinsics"),
        (Self::ImageFlip, "image_flip"),
        (Self::ImageRegion, "image_region"),
        (Self::JointReversed, "joint_reversed"),
        (Self::JointsSwapped, "joints_swapped"),
        (Self::JointScale, "joint_scale"),
        (Self::JointOffset, "joint_offset"),
        (Self::Chain, "extrinsics"),
        (Self::ImuAxes, "imu_axes"),
        (Self::GyroscopeAxes, "gyroscope_axes"),
        (Self::AccelerometerAxes, "accelerometer_axes"),
        (Self::GyroscopeScale, "gyroscope_scale"),
        (Self::AccelerometerScale, "accelerometer_scale"),
        (Self::ImuIntrinsics, "imu_intrinsics"),
        (Self::ImuNoise, "imu_noise"),
        (Self::EncoderNoise, "encoder_noise"),
    ];
}

/// A change of the run that undoes one cause.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TrialHypothesis {
    pub(super) cause: Cause,
    pub(super) changes: ForkChanges,
    /// Number of values that the change takes from the recording.
    pub(super) parameters: usize,
    /// Step from which on the change acts; `None` for the whole run.
    pub(super) from: Option<usize>,
}

impl TrialHypothesis {
    pub(super) fn corrections(cause: Cause, corrections: Vec<MeasurementCorrection>) -> Self {
        let parameters = corrections.len();
        Self { cause, changes: ForkChanges { corrections, ..ForkChanges::default() }, parameters, from: None }
    }

    pub(super) fn correction(cause: Cause, correction: MeasurementCorrection) -> Self {
        Self::corrections(cause, vec![correction])
    }

    pub(super) fn change(cause: Cause, changes: ForkChanges, parameters: usize) -> Self {
        Self { cause, changes, parameters, from: None }
    }

    /// The same change from a step on, whose choice is one more parameter.
    pub(super) fn starting(&self, step: usize) -> Self {
        Self { parameters: self.parameters + 1, from: Some(step), ..self.clone() }
    }
}

/// Focal lengths that are tried before the best one is refined.
const FOCAL_FACTORS: [f64; 11] = [0.5, 0.6, 0.7, 0.78, 0.87, 0.95, 1.05, 1.15, 1.3, 1.5, 1.8];
/// Changes of the focal length during a recording: factors, and seconds.
const ZOOM_FACTORS: [f64; 4] = [0.6, 0.78, 1.28, 1.6];
pub(super) const ZOOM_S: [f64; 3] = [0.2, 1.0, 2.5];
/// Factors on the noise densities of the IMU and on the noise of the encoders.
const NOISE_FACTORS: [f64; 3] = [3.0, 10.0, 30.0];
/// Factors of wrong units and ranges: g and m/s², degrees and radians, half and double the range.
const ACCELEROMETER_FACTORS: [f64; 4] = [9.806_65, 1.0 / 9.806_65, 2.0, 0.5];
const GYROSCOPE_FACTORS: [f64; 4] = [std::f64::consts::PI / 180.0, 180.0 / std::f64::consts::PI, 2.0, 0.5];
/// Factors on the standard deviations of the chain.
const CHAIN_FACTORS: [f64; 2] = [5.0, 25.0];
/// Tried shifts of clocks in seconds, beside those that the columns of time offsets find.
const SHIFTS_S: [f64; 4] = [-0.04, -0.02, 0.02, 0.04];

/// Hypotheses for a run. `lost` is true if the run has hardly a window: then errors are tried that no run survives.
pub(super) fn first_hypotheses(run: &DiagnosedRun<'_>, lost: Option<&PlausibleAxes>) -> Vec<TrialHypothesis> {
    let mut all = estimated_columns(run);
    let joints = if uses_encoders(run) { run.rig.joint_names() } else { Vec::new() };
    all.extend(joint_hypotheses(&joints));
    for factor in NOISE_FACTORS {
        let changes = ForkChanges { imu_noise: factor, ..ForkChanges::default() };
        all.push(TrialHypothesis::change(Cause::ImuNoise, changes, 1));
    }
    for shift_s in SHIFTS_S {
        all.push(TrialHypothesis::correction(Cause::CameraClock, MeasurementCorrection::CameraShift(shift_s)));
    }
    for factor in FOCAL_FACTORS {
        all.push(TrialHypothesis::correction(Cause::Focal, MeasurementCorrection::Focal(factor)));
    }
    for half in ImageHalf::all() {
        all.push(TrialHypothesis::correction(Cause::ImageRegion, MeasurementCorrection::Ignored(half)));
    }
    if let Some(axes) = lost {
        all.extend(gross_hypotheses(axes));
    }
    all
}

/// Hypotheses of changes at a step.
pub(super) fn changes_at(step: usize, first: &[TrialHypothesis]) -> Vec<TrialHypothesis> {
    let whole_only = |cause| matches!(cause, Cause::Chain | Cause::ImageFlip | Cause::ImuAxes | Cause::Intrinsics);
    let mut all: Vec<TrialHypothesis> =
        first.iter().filter(|it| !whole_only(it.cause)).map(|it| it.starting(step)).collect();
    for factor in ZOOM_FACTORS {
        for over_s in ZOOM_S {
            let zoom = TrialHypothesis {
                parameters: 2,
                ..TrialHypothesis::correction(Cause::Zoom, MeasurementCorrection::Zoom(factor, over_s))
            };
            all.push(zoom.starting(step));
        }
    }
    all
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
    let spec = run.spec;
    if !spec.calibrate {
        return Vec::new();
    }
    let intrinsics = run.rig.camera(run.camera_key).map_or(4, |camera| camera.model.intrinsic_count());
    let columns = [
        (Cause::Clocks, SensorParameters::Timeshift, spec.timeshift, 1 + usize::from(uses_encoders(run))),
        (Cause::Shutter, SensorParameters::Readout, spec.readout, 1),
        (Cause::Intrinsics, SensorParameters::Intrinsics, spec.intrinsics, intrinsics),
        (Cause::ImuIntrinsics, SensorParameters::ImuIntrinsics, spec.imu_intrinsics, 15),
    ];
    let mut all: Vec<TrialHypothesis> = columns
        .into_iter()
        .filter(|(_, _, estimated, _)| !estimated)
        .map(|(cause, columns, _, parameters)| {
            let changes = ForkChanges { estimated: [columns].into(), ..ForkChanges::default() };
            TrialHypothesis::change(cause, changes, parameters)
        })
        .collect();
    all.extend(wider_chain_priors(run));
    all
}

/// Wider priors of the chain.
pub(super) fn wider_chain_priors(run: &DiagnosedRun<'_>) -> impl Iterator<Item = TrialHypothesis> {
    let parameters = if on_gimbal(run) { 6 + 4 * run.rig.joint_names().len() } else { 6 };
    CHAIN_FACTORS.into_iter().map(move |chain_prior| {
        let changes = ForkChanges { chain_prior, ..ForkChanges::default() };
        TrialHypothesis::change(Cause::Chain, changes, parameters)
    })
}

fn joint_hypotheses(joints: &[String]) -> Vec<TrialHypothesis> {
    if joints.is_empty() {
        return Vec::new();
    }
    let mut all: Vec<TrialHypothesis> = joints
        .iter()
        .map(|joint| TrialHypothesis::correction(Cause::JointReversed, MeasurementCorrection::Reversed(joint.clone())))
        .collect();
    for (place, first) in joints.iter().enumerate() {
        for second in &joints[place + 1..] {
            let swapped = MeasurementCorrection::Swapped(first.clone(), second.clone());
            all.push(TrialHypothesis::correction(Cause::JointsSwapped, swapped));
        }
    }
    for factor in [std::f64::consts::PI / 180.0, 180.0 / std::f64::consts::PI] {
        all.push(TrialHypothesis::correction(Cause::JointScale, MeasurementCorrection::JointScale(factor)));
    }
    for shift_s in SHIFTS_S {
        all.push(TrialHypothesis::correction(Cause::EncoderClock, MeasurementCorrection::JointShift(shift_s)));
    }
    for factor in NOISE_FACTORS {
        let changes = ForkChanges { encoder_noise: factor, ..ForkChanges::default() };
        all.push(TrialHypothesis::change(Cause::EncoderNoise, changes, 1));
    }
    all
}

/// Errors with which a run hardly initializes.
fn gross_hypotheses(axes: &PlausibleAxes) -> Vec<TrialHypothesis> {
    let mut all: Vec<TrialHypothesis> = flips().chain(axes_hypotheses(axes)).collect();
    for factor in ACCELEROMETER_FACTORS {
        let scale = MeasurementCorrection::AccelerometerScale(factor);
        all.push(TrialHypothesis::correction(Cause::AccelerometerScale, scale));
    }
    for factor in GYROSCOPE_FACTORS {
        all.push(TrialHypothesis::correction(Cause::GyroscopeScale, MeasurementCorrection::GyroscopeScale(factor)));
    }
    all
}

/// Mirrored and rotated images.
pub(super) fn flips() -> impl Iterator<Item = TrialHypothesis> {
    ImageFlip::all().map(|flip| TrialHypothesis::correction(Cause::ImageFlip, MeasurementCorrection::Image(flip)))
}

/// Axes of gyroscope and accelerometer together, and of each alone.
pub(super) fn axes_hypotheses(axes: &PlausibleAxes) -> Vec<TrialHypothesis> {
    let mut all = Vec::new();
    for axes in &axes.gyroscope {
        all.push(TrialHypothesis::correction(Cause::ImuAxes, MeasurementCorrection::ImuAxes(*axes)));
        all.push(TrialHypothesis::correction(Cause::GyroscopeAxes, MeasurementCorrection::GyroscopeAxes(*axes)));
    }
    for axes in &axes.accelerometer {
        all.push(TrialHypothesis::correction(
            Cause::AccelerometerAxes,
            MeasurementCorrection::AccelerometerAxes(*axes),
        ));
    }
    all
}
