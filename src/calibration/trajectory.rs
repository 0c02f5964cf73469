//! Initial trajectory, for which the sliding-window estimator processes the static camera, and the trajectory from the
//! bundle adjustment of the whole flight.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::CalibrationError;
use super::frame_sets::{FrameSet, ImuBuffer};
use super::input::{StaticCamera, TrackedView};
use crate::estimator::{Estimator, EstimatorConfig, EventKind, ImuBias, NavigationState, PoseCovariance, StepInput};
use crate::geometry::RigidTransform;
use crate::sensors::ImuNoise;

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
            image_times_s: &[],
            gimbal_imu: &[],
            joint_angles: None,
            tracks: &view.tracks,
            further_tracks: &[],
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

/// Time between poses in nanoseconds: interpolation between them has an error of at most 0.13 mm at 10 m/s².
const STEP_NS: i64 = 10_000_000;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchPose {
    /// Time in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    /// Pose of the IMU. Position and yaw of the first one are taken from the sliding-window estimator.
    pub world_from_imu: RigidTransform,
    /// Covariance relative to position and yaw of the first pose; `None` for poses that are not adjusted, or if not
    /// requested ([`CalibrationOptions::pose_covariances`](super::CalibrationOptions::pose_covariances)).
    pub covariance: Option<PoseCovariance>,
}

/// Adjusted states with their covariances, and between them poses predicted by the IMU samples since the last one.
pub(super) fn batch_trajectory(
    imu: &ImuBuffer,
    noise: ImuNoise,
    gravity_in_world: &Vector3<f64>,
    frame_sets: &[FrameSet],
    states: &[NavigationState],
    covariances: &[PoseCovariance],
) -> Vec<BatchPose> {
    let mut poses = Vec::new();
    for (place, (frame_set, state)) in frame_sets.iter().zip(states).enumerate() {
        let from_ns = frame_set.stamp_ns;
        poses.push(BatchPose {
            stamp_ns: from_ns,
            world_from_imu: state.world_from_imu,
            covariance: covariances.get(place).copied(),
        });
        let Some(next) = frame_sets.get(place + 1) else { break };
        let between = (1..).map(|step| from_ns + step * STEP_NS).take_while(|stamp_ns| *stamp_ns < next.stamp_ns);
        poses.extend(between.map(|stamp_ns| {
            let motion = imu.integrated(noise, state.bias, from_ns, stamp_ns);
            let world_from_imu = motion.predict(state, gravity_in_world).world_from_imu;
            BatchPose { stamp_ns, world_from_imu, covariance: None }
        }));
    }
    poses
}
