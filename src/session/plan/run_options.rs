//! The options of a run: one row per key of a specification. Parser, canonical text, messages, `--help`, the dialog "Add a
//! run" and docs/commands.md come from this table.

use std::collections::BTreeSet;

use super::run_spec::{RunSpec, folder_name};
use crate::estimator::SensorParameters;
use crate::optimization::RobustLoss;
use crate::text::{Entry, Field, Key};

/// Range of the scale of a robust loss, in standard deviations.
const LOSS_SCALES: std::ops::RangeInclusive<f64> = 0.05..=100.0;
const ITERATIONS: std::ops::RangeInclusive<usize> = 1..=100;

impl RunSpec {
    /// The options, in the order of the canonical text.
    pub const KEYS: &'static [Key<Self>] = &[
        Key::<Self>::switch(
            "encoder",
            "use the encoder readings; `off` estimates joint angles without a prior",
            |spec| &mut spec.encoder,
        )
        .labelled("Use", "Encoder readings", ""),
        Key::<Self>::switch(
            "calibrate",
            "estimate the static calibration; `off` keeps the rig's values fixed, joint angles are still estimated",
            |spec| &mut spec.calibrate,
        )
        .labelled("Estimate", "Calibration parameters", ""),
        Key::<Self>::switch(
            SensorParameters::Timeshift.key(),
            "estimate the time offsets of cameras and encoders to the IMU",
            |spec| &mut spec.timeshift,
        )
        .labelled("", "Time offsets of cameras and encoders", ""),
        Key::<Self>::switch(
            SensorParameters::Readout.key(),
            "estimate the readout times of rolling shutters",
            |spec| &mut spec.readout,
        ),
        Key::<Self>::switch(
            SensorParameters::Intrinsics.key(),
            "estimate fx, fy, cx, cy and the first two coefficients of the lens of each camera",
            |spec| &mut spec.intrinsics,
        ),
        Key::<Self>::switch(
            SensorParameters::ImuIntrinsics.key(),
            "estimate scale and misalignment of gyroscope and accelerometer, and the rotation between them",
            |spec| &mut spec.imu_intrinsics,
        ),
        Key::<Self>::switch(
            "gimbal-imu",
            "use the IMU on the gimbal (`imu1` of the rig); `off` is for comparison",
            |spec| &mut spec.gimbal_imu,
        ),
        Key::<Self>::switch(
            SensorParameters::GimbalImu.key(),
            "estimate pose and time offset of the IMU on the gimbal",
            |spec| &mut spec.gimbal_imu_axes,
        ),
        Key::<Self>::switch(
            "first-estimates",
            "evaluate Jacobians of the prior's states at first estimates (FEJ); `off` shows the spurious information",
            |spec| &mut spec.first_estimates,
        )
        .labelled(
            "Linearization",
            "First-estimate Jacobians (FEJ)",
            "Off: the prior gains spurious information about unobservable directions",
        ),
        // Two keyframes give too little parallax; with more than thirty the solve takes much longer than real time.
        Key::<Self>::new("window", "N", "keyframes in the window", Field::Count(|spec| &mut spec.window, 4..=30))
            .labelled("", "Keyframes in the window", ""),
        // More than three change little.
        Key::<Self>::new(
            "passes",
            "N",
            "passes over the log: each starts with the calibration and the biases that the one before found, and the \
             last one is the result",
            Field::Count(|spec| &mut spec.passes, 1..=3),
        )
        .labelled(
            "",
            "Passes over the log",
            "Each pass starts with the calibration and the biases of the previous pass; the last pass is shown",
        ),
        pixel_noise(|spec| &mut spec.tuning.pixel_noise),
        imu_noise(|spec| &mut spec.tuning.imu_noise),
        encoder_noise(|spec| &mut spec.tuning.encoder_noise),
        Key::<Self>::new(
            "loss",
            "none|huber-K|cauchy-K",
            "robust loss of the reprojection residuals with its scale in σ; by default `cauchy` with a scale that follows \
             the residuals, from 0.3 to 1, and a loss of whole tracks",
            Field::Other(read_loss, |spec| spec.tuning.loss.iter().map(loss_text).collect()),
        ),
        Key::<Self>::new(
            "iterations",
            "N",
            "largest number of iterations of a solve; 1 to 100, 6 by default",
            Field::Other(read_iterations, |spec| spec.tuning.iterations.iter().map(usize::to_string).collect()),
        ),
        Key::<Self>::new(
            "camera",
            "KEY",
            "the camera to use, as in `camera=cam1`",
            Field::Other(
                |spec, entry| {
                    spec.camera_key = Some(entry.value.to_owned());
                    Ok(())
                },
                |spec| spec.camera_key.iter().cloned().collect(),
            ),
        ),
        Key::<Self>::new(
            "cameras",
            "KEY+KEY",
            "the cameras of a `cluster`, as in `cameras=cam0+cam2`; by default all of the rig",
            Field::Other(read_cameras, |spec| {
                let keys = spec.cluster_keys.join("+");
                (!keys.is_empty()).then_some(keys).into_iter().collect()
            }),
        ),
        // The canonical text of the settings has no name.
        Key::<Self>::new("name", "LABEL", "name on screen and of the folder", Field::Other(read_name, |_| Vec::new())),
    ];
}

