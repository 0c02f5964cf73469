//! Information of a planned motion, window by window.
//!
//! The calibration is constant, so that the information of consecutive windows adds up. Each window is independent of
//! the others: what it measured of pose, velocity and biases is not used by the next one.

use std::ops::Range;

use nalgebra::DMatrix;

use super::super::Situation;
use super::super::advice::{ADVICE_DURATION_S, FRAMES, LANDMARKS_PER_FRAME};
use super::super::predicted_window::predicted_information;
use crate::estimator::{HypotheticalFrame, NavigationState};
use crate::geometry::{RigidTransform, ns_from_seconds};
use crate::sensors::ImuSample;
use crate::simulation::{MotionSplines, Trajectory};
use nalgebra::Vector3;

/// Rate of the predicted IMU samples, which hardly affects their covariance.
const IMU_RATE_HZ: f64 = 50.0;

/// Time between the frames of a planned motion, in seconds.
pub const PLAN_FRAME_PERIOD_S: f64 = ADVICE_DURATION_S / FRAMES as f64;

/// Distances of an assumed scene from its nearest to its farthest point, in equal ratios.
pub fn scene_distances_m([near_m, far_m]: [f64; 2]) -> Vec<f64> {
    const DISTANCES: usize = 7;
    let ratio = |index: usize| index as f64 / (DISTANCES - 1) as f64;
    (0..DISTANCES).map(|index| near_m * (far_m / near_m).powf(ratio(index))).collect()
}

/// Division of a flight into windows of equal length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WindowLayout {
    pub(super) count: usize,
    /// Length of each window, in seconds.
    pub(super) length_s: f64,
    /// Number of frames in each window.
    pub(super) frames: usize,
    /// Landmarks drawn in the view of each frame.
    pub(super) landmarks: usize,
}

impl WindowLayout {
    /// Windows of about 4 s, with as many frames and landmarks as the candidates of the suggested excitation.
    pub(super) fn fine(duration_s: f64) -> Self {
        let count = (duration_s / ADVICE_DURATION_S).round().max(1.0) as usize;
        Self { count, length_s: duration_s / count as f64, frames: FRAMES, landmarks: LANDMARKS_PER_FRAME }
    }

    /// The same windows with half of the frames and half of the landmarks of each, for the first part of a search.
    pub(super) fn coarse(duration_s: f64) -> Self {
        Self { frames: FRAMES / 2, landmarks: LANDMARKS_PER_FRAME / 2, ..Self::fine(duration_s) }
    }

    /// Times of the frames of a window; a window ends one interval before the next one starts.
    pub(super) fn times_s(&self, window: usize) -> Vec<f64> {
        let period_s = self.length_s / self.frames as f64;
        (0..self.frames).map(|slot| window as f64 * self.length_s + slot as f64 * period_s).collect()
    }

    /// Windows that overlap an interval.
    pub(super) fn within(&self, [from_s, to_s]: [f64; 2]) -> Range<usize> {
        let first = (from_s.max(0.0) / self.length_s).floor() as usize;
        let last = (to_s.max(0.0) / self.length_s).ceil() as usize;
        first.min(self.count)..last.clamp(first.min(self.count), self.count)
    }
}

/// Flight of a planned motion in a world in which it starts at the origin, level, with heading zero.
pub(super) fn trajectory(situation: &Situation, motion: &MotionSplines) -> Trajectory {
    motion.trajectory(Vector3::zeros(), 0.0, situation.gravity_in_world.norm())
}

/// Information matrix (n × n, in column units) of frames at these times of a planned motion; `None` when it is not
/// finite.
pub(super) fn information_of_frames(
    situation: &Situation,
    motion: &MotionSplines,
    trajectory: &Trajectory,
    times_s: &[f64],
    landmarks: usize,
) -> Option<DMatrix<f64>> {
    let bias = situation.navigation.bias;
    let sample = |time_s: f64| {
        let kinematics = trajectory.at(time_s);
        ImuSample {
            stamp_ns: ns_from_seconds(time_s),
            angular_velocity_rad_per_s: kinematics.angular_velocity_rad_per_s + bias.gyroscope_rad_per_s,
            specific_force_m_per_s2: kinematics.specific_force_m_per_s2 + bias.accelerometer_m_per_s2,
        }
    };
    let samples = |from_s: f64, to_s: f64| {
        let count = ((to_s - from_s) * IMU_RATE_HZ).round().max(1.0) as usize;
        (0..=count).map(|index| sample(from_s + (to_s - from_s) * index as f64 / count as f64)).collect()
    };
    let frames = times_s.iter().enumerate().map(|(slot, time_s)| {
        let kinematics = trajectory.at(*time_s);
        let world_from_imu: RigidTransform = kinematics.world_from_imu;
        HypotheticalFrame {
            time_s: *time_s,
            navigation: NavigationState { world_from_imu, velocity_m_per_s: kinematics.velocity_m_per_s, bias },
            joints_rad: motion.joints_rad(*time_s),
            imu: slot.checked_sub(1).map_or_else(Vec::new, |before| samples(times_s[before], *time_s)),
            camera_imu: None,
        }
    });
    predicted_information(situation, frames.collect(), landmarks)
}

/// Information of one window of a planned motion.
pub(super) fn information_of_window(
    situation: &Situation,
    motion: &MotionSplines,
    trajectory: &Trajectory,
    layout: &WindowLayout,
    window: usize,
) -> Option<DMatrix<f64>> {
    information_of_frames(situation, motion, trajectory, &layout.times_s(window), layout.landmarks)
}

/// Sum in the order of the windows.
pub(super) fn sum<'a>(windows: impl IntoIterator<Item = &'a DMatrix<f64>>, columns: usize) -> DMatrix<f64> {
    windows.into_iter().fold(DMatrix::zeros(columns, columns), |sum, window| sum + window)
}
