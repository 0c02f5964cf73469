//! Initial trajectory: the sliding-window estimator processes the static camera.

use std::collections::BTreeMap;

use super::CalibrationError;
use super::input::StaticCamera;
use crate::estimator::{Estimator, EstimatorConfig, EventKind, ImuBias, NavigationState, StepInput};

/// Returns the last estimated state of every image of the static camera, `None` where the estimator was not
/// running. A restart leaves a gap of one image between the intervals. An error of `on_image`, called before each image, ends
/// the estimation.
pub(super) fn estimate_trajectory(
    camera: &StaticCamera,
    config: &EstimatorConfig,
    on_image: &mut dyn FnMut(usize) -> Result<(), CalibrationError>,
) -> Result<Vec<Option<NavigationState>>, CalibrationError> {
    let mut estimator = Estimator::new(config.clone());
    let places: BTreeMap<usize, usize> =
        camera.views.iter().enumerate().map(|(place, view)| (view.frame_index, place)).collect();
    let mut states = vec![None; camera.views.len()];
    let mut restarts = 0;
    let mut waits = "no image reached the estimator".to_owned();
    for (place, view) in camera.views.iter().enumerate() {
        on_image(place)?;
        let report = estimator.step(&StepInput {
            frame_index: view.frame_index,
            stamp_ns: view.stamp_ns,
            imu: &view.imu,
            imu_after: &[],
            joint_angles: None,
            tracks: &view.tracks,
            rigid_tracks: &[],
        });
        for event in report.events.iter().filter(|event| event.kind == EventKind::InitializationWaits) {
            waits.clone_from(&event.message);
        }
        if report.restarts > restarts {
            restarts = report.restarts;
            continue;
        }
        for frame in &report.window {
            if let Some(place) = places.get(&frame.frame_index) {
                states[*place] = Some(NavigationState {
                    world_from_imu: frame.world_from_imu,
                    velocity_m_per_s: frame.velocity_m_per_s,
                    bias: ImuBias {
                        gyroscope_rad_per_s: frame.gyroscope_bias_rad_per_s,
                        accelerometer_m_per_s2: frame.accelerometer_bias_m_per_s2,
                    },
                });
            }
        }
    }
    if states.iter().all(Option::is_none) {
        return Err(CalibrationError::NoTrajectory { camera: camera.key.clone(), reason: waits });
    }
    Ok(states)
}