/// Factor on the standard deviation of a tracked pixel, in a run and in a fork.
pub(super) const fn pixel_noise<T: Clone>(field: fn(&mut T) -> &mut f64) -> Key<T> {
    noise_factor("pixel-noise", "factor on the standard deviation of a tracked pixel", field)
}

/// Factor on the noise densities of the IMU, in a run and in a fork.
pub(super) const fn imu_noise<T: Clone>(field: fn(&mut T) -> &mut f64) -> Key<T> {
    noise_factor("imu-noise", "factor on the noise densities of the IMU", field)
}

/// Factor on the standard deviation of the encoders, in a run and in a fork.
pub(super) const fn encoder_noise<T: Clone>(field: fn(&mut T) -> &mut f64) -> Key<T> {
    noise_factor("encoder-noise", "factor on the standard deviation of the encoders", field)
}

const fn noise_factor<T: Clone>(name: &'static str, meaning: &'static str, field: fn(&mut T) -> &mut f64) -> Key<T> {
    Key::new(name, "F", meaning, Field::Factor(field, 1e-3..=1e3))
}

fn read_loss(spec: &mut RunSpec, entry: &Entry<'_>) -> Result<(), String> {
    let scaled = |text: &str| text.parse::<f64>().ok().filter(|scale| LOSS_SCALES.contains(scale));
    let loss = match entry.value.split_once('-') {
        None if entry.value == "none" => Some(RobustLoss::None),
        Some(("huber", scale)) => scaled(scale).map(RobustLoss::Huber),
        Some(("cauchy", scale)) => scaled(scale).map(RobustLoss::Cauchy),
        _ => None,
    };
    let expected = "none, huber-K or cauchy-K with K from 0.05 to 100 σ, as in huber-1.5";
    spec.tuning.loss = Some(loss.ok_or_else(|| entry.problem(expected))?);
    Ok(())
}

fn loss_text(loss: &RobustLoss) -> String {
    match loss {
        RobustLoss::None => "none".to_owned(),
        RobustLoss::Huber(scale) => format!("huber-{scale}"),
        RobustLoss::Cauchy(scale) => format!("cauchy-{scale}"),
    }
}

fn read_iterations(spec: &mut RunSpec, entry: &Entry<'_>) -> Result<(), String> {
    let expected = || entry.problem(&format!("a number from {} to {}", ITERATIONS.start(), ITERATIONS.end()));
    spec.tuning.iterations = Some(entry.number(&ITERATIONS).ok_or_else(expected)?);
    Ok(())
}

fn read_cameras(spec: &mut RunSpec, entry: &Entry<'_>) -> Result<(), String> {
    let keys: Vec<String> = entry.value.split('+').map(str::to_owned).collect();
    let distinct: BTreeSet<&String> = keys.iter().collect();
    if keys.len() < 2 || distinct.len() < keys.len() || keys.iter().any(String::is_empty) {
        return Err(entry.problem("two or more different keys of cameras, as in cam0+cam2"));
    }
    spec.cluster_keys = keys;
    Ok(())
}

fn read_name(spec: &mut RunSpec, entry: &Entry<'_>) -> Result<(), String> {
    if entry.value.is_empty() || folder_name(entry.value) != entry.value {
        return Err(entry.problem("letters, digits, '-', '_' and '.' only"));
    }
    entry.value.clone_into(&mut spec.label);
    Ok(())
}
