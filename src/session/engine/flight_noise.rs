//! Noise densities of the IMU fitted to a flight: features of one camera are tracked once, then the estimator runs over them
//! with changing densities.

use std::ops::ControlFlow;
use std::sync::Arc;

use thiserror::Error;

use super::configuration::estimator_config;
use super::tracker::CameraTracker;
use crate::calibration::{FlightNoise, ImuNoiseError, TrackedView, fit_imu_noise};
use crate::flight_log::FlightLog;
use crate::geometry::seconds_from_ns;
use crate::sensors::{CameraMount, Rig};
use crate::session::plan::{ParameterizationChoice, RunSpec, SessionError, cameras_of_run, check_start};

/// Fraction of the progress that feature tracking takes.
const TRACKING_RATIO: f64 = 0.5;

/// Reason why no noise densities were fitted to a flight.
#[derive(Debug, Error)]
pub enum FlightNoiseError {
    /// The log cannot be read, or the rig has no camera.
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error("no noise densities can be fitted to the flight: {0}")]
    Fit(#[from] ImuNoiseError),
}

/// Fits the noise densities of a rig to a flight from `start_s` on, with a rigid camera if there is one, else with the
/// gimbal camera. Also returns the key of that camera.
///
/// # Errors
/// If the log or the rig does not allow a run, the flight is too short, or `on_progress` breaks.
pub fn fit_flight_noise(
    log: &Arc<FlightLog>,
    rig: &Rig,
    (start_s, duration_s): (f64, Option<f64>),
    on_progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(FlightNoise, String), FlightNoiseError> {
    check_start(log, start_s)?;
    let rigid = rig.cameras.iter().any(|camera| camera.mount != CameraMount::Gimbal);
    let choice = if rigid { ParameterizationChoice::Static } else { ParameterizationChoice::Auto };
    let spec = RunSpec { parameterization: choice, ..RunSpec::default() };
    let camera_key = cameras_of_run(rig, &spec)?.main.key.clone();
    let config = estimator_config(rig, &spec)?;
    let log_s = seconds_from_ns(log.duration_ns()) - start_s;
    let length_s = duration_s.map_or(log_s, |duration_s| duration_s.min(log_s)).max(1e-3);
    let mut tracker = CameraTracker::new(Arc::clone(log), rig, &camera_key, start_s, duration_s)?;
    let mut views = Vec::new();
    while let Some((input, _)) = tracker.next_input() {
        let fraction = (seconds_from_ns(input.stamp_ns) - start_s) / length_s;
        if on_progress(TRACKING_RATIO * fraction).is_break() {
            return Err(ImuNoiseError::Interrupted.into());
        }
        views.push(TrackedView {
            frame_index: input.frame_index,
            stamp_ns: input.stamp_ns,
            tracks: Arc::clone(input.main_tracks()),
            imu: input.imu,
            joint_angles: input.joint_angles,
        });
    }
    let noise = fit_imu_noise(&config, &views, &mut |fraction| {
        on_progress(TRACKING_RATIO + (1.0 - TRACKING_RATIO) * fraction)
    })?;
    Ok((noise, camera_key))
}
