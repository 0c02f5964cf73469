//! Initial trajectory: the sliding-window estimator processes the static camera.

use std::collections::BTreeMap;

use super::CalibrationError;
use super::input::{StaticCamera, TrackedView};
use crate::estimator::{Estimator, EstimatorConfig, EventKind, ImuBias, NavigationState, StepInput};

/// Estimation of the initial trajectory, image by image as they are tracked.
pub struct InitialTrajectory {
    estimator: Estimator,
    /// Index of an image in `states`, by its frame index.
    places: BTreeMap<usize, usize>,
    states: Vec<Option<NavigationState>>,
    restarts: usize,
    /// Last reason for waiting, reported if there is no state.
    waits: String,
}

impl InitialTrajectory {
    pub fn new(config: EstimatorConfig) -> Self {
        Self {
            estimator: Estimator::new(config),
            places: BTreeMap::new(),
            states: Vec::new(),
            restarts: 0,
            waits: "no image reached the estimator".to_owned(),
        }
    }

    /// Processes the next image of the static camera.
    pub fn step(&mut self, view: &TrackedView) {
        self.places.insert(view.frame_index, self.states.len());
        self.states.push(None);
        let report = self.estimator.step(&StepInput {
            frame_index: view.frame_index,
            stamp_ns: view.stamp_ns,
            imu: &view.imu,
            imu_after: &[],
            gimbal_imu: &[],
            joint_angles: None,
            tracks: &view.tracks,
            rigid_tracks: &[],
        });
        for event in report.events.iter().filter(|event| event.kind == EventKind::InitializationWaits) {
            self.waits.clone_from(&event.message);
        }
        if report.restarts > self.restarts {
            self.restarts = report.restarts;
            return;
        }
        for frame in &report.window {
            if let Some(place) = self.places.get(&frame.frame_index) {
                self.states[*place] = Some(NavigationState {
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

    /// Last estimated state of every image, `None` where the estimator was not tracking. A restart leaves a gap of one
    /// image between the intervals.
    pub(super) fn states(self, camera_key: &str) -> Result<Vec<Option<NavigationState>>, CalibrationError> {
        if self.states.iter().all(Option::is_none) {
            return Err(CalibrationError::NoTrajectory { camera: camera_key.to_owned(), reason: self.waits });
        }
        Ok(self.states)
    }
}

/// Trajectory over all images of the static camera. An error of `on_image`, called before each image, stops it.
pub(super) fn estimate_trajectory(
    camera: &StaticCamera,
    config: &EstimatorConfig,
    on_image: &mut dyn FnMut(usize) -> Result<(), CalibrationError>,
) -> Result<InitialTrajectory, CalibrationError> {
    let mut trajectory = InitialTrajectory::new(config.clone());
    for (place, view) in camera.views.iter().enumerate() {
        on_image(place)?;
        trajectory.step(view);
    }
    Ok(trajectory)
}
