//! Information of a planned motion, window by window.
//!
//! The calibration is constant, so that the information of consecutive windows adds up. Each window starts with what
//! those before it have measured of pose, velocity and biases; no landmark is observed in two of them.

use std::ops::Range;

use nalgebra::DMatrix;

use super::super::Situation;
use super::super::advice::ADVICE_DURATION_S;
use super::super::predicted_window::predicted_linearization;
use super::keyframes::keyframe_times_s;
use crate::estimator::{ColumnId, FrameId, HypotheticalFrame, JointKnowledge, NavigationState};
use crate::geometry::{RigidTransform, ns_from_seconds};
use crate::observability::analysis::measured_rows;
use crate::observability::elimination::without_leading;
use crate::sensors::ImuSample;
use crate::simulation::{MotionSplines, Trajectory};
use nalgebra::Vector3;

/// Rate of the predicted IMU samples, which hardly affects their covariance.
const IMU_RATE_HZ: f64 = 50.0;
/// Features that the front end keeps in an image.
const FEATURES: usize = 150;
/// Largest number of keyframes in a window: with more, evenly chosen ones stand for all.
const MAX_KEYFRAMES: usize = 32;

/// Nearest and farthest distance of the scene that is assumed if nothing is known about it, in metres.
pub const SCENE_M: [f64; 2] = [4.0, 12.0];

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
    /// Features in each image.
    pub(super) features: usize,
    /// Keyframes for each one that is used.
    pub(super) thinning: usize,
}

impl WindowLayout {
    /// Windows of about 4 s with all keyframes.
    pub(super) fn fine(duration_s: f64) -> Self {
        let count = (duration_s / ADVICE_DURATION_S).round().max(1.0) as usize;
        Self { count, length_s: duration_s / count as f64, features: FEATURES, thinning: 1 }
    }

    /// The same windows with half of the keyframes and half of the features, for the first part of a search.
    pub(super) fn coarse(duration_s: f64) -> Self {
        Self { features: FEATURES / 2, thinning: 2, ..Self::fine(duration_s) }
    }

    /// Start and end of a window.
    pub(super) fn interval_s(&self, window: usize) -> [f64; 2] {
        [window, window + 1].map(|index| index as f64 * self.length_s)
    }

