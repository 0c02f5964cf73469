//! A run over a flight of synthetic tracks, without a log.

use std::sync::Arc;

use super::configuration::estimator_config;
use super::run_engine::RunEngine;
use super::step_inputs::{InputImage, OwnedStepInput};
use crate::session::plan::{RunSpec, SessionError};
use crate::session::record::{RunRecord, StepRecord};
use crate::simulation::{SyntheticFlight, SyntheticFrame};

/// The step input of a synthetic frame; joint angles are as uncertain as given, and missing without an uncertainty.
pub(in crate::session) fn input_of(frame: &SyntheticFrame, encoder_sigma_rad: Option<f64>) -> OwnedStepInput {
    OwnedStepInput {
        frame_index: frame.index,
        stamp_ns: frame.stamp_ns,
        log_time_ns: frame.stamp_ns,
        imu: frame.imu.clone(),
        imu_after: Vec::new(),
        image_times_s: Vec::new(),
        gimbal_imu: frame.gimbal_imu.clone(),
        joint_angles: encoder_sigma_rad.and_then(|sigma_rad| frame.encoder_angles(sigma_rad)),
        images: vec![InputImage { index: Some(frame.index), tracks: Arc::new(frame.tracks.clone()) }],
        ground_truth: Some(frame.true_world_from_imu),
        frontend_ms: 0.0,
    }
}

/// Runs the estimator over a synthetic flight of the camera `cam0`.
///
/// # Errors
///
/// If the specification does not fit the flight's rig.
pub fn record_synthetic(flight: &SyntheticFlight, spec: &RunSpec) -> Result<RunRecord, SessionError> {
    recorded_by(RunEngine::step, flight, spec, None)
}

/// [`record_synthetic`] with steps computed by a function, and every n-th report keeping its linearization.
pub(in crate::session) fn recorded_by(
    step: impl Fn(&mut RunEngine, &OwnedStepInput) -> StepRecord,
    flight: &SyntheticFlight,
    spec: &RunSpec,
    keep_linearization_every: Option<usize>,
) -> Result<RunRecord, SessionError> {
    let config = estimator_config(&flight.given_rig, spec)?;
    let encoder_sigma_rad = config.encoder_sigma_rad;
    let mut engine = RunEngine::new(config, keep_linearization_every);
    let mut run = RunRecord::new(spec.clone(), "cam0".to_owned());
    for frame in &flight.frames {
        run.push(step(&mut engine, &input_of(frame, encoder_sigma_rad)));
    }
    Ok(run)
}
