//! Frames of the window.

use std::ops::{Deref, DerefMut};

use nalgebra::SVector;

use crate::estimator::config::EstimatorOptions;
use crate::estimator::state::frame::Frame;
use crate::estimator::state::imu_errors::ImuErrors;

/// Change of a scale error, a misalignment or the rotation in radians above which an interval is integrated again:
/// second-order effects are then one millionth.
const REINTEGRATION_INTRINSICS_CHANGE: f64 = 1e-3;

/// Frames of the window, oldest first; never empty.
#[derive(Clone, Debug)]
pub(crate) struct Frames(Vec<Frame>);

impl Frames {
    pub(crate) fn new(first: Frame) -> Self {
        Self(vec![first])
    }

    pub(crate) fn push(&mut self, newest: Frame) {
        self.0.push(newest);
    }

    pub(crate) fn newest_slot(&self) -> usize {
        self.0.len() - 1
    }

    pub(crate) fn oldest(&self) -> &Frame {
        &self.0[0]
    }

    pub(crate) fn newest(&self) -> &Frame {
        &self.0[self.newest_slot()]
    }

    pub(crate) fn newest_mut(&mut self) -> &mut Frame {
        let newest = self.newest_slot();
        &mut self.0[newest]
    }

    /// Removes the oldest frame, unless it is the only one.
    pub(crate) fn remove_oldest(&mut self) {
        if self.newest_slot() > 0 {
            self.0.remove(0);
        }
    }

    /// Removes the frame at a slot before the newest one; its IMU samples are prepended to the samples of the next
    /// frame.
    pub(crate) fn drop_before_newest(&mut self, slot: usize) {
        if slot >= self.newest_slot() {
            return;
        }
        let Frame { motion, gimbal_motion, .. } = self.0.remove(slot);
        let next = &mut self.0[slot];
        next.motion = motion.followed_by(next.motion.samples());
        let of_gimbal = gimbal_motion.zip(next.gimbal_motion.take());
        next.gimbal_motion = of_gimbal.map(|(before, after)| before.followed_by(after.samples()));
    }

    /// Integrates intervals again if, since their integration, the IMU intrinsics changed by more than
    /// [`REINTEGRATION_INTRINSICS_CHANGE`] or the bias by more than [`EstimatorOptions::reintegration_change`].
    pub(crate) fn reintegrate(&mut self, options: &EstimatorOptions, intrinsics: Option<&ImuErrors>) {
        let limit = options.reintegration_change;
        for slot in 1..self.0.len() {
            let (bias, own) = (self.0[slot - 1].state.navigation.bias, self.0[slot - 1].state.gimbal_imu);
            let frame = &mut self.0[slot];
            let exceeds = |change: SVector<f64, 6>| {
                let gyroscope = change.fixed_rows::<3>(0).abs() - limit.gyroscope_rad_per_s;
                let accelerometer = change.fixed_rows::<3>(3).abs() - limit.accelerometer_m_per_s2;
                gyroscope.max() > 0.0 || accelerometer.max() > 0.0
            };
            if let (Some(own), Some(gimbal)) = (own, &mut frame.gimbal_motion)
                && exceeds(gimbal.bias_change(&own.bias))
            {
                gimbal.reintegrate(own.bias, None);
            }
            let intrinsics_change = frame.motion.intrinsics_change(intrinsics).map_or(0.0, |change| change.amax());
            let reaches = intrinsics_change > REINTEGRATION_INTRINSICS_CHANGE;
            if exceeds(frame.motion.bias_change(&bias)) || reaches {
                frame.motion.reintegrate(bias, intrinsics.copied());
            }
        }
    }
}

impl Deref for Frames {
    type Target = [Frame];

    fn deref(&self) -> &[Frame] {
        &self.0
    }
}

impl DerefMut for Frames {
    fn deref_mut(&mut self) -> &mut [Frame] {
        &mut self.0
    }
}