    /// Keyframes of an interval, evenly thinned.
    fn used(&self, mut times_s: Vec<f64>) -> Vec<f64> {
        let step = self.thinning.max(times_s.len().div_ceil(MAX_KEYFRAMES));
        let mut index = 0;
        times_s.retain(|_| {
            index += 1;
            (index - 1) % step == 0
        });
        times_s
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

/// Rows of the measurements of an interval over the motion of the IMU (pose, velocity, biases) at its start, over that at
/// its end, and over the calibration.
#[derive(Clone, Debug)]
pub(super) struct WindowRows {
    rows: DMatrix<f64>,
}

/// Columns of the motion of the IMU at one time: rotation, position, velocity, biases.
const MOTION: usize = 15;
/// Rotation about the vertical and position at the start of a flight, which nothing measures.
const UNOBSERVABLE: Range<usize> = 2..6;

/// Rows of an interval with keyframes at these times, the first one at its start; the motion at its end is measured by
/// the IMU alone. `images` is the number of images for each keyframe. `None` when a number is not finite.
pub(super) fn rows_of_keyframes(
    situation: &Situation,
    motion: &MotionSplines,
    trajectory: &Trajectory,
    (times_s, end_s): (&[f64], f64),
    (features, images): (usize, f64),
) -> Option<WindowRows> {
    let frames = frames(situation, motion, trajectory, &[times_s, &[end_s]].concat());
    // Readings at images that do not become keyframes are carried to the next one.
    let joints = match situation.encoders {
        JointKnowledge::Encoder(sigma_rad) => JointKnowledge::Encoder(sigma_rad / images.max(1.0).sqrt()),
        other => other,
    };
    let linearization = predicted_linearization(situation, frames, joints, features);
    let [first, last] = [0, times_s.len()].map(FrameId);
    let kept =
        [ColumnId::Pose(first), ColumnId::VelocityBias(first), ColumnId::Pose(last), ColumnId::VelocityBias(last)];
    Some(WindowRows { rows: measured_rows(&linearization, &kept)? })
}

/// Rows from the start of a window to a time in it, with the keyframes that the estimator makes. The readings at a
/// keyframe have the noise of the readings of the whole window, so that more of a window never measures less.
pub(super) fn rows_of_interval(
    situation: &Situation,
    motion: &MotionSplines,
    trajectory: &Trajectory,
    layout: &WindowLayout,
    [from_s, to_s]: [f64; 2],
) -> Option<WindowRows> {
    let whole_s = layout.interval_s((from_s / layout.length_s).round() as usize);
    let all_s = layout.used(keyframe_times_s(situation, motion, trajectory, whole_s));
    let images = layout.length_s / situation.image_period_s / all_s.len() as f64;
    let times_s: Vec<f64> = all_s.into_iter().filter(|time_s| *time_s < to_s - 1e-9).collect();
    rows_of_keyframes(situation, motion, trajectory, (&times_s, to_s), (layout.features, images))
}

/// Rows of a whole window.
pub(super) fn rows_of_window(
    situation: &Situation,
    motion: &MotionSplines,
    trajectory: &Trajectory,
    layout: &WindowLayout,
    window: usize,
) -> Option<WindowRows> {
    rows_of_interval(situation, motion, trajectory, layout, layout.interval_s(window))
}

/// Information matrix of the calibration (n × n, in column units) from consecutive windows: each starts with what those
/// before it have measured of the motion of the IMU.
pub(super) fn joined<'a>(windows: impl IntoIterator<Item = &'a WindowRows>, columns: usize) -> DMatrix<f64> {
    // Over the motion at the last frame so far and the calibration. Fixing what is unobservable at the start measures
    // nothing of the calibration; without it, rounding would decide which rows belong to these directions.
    let mut carried = DMatrix::zeros(UNOBSERVABLE.len(), MOTION + columns);
    for (row, column) in UNOBSERVABLE.enumerate() {
        carried[(row, column)] = 1.0;
    }
    for window in windows {
        let rows = &window.rows;
        let (before, own) = (carried.nrows(), rows.nrows());
        let mut stacked = DMatrix::zeros(before + own, rows.ncols());
        stacked.view_mut((0, 0), (before, MOTION)).copy_from(&carried.columns(0, MOTION));
        stacked.view_mut((0, 2 * MOTION), (before, columns)).copy_from(&carried.columns(MOTION, columns));
        stacked.rows_mut(before, own).copy_from(rows);
        carried = without_leading(&stacked, MOTION);
    }
    let calibration = without_leading(&carried, MOTION);
    calibration.tr_mul(&calibration)
}

/// Frames at these times of a planned motion, with the samples of the IMU between them.
fn frames(
    situation: &Situation,
    motion: &MotionSplines,
    trajectory: &Trajectory,
    times_s: &[f64],
) -> Vec<HypotheticalFrame> {
    let bias = situation.navigation.bias;
    let sample = |time_s: f64| {
        let kinematics = trajectory.at(time_s);
        ImuSample {
            stamp_ns: ns_from_seconds(time_s),
            angular_velocity_rad_per_s: kinematics.angular_velocity_rad_per_s + bias.gyroscope_rad_per_s,
            specific_force_m_per_s2: kinematics.specific_force_m_per_s2 + bias.accelerometer_m_per_s2,
            unmeasured_s: 0.0,
        }
    };
    let samples = |from_s: f64, to_s: f64| {
        let count = ((to_s - from_s) * IMU_RATE_HZ).round().max(1.0) as usize;
        (0..=count).map(|index| sample(from_s + (to_s - from_s) * index as f64 / count as f64)).collect()
    };
    let frame = |(slot, time_s): (usize, &f64)| {
        let kinematics = trajectory.at(*time_s);
        let world_from_imu: RigidTransform = kinematics.world_from_imu;
        HypotheticalFrame {
            time_s: *time_s,
            navigation: NavigationState { world_from_imu, velocity_m_per_s: kinematics.velocity_m_per_s, bias },
            joints_rad: motion.joints_rad(*time_s),
            imu: slot.checked_sub(1).map_or_else(Vec::new, |before| samples(times_s[before], *time_s)),
            camera_imu: None,
        }
    };
    times_s.iter().enumerate().map(frame).collect()
}
