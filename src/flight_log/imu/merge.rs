//! Merges gyroscope and accelerometer of separate topics to IMU samples at the gyroscope's stamps.

use std::cmp::Ordering;
use std::collections::VecDeque;

use nalgebra::Vector3;

use crate::sensors::ImuSample;

/// Largest gap between two accelerometer samples for interpolation; an accelerometer has at least 50 Hz.
const MAX_GAP_NS: i64 = 50_000_000;

/// Merges the samples of two sensors, each in the order of its stamps: the specific force at a gyroscope stamp is
/// interpolated between the accelerometer samples around it. Gyroscope samples without such a pair are left out.
#[derive(Debug, Default)]
pub(crate) struct ImuMerge {
    /// Angular velocities in rad/s that are not released yet.
    gyroscope: VecDeque<(i64, Vector3<f64>)>,
    /// Specific forces in m/s², starting with the last one before the first of `gyroscope`.
    accelerometer: VecDeque<(i64, Vector3<f64>)>,
}

impl ImuMerge {
    /// Adds the next angular velocity in rad/s; stamps must not decrease.
    pub(crate) fn push_gyroscope(&mut self, stamp_ns: i64, angular_velocity_rad_per_s: Vector3<f64>) {
        self.gyroscope.push_back((stamp_ns, angular_velocity_rad_per_s));
    }

    /// Adds the next specific force in m/s²; stamps must not decrease.
    pub(crate) fn push_accelerometer(&mut self, stamp_ns: i64, specific_force_m_per_s2: Vector3<f64>) {
        self.accelerometer.push_back((stamp_ns, specific_force_m_per_s2));
    }

    /// True if the next sample waits for another angular velocity.
    pub(crate) fn needs_gyroscope(&self) -> bool {
        self.gyroscope.is_empty()
    }

    /// Next sample, `None` while a sample of either sensor is missing.
    pub(crate) fn pop(&mut self) -> Option<ImuSample> {
        loop {
            let (stamp_ns, angular_velocity_rad_per_s) = *self.gyroscope.front()?;
            while self.accelerometer.get(1).is_some_and(|(second_ns, _)| *second_ns <= stamp_ns) {
                self.accelerometer.pop_front();
            }
            let (before_ns, before) = *self.accelerometer.front()?;
            let force = match before_ns.cmp(&stamp_ns) {
                Ordering::Equal => Some(before),
                Ordering::Greater => None,
                Ordering::Less => {
                    let (after_ns, after) = *self.accelerometer.get(1)?;
                    let fraction = (stamp_ns - before_ns) as f64 / (after_ns - before_ns) as f64;
                    (after_ns - before_ns <= MAX_GAP_NS).then(|| before + fraction * (after - before))
                }
            };
            self.gyroscope.pop_front();
            if let Some(specific_force_m_per_s2) = force {
                return Some(ImuSample {
                    stamp_ns,
                    angular_velocity_rad_per_s,
                    specific_force_m_per_s2,
                    unmeasured_s: 0.0,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn merged(gyroscope_ms: &[i64], accelerometer_ms: &[i64]) -> Vec<(i64, f64)> {
        let mut merge = ImuMerge::default();
        for at in gyroscope_ms {
            merge.push_gyroscope(at * MS, Vector3::new(*at as f64, 0.0, 0.0));
        }
        for at in accelerometer_ms {
            merge.push_accelerometer(at * MS, Vector3::new(0.0, 0.0, 10.0 + *at as f64));
        }
        std::iter::from_fn(|| merge.pop())
            .map(|sample| {
                assert!((sample.angular_velocity_rad_per_s.x * MS as f64 - sample.stamp_ns as f64).abs() < 1e-6);
                (sample.stamp_ns / MS, sample.specific_force_m_per_s2.z)
            })
            .collect()
    }

    #[test]
    fn forces_are_interpolated_at_the_stamps_of_the_gyroscope() {
        // The first stamp has no force before it, the last one none after it.
        let samples = merged(&[2, 6, 16, 20, 25, 35], &[4, 16, 28]);
        assert_eq!(samples, [(6, 16.0), (16, 26.0), (20, 30.0), (25, 35.0)]);
    }

    #[test]
    fn gaps_of_the_accelerometer_are_not_interpolated() {
        assert_eq!(
            merged(&[0, 5, 50, 100, 105], &[0, 10, 99, 109]),
            [(0, 10.0), (5, 15.0), (100, 110.0), (105, 115.0)]
        );
        assert!(merged(&[0, 5], &[]).is_empty());
    }

    #[test]
    fn a_sample_waits_for_the_other_sensor() {
        let mut merge = ImuMerge::default();
        assert!(merge.needs_gyroscope());
        merge.push_gyroscope(5, Vector3::zeros());
        merge.push_accelerometer(0, Vector3::zeros());
        assert!(merge.pop().is_none() && !merge.needs_gyroscope());
        merge.push_accelerometer(10, Vector3::new(0.0, 0.0, 2.0));
        assert_eq!(merge.pop().map(|sample| sample.specific_force_m_per_s2.z), Some(1.0));
    }
}
